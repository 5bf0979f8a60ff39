"""docs/glossary.md: each word once, in order, and each place where it is explained."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROWS = re.findall(
    r"^\| (\S[^|]*?) \| ([^|]+) \| ([^|]+) \|$", (ROOT / "docs" / "glossary.md").read_text(), re.MULTILINE
)[1:]
FILES = [path for folder in ("codec", "server", "client", "docs") for path in (ROOT / folder).rglob("*")]


def test_words_stand_once_and_in_order() -> None:
    words = [word.lower() for word, _, _ in ROWS]
    assert len(words) > 25
    assert words == sorted(set(words))


def test_places_exist() -> None:
    for word, _, place in ROWS:
        name = re.fullmatch(r"`(?:(\w+)/…/)?([\w/.]+)`|\[format\]\(format\.md\)", place)
        assert name, word
        if name[2]:
            ending = Path("/", name[2]).as_posix()
            found = [path for path in FILES if path.as_posix().endswith(ending)]
            assert [path for path in found if name[1] is None or f"/{name[1]}/" in path.as_posix()], (word, place)


def test_words_are_in_use() -> None:
    readable = {".py", ".hpp", ".cpp", ".md"}
    text = "\n".join(
        path.read_text().lower() for path in FILES if path.suffix in readable and path.name != "glossary.md"
    )
    for word, _, _ in ROWS:
        plain = re.sub(r" [a-z]$", "", word).lower()
        assert re.search(rf"(?<!\w){re.escape(plain)}", text), word
