"""The files of changes/ and the changelog that is made of them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_every_change_is_of_a_known_kind_and_reaches_the_changelog() -> None:
    changes = [path for path in (ROOT / "changes").iterdir() if path.name != "README.md"]
    assert changes
    for path in changes:
        assert re.fullmatch(r"\+[a-z0-9-]+\.(added|changed|fixed|removed)\.md", path.name), path.name
    command = [sys.executable, "-m", "towncrier", "build", "--draft", "--version", "1.2.3"]
    drawn = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for path in changes:
        assert " ".join(path.read_text().split()) in " ".join(drawn.split()), path.name
