"""The examples of the documents: every block of Python, and the commands that the README begins with."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.samples import load_sample
from meshtide_codec.testing import grid

ROOT = Path(__file__).parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PYTHON = [
    pytest.param(block, id=f"{path.name}-{number}")
    for path in DOCUMENTS
    for number, block in enumerate(re.findall(r"(?ms)^```python\n(.*?)^```", path.read_text()))
]
SERVED = "http://127.0.0.1:8000/meshes/scan"
"""What a server would host that stands behind the examples."""


@pytest.fixture(name="folder")
def _folder(tmp_path: Path) -> Path:
    save_mesh(grid(40), tmp_path / "scan.obj")
    save_mesh(load_sample("spot"), tmp_path / "spot.obj")
    return tmp_path


def test_there_are_examples() -> None:
    assert len(PYTHON) >= 5


@pytest.mark.parametrize("block", PYTHON)
def test_python_runs(block: str, folder: Path, server: Any) -> None:
    program = folder / "test_example.py"
    program.write_text(block.replace(SERVED, server.mesh_url))
    tests = (
        ("-m", "pytest", "-q", "-o", "asyncio_mode=auto", "-p", "no:cacheprovider")
        if "def test_" in block or "class Test" in block
        else ()
    )
    done = subprocess.run(
        [sys.executable, *tests, program.name], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_commands_of_the_readme_run_one_after_the_other(folder: Path, server: Any) -> None:
    block = re.search(r"(?ms)^## Use\n\n```\n(.*?)^```", (ROOT / "README.md").read_text())
    assert block
    lines = [shlex.split(line, comments=True) for line in block[1].replace(SERVED, server.mesh_url).splitlines()]
    ran = [line[1] for line in lines if line[1] != "serve"]  # which ends only when it is ended
    assert ran == ["encode", "info", "decode", "render", "fetch"]
    for program, *words in lines:
        assert program == "meshtide"
        if words[0] in ran:
            command = [sys.executable, "-m", "meshtide_client.main", *words]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
            assert done.returncode == 0, (words, done.stderr)
    assert {path.name for path in folder.iterdir()} >= {"scan.tide", "scan.decoded.ply", "levels.png", "scan.ply"}
