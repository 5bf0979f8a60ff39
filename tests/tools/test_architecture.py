"""docs/architecture.md and the picture in it: rooms, files and names are those that there are."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
CORE = ROOT / "codec" / "core"
DOCUMENT = (ROOT / "docs" / "architecture.md").read_text()
MOST_FILES_OF_A_DECODE = 15
LONGEST_FILE = 1000
"""Lines."""


def arrows() -> dict[str, set[str]]:
    """For each folder of the core's sources the others that its files include."""
    found: dict[str, set[str]] = {}
    for path in sorted((CORE / "src").glob("*/*")):
        room = path.parent.name
        included = re.findall(r'^#include "(\w+)/', path.read_text(), re.MULTILINE)
        found.setdefault(room, set()).update(set(included) - {room})
    return found


def test_rooms_include_what_the_table_says_and_no_other() -> None:
    rows = re.findall(r"^\| `(\w+)` \| [^|]+ \| ([\w, ]*)\|$", DOCUMENT, re.MULTILINE)
    table = {room: set(re.findall(r"\w+", allowed)) for room, allowed in rows}
    found = arrows()
    assert set(table) == set(found)
    for room, included in found.items():
        assert included <= table[room], room


def test_a_decode_runs_through_few_files_which_are_short() -> None:
    section = DOCUMENT.partition("### One decode, file by file")[2].partition("\n### ")[0]
    files = [ROOT / name for name in re.findall(r"^\d+\. `([\w/.]+)`", section, re.MULTILINE)]
    assert 0 < len(files) <= MOST_FILES_OF_A_DECODE
    assert all(len(path.read_text().splitlines()) <= LONGEST_FILE for path in files)


def test_a_fetch_runs_through_what_it_names() -> None:
    section = DOCUMENT.partition("## One fetch, file by file")[2].partition("\n## ")[0]
    steps = re.findall(r"^\d+\. `([\w/.]+)`, `(\w+)`", section, re.MULTILINE)
    assert len(steps) == len(re.findall(r"^\d+\. ", section, re.MULTILINE)) > 10
    for file, name in steps:
        assert re.search(rf"^(?:class|def|async def) {name}\b", (ROOT / file).read_text(), re.MULTILINE), (file, name)


def test_the_picture_is_of_this_house_and_nothing_goes_in_circles() -> None:
    program = [sys.executable, ROOT / "tools" / "draw_house.py", "--check"]
    done = subprocess.run(program, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "circles: 0" in done.stdout


def test_files_that_it_names_are_there() -> None:
    names = set(re.findall(r"`((?:codec|server|client|tests|tools|docs)/[\w/.]+)`", DOCUMENT)) | set(
        re.findall(r"python ((?:tools|tests)/[\w/.]+)", DOCUMENT)
    )
    assert len(names) > MOST_FILES_OF_A_DECODE
    for name in names:
        found = [folder / name for folder in (ROOT, CORE / "src", CORE) if (folder / name).exists()]
        assert found, name


def test_make_knows_its_commands() -> None:
    makefile = (ROOT / "Makefile").read_text()
    targets = set(re.findall(r"(?<!c)make ([a-z][\w-]+)", DOCUMENT))
    assert targets >= {"core-test", "core-sanitize", "core-aarch64", "wasm"}
    assert all(re.search(rf"^{target}:", makefile, re.MULTILINE) for target in targets)
