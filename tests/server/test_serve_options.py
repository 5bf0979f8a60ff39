"""The options of `serve` are those that the settings name."""

from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from meshtide_server import commands, serving
from meshtide_server.operations import logs
from meshtide_server.serve_options import option_names, serve_parameters
from meshtide_server.settings import Settings


def test_every_option_is_of_a_setting_and_none_has_two() -> None:
    names = option_names()
    assert set(names) <= set(Settings.model_fields)
    assert [parameter.name for parameter in serve_parameters()] == list(names)
    assert len(set(names.values())) == len(names)
    assert not {"database", "write_tokens", "read_tokens"} & set(names)  # everybody on the machine can read arguments


def test_what_is_not_given_is_left_to_the_other_sources_and_nothing_is_something(
    monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    ran: list[Settings] = []
    monkeypatch.setattr(serving, "run", lambda settings, **_: ran.append(settings))
    monkeypatch.setattr(logs, "set_up_log", lambda _level, _form: None)
    monkeypatch.setenv("MESHTIDE_RECURSIVE", "true")
    monkeypatch.setenv("MESHTIDE_ALLOWED_METHODS", "GET")
    app = typer.Typer()
    app.command()(commands.serve)
    given = ["--rescan-seconds", "0", "--port", "0", "--trusted-proxy", "10.0.0.0/8", "--trusted-proxy", "::1"]
    result: Any = CliRunner().invoke(app, [str(folder), *given])
    assert result.exit_code == 0, result.output
    (settings,) = ran
    assert (settings.directory, settings.rescan_seconds, settings.port) == (folder, 0.0, 0)
    assert settings.trusted_proxies == ("10.0.0.0/8", "::1/128")
    assert (settings.recursive, settings.allowed_methods, settings.samples) == (True, ("GET",), False)
