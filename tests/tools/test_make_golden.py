"""The command that writes the golden streams: it makes those that the tests hold everything against."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from golden_streams import GOLDEN, VARIANTS

if TYPE_CHECKING:
    import pytest

TOOL = Path(__file__).parents[2] / "tools" / "make_golden.py"


def test_it_writes_the_golden_streams_again_byte_for_byte(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "of-no-variant.tide").write_bytes(b"old")
    (tmp_path / "compact-bowl.tide").write_bytes((GOLDEN / "compact-bowl.tide").read_bytes())
    (tmp_path / "compact-dome.tide").write_bytes(b"old")
    monkeypatch.setattr(sys, "argv", [str(TOOL), "--output", str(tmp_path)])
    runpy.run_path(str(TOOL), run_name="__main__")
    assert {path.stem for path in tmp_path.iterdir()} == set(VARIANTS)
    same = [name for name, variant in VARIANTS.items() if variant.machines_agree]
    assert len(same) == len(VARIANTS) - 1
    for name in same:
        assert (tmp_path / f"{name}.tide").read_bytes() == (GOLDEN / f"{name}.tide").read_bytes(), name
    told = capsys.readouterr().out
    assert f"{tmp_path / 'of-no-variant.tide'}: removed" in told
    assert f"{tmp_path / 'compact-bowl.tide'}: as before, " in told
    assert f"{tmp_path / 'compact-dome.tide'}: changed, " in told
    assert told.count(": new, ") == len(VARIANTS) - 2
