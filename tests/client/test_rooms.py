"""Which room imports which: arrows point down, in the client and in the laboratory above it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CLIENT = ("connection", "download", "remote", "export", "commands")
"""Rooms of the client, the lowest first; each may import those before it."""
MAY_IMPORT = {
    "meshtide_codec": {"meshtide_codec"},
    "meshtide_client": {"meshtide_codec", "meshtide_client"},
    "meshtide_lab": {"meshtide_codec", "meshtide_client", "meshtide_lab"},
}
LAB = {
    "link": set[str](),
    "comparison": set[str](),
    "training": set[str](),
    "simulation": {"link"},
    "paper": {"link"},
}


def modules(package: str) -> dict[str, Path]:
    """The modules of a package by their dotted names."""
    folder = next(ROOT.glob(f"*/{package}"))
    return {".".join(path.relative_to(folder.parent).with_suffix("").parts): path for path in folder.rglob("*.py")}


def imported(path: Path) -> set[str]:
    """What a module imports of meshtide, wherever it does and if only for types."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name for name in found if name.startswith("meshtide_")}


def rooms(package: str, name: str) -> set[str]:
    """The rooms of its own package that a module imports."""
    found = {each.split(".")[1] for each in imported(modules(package)[name]) if each.startswith(f"{package}.")}
    return {room for room in found if (next(ROOT.glob(f"*/{package}")) / room).is_dir()}


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_packages_import_those_below(package: str) -> None:
    for name, path in modules(package).items():
        assert {each.partition(".")[0] for each in imported(path)} <= MAY_IMPORT[package], name


def test_rooms_of_the_client_import_those_below() -> None:
    for name in modules("meshtide_client"):
        room = name.split(".")[1]
        if room in CLIENT:
            assert rooms("meshtide_client", name) <= set(CLIENT[: CLIENT.index(room) + 1]), name
    assert rooms("meshtide_client", "meshtide_client.remote.listing") == {"connection", "remote"}


def test_downloads_and_requests_know_nothing_of_each_other() -> None:
    for name in modules("meshtide_client"):
        if name.startswith("meshtide_client.remote."):
            assert "download" not in rooms("meshtide_client", name), name


def test_rooms_of_the_laboratory_import_those_below() -> None:
    for name in modules("meshtide_lab"):
        room = name.split(".")[1]
        if room in LAB:
            assert rooms("meshtide_lab", name) <= LAB[room] | {room}, name


@pytest.mark.parametrize("package", ["meshtide_client", "meshtide_lab"])
def test_every_room_says_what_it_holds_and_what_it_may_import(package: str) -> None:
    folder = next(ROOT.glob(f"*/{package}"))
    doors = list(folder.glob("*/__init__.py"))
    assert {path.parent.name for path in doors} == set(CLIENT if package == "meshtide_client" else LAB)
    for path in doors:
        assert "may import" in (ast.get_docstring(ast.parse(path.read_text())) or ""), path
