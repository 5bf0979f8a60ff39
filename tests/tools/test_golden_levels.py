"""The digests that the tests of client/web compare with are those of today's decoder."""

from __future__ import annotations

import runpy
from pathlib import Path

TOOL = runpy.run_path(str(Path(__file__).parents[2] / "tools" / "golden_levels.py"))


def test_the_stored_digests_are_those_of_the_decoder() -> None:
    assert TOOL["OUTPUT"].read_text(encoding="ascii") == TOOL["text"]()
