from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import EntryPoint, version

import pytest
import typer
from typer.testing import CliRunner

from meshtide_client import main

HEAVY = ("numpy", "scipy", "trimesh", "fastapi", "pydantic", "uvicorn", "websockets", "httpx")


def meshtide(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "meshtide_client.main", *arguments],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "COLUMNS": "100"},
    )


def test_help_names_the_commands_of_all_packages() -> None:
    done = meshtide("--help")
    assert done.returncode == 0
    for command in ("encode", "decode", "info", "serve", "fetch", "meshes", "demo"):
        assert f" {command} " in done.stdout


def test_version() -> None:
    done = meshtide("--version")
    assert done.stdout == f"meshtide {version('meshtide')}\n"
    assert done.returncode == 0


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys\nfrom meshtide_client.main import build\nbuild()\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_an_unknown_command_is_a_usage_error() -> None:
    done = meshtide("swim")
    assert done.returncode == 2
    assert "swim" in done.stderr


@pytest.mark.parametrize(
    "command", ["encode", "decode", "compare", "fetch", "export", "demo", "render", "paper", "simulate"]
)
def test_every_command_that_writes_files_can_be_told_to_replace_them(command: str) -> None:
    done = meshtide(command, "--help")
    assert done.returncode == 0
    assert "--overwrite" in done.stdout


@pytest.mark.parametrize("command", ["fetch", "meshes", "demo"])
def test_every_command_shows_an_example(command: str) -> None:
    done = meshtide(command, "--help")
    assert done.returncode == 0
    assert f"Example: meshtide {command}" in done.stdout


def test_commands_of_other_packages_come_last(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [
        EntryPoint("viewer", "tests_that_do_not_exist:register", "meshtide.commands"),
        EntryPoint("client", "meshtide_client.commands:register", "meshtide.commands"),
    ]
    loaded: list[str] = []

    def load(point: EntryPoint) -> object:
        loaded.append(point.name)
        return lambda _app: None

    monkeypatch.setattr(main, "entry_points", lambda group: points if group == "meshtide.commands" else [])
    monkeypatch.setattr(EntryPoint, "load", load)
    assert isinstance(main.build(), typer.Typer)
    assert loaded == ["client", "viewer"]


def test_commands_without_arguments_show_their_help() -> None:
    assert "Usage" in CliRunner().invoke(main.build(), []).output
