from __future__ import annotations

from importlib.metadata import EntryPoint, EntryPoints

import pytest

from meshtide_client import other_packages
from meshtide_client.other_packages import offered
from meshtide_codec.errors import OptionError


def find(name: str) -> object:
    return offered("meshtide.boats", name, missing="rowing needs a boat", remedy="swim")


def test_what_is_registered_is_loaded_by_group_and_name(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [
        EntryPoint("row", "meshtide_client.nothing:at_all", "meshtide.planes"),
        EntryPoint("sail", "meshtide_client.nothing:at_all", "meshtide.boats"),
        EntryPoint("row", "meshtide_client.other_packages:offered", "meshtide.boats"),
    ]
    monkeypatch.setattr(other_packages, "entry_points", EntryPoints(points).select)
    assert find("row") is offered


def test_what_is_missing_is_said_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [EntryPoint("row", "meshtide_no_boats:boat", "meshtide.boats")]
    monkeypatch.setattr(other_packages, "entry_points", EntryPoints(points).select)
    with pytest.raises(OptionError, match="^rowing needs a boat; swim$"):
        find("sail")
    with pytest.raises(OptionError, match="^rowing needs a boat; No module named 'meshtide_no_boats'$"):
        find("row")
