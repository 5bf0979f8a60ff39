from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import version

import pytest

from meshtide_codec.command_line import ExitCode

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
        "import sys\nfrom meshtide_client.commands.application import build\nbuild()\n"
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


INTERRUPTED_IMPORT = """
import os, signal, sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupting())
sys.argv = ["meshtide", "sphere"]
from meshtide_client.main import main
main()
"""


@pytest.mark.parametrize(
    "module",
    [
        "meshtide_client.commands.application",
        "typer",
        "meshtide_codec.command_line",
        "meshtide_lab.simulation.commands",
        "meshtide_codec.commands.sphere",
        "numpy",
        "numpy._core._multiarray_umath",
        "scipy.sparse",
    ],
)
def test_ctrl_c_during_imports_ends_in_one_line(module: str) -> None:
    code = INTERRUPTED_IMPORT.format(module=module)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == "meshtide: interrupted\n"
    assert done.returncode == ExitCode.INTERRUPTED
    assert done.stdout == ""
