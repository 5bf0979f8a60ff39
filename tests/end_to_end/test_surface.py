"""What users and programs hold on to is as it was: help of every command, routes, settings, exit codes.

After a change that is meant: `python tools/surface.py`, and the difference goes with the commit.
"""

from __future__ import annotations

import difflib
import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[2] / "tools" / "surface.py"
KEPT = Path(__file__).parent / "surface"
KINDS = ["help", "openapi", "settings", "exit-codes"]


@pytest.fixture(scope="module", name="today")
def _today(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("surface")
    (folder / "help-gone.txt").write_text("of a command that is no more\n")
    ran = subprocess.run([sys.executable, TOOL, "--output", folder], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return folder


def test_every_file_is_kept(today: Path) -> None:
    assert sorted(path.name for path in today.iterdir()) == sorted(path.name for path in KEPT.iterdir())


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_has_changed(kind: str, today: Path) -> None:
    for path in sorted(KEPT.glob(f"{kind}*")):
        before, after = (folder.joinpath(path.name).read_text(encoding="utf-8") for folder in (KEPT, today))
        told = difflib.unified_diff(before.splitlines(), after.splitlines(), "before", "after", lineterm="")
        assert before == after, f"{path.name}\n" + "\n".join(told)
