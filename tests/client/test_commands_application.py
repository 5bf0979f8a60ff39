from __future__ import annotations

from importlib.metadata import EntryPoint
from typing import TYPE_CHECKING

import typer
from typer.testing import CliRunner

from meshtide_client.commands import application

if TYPE_CHECKING:
    import pytest


def test_commands_of_other_packages_come_last(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [
        EntryPoint("viewer", "tests_that_do_not_exist:register", "meshtide.commands"),
        EntryPoint("client", "meshtide_client.commands:register", "meshtide.commands"),
    ]
    loaded: list[str] = []

    def load(point: EntryPoint) -> object:
        loaded.append(point.name)
        return lambda _app: None

    monkeypatch.setattr(application, "entry_points", lambda group: points if group == "meshtide.commands" else [])
    monkeypatch.setattr(EntryPoint, "load", load)
    assert isinstance(application.build(), typer.Typer)
    assert loaded == ["client", "viewer"]


def test_commands_without_arguments_show_their_help() -> None:
    assert "Usage" in CliRunner().invoke(application.build(), []).output
