"""What a program loads to start: no package and no part of meshtide that it has no use for.

Counted are modules, not seconds; those are measured by tests/bench/start_up.py.
"""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from meshtide_codec.encoder import encode
from meshtide_codec.testing import grid

if TYPE_CHECKING:
    from pathlib import Path

TYPER = {
    *("typer", "rich", "pygments", "markdown_it", "mdurl", "shellingham", "annotated_doc"),
    *("pydantic", "pydantic_core", "annotated_types", "typing_extensions", "typing_inspection", "colorama", "click"),
}
"""It, and what it may load for itself."""
OWN = {"meshtide_client", "meshtide_codec", "meshtide_lab", "meshtide_server"}
TELL = (
    "import atexit, sys\natexit.register(lambda: print('\\n'.join(sorted(sys.modules)), file=open('modules', 'w')))\n"
)
COMMAND = TELL + "from meshtide_client.main import main\nmain()"


def loaded(folder: Path, program: str, *arguments: str) -> set[str]:
    """The modules that a program has loaded at its end."""
    subprocess.run([sys.executable, "-c", program, *arguments], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return set((folder / "modules").read_text().split())


def packages(modules: set[str], known: set[str]) -> set[str]:
    """Those that are neither of Python's library nor of its installation, but for `known`."""
    found = {name.partition(".")[0] for name in modules} - set(sys.stdlib_module_names) - known
    return {name for name in found if not name.startswith("_")}


@pytest.fixture(name="folder")
def _folder(tmp_path: Path) -> Path:
    (tmp_path / "patch.tide").write_bytes(encode(grid(12)).to_bytes())
    return tmp_path


def test_the_list_of_commands_needs_typer_and_little_else(folder: Path) -> None:
    modules = loaded(folder, COMMAND, "--help")
    assert packages(modules, TYPER) == OWN
    assert sum(name.partition(".")[0] in OWN for name in modules) <= 38


def test_a_decode_needs_numpy_and_little_else(folder: Path) -> None:
    program = TELL + "import meshtide_codec\nmeshtide_codec.decode(open('patch.tide', 'rb').read())"
    modules = loaded(folder, program)
    assert packages(modules, set()) == {"numpy", "meshtide_codec"}
    assert sum(name.startswith("meshtide_codec") for name in modules) <= 26
    assert not modules & {"importlib.metadata", "importlib.resources", "zipfile", "asyncio", "subprocess", "json"}


def test_the_command_decode_needs_no_more_than_both(folder: Path) -> None:
    modules = loaded(folder, COMMAND, "decode", "patch.tide")
    assert packages(modules, TYPER | OWN) == {"numpy"}
    assert sum(name.partition(".")[0] in OWN for name in modules) <= 82
    assert (folder / "patch.decoded.ply").is_file()
