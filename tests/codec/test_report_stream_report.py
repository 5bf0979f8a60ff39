from __future__ import annotations

import sys
from pathlib import Path

import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.errors import MeshtideError, OptionError
from meshtide_codec.profile import Profile
from meshtide_codec.report.stream_report import TERMINAL, StreamReport, header_states, report_files
from meshtide_codec.testing import grid


@pytest.fixture(scope="module")
def encoded() -> EncodedMesh:
    return encode(grid(16))


def test_states_are_those_of_the_header(encoded: EncodedMesh) -> None:
    states = header_states(encoded.header)
    assert [state.rms for state in states] == [row.rms for row in encoded.header.levels]
    assert states[-1].size == len(encoded.to_bytes())


def test_shares_add_up(encoded: EncodedMesh) -> None:
    plain = StreamReport("grid", encoded).plain()
    size = len(encoded.to_bytes())
    assert sum(plain["bytes_by_layer"].values()) == size
    assert sum(plain["share_by_layer"].values()) == pytest.approx(1.0)
    assert sum(plain["bits_per_vertex_by_layer"].values()) == pytest.approx(8 * size / 256)
    assert sum(row["bytes"] for row in plain["bytes_by_level_and_layer"]) == size


def test_a_page_holds_tables_and_picture(encoded: EncodedMesh) -> None:
    pytest.importorskip("matplotlib", reason="plots come with the extra bench")
    page = StreamReport("<grid>", encoded).file(Path("report.html")).decode()
    assert "&lt;grid&gt;" in page
    assert "<grid>" not in page
    assert page.count("<table>") == 2
    assert "data:image/png;base64,iVBOR" in page
    assert StreamReport("grid", encoded).file(Path("report.png")).startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (CompactOptions(bits=9), "profile compact, effort default, B = 9"),
        (CompactOptions(bits=9, effort=Effort.HIGH), "profile compact, effort high, B = 9"),
        (ClassicOptions(bits=9), "profile classic, B = 9"),
    ],
)
def test_a_report_tells_the_effort(options: Profile, told: str) -> None:
    encoded = encode(grid(8), options)
    report = StreamReport("grid", encoded)
    assert report._title == f"grid: {told}, 64 vertices"
    assert sum(report.plain()["bytes_by_layer"].values()) == len(encoded.to_bytes())


def test_where_a_report_goes(tmp_path: Path) -> None:
    assert report_files(TERMINAL, "spot") == []
    pytest.importorskip("matplotlib", reason="plots come with the extra bench")
    assert report_files(tmp_path / "a.PNG", "spot") == [tmp_path / "a.PNG"]
    assert report_files(tmp_path / "new", "spot") == [
        tmp_path / "new" / "spot-report.png", tmp_path / "new" / "spot-report.html"
    ]  # fmt: skip
    (tmp_path / "folder.d").mkdir()
    assert report_files(tmp_path / "folder.d", "spot")[0].parent == tmp_path / "folder.d"
    with pytest.raises(OptionError, match=r"a report is a folder, a .png or .html file, or - for the terminal"):
        report_files(tmp_path / "a.pdf", "spot")


def test_without_matplotlib_only_the_terminal_is_left(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert report_files(TERMINAL, "spot") == []
    with pytest.raises(MeshtideError, match="matplotlib, which is not installed: pip install"):
        report_files(tmp_path, "spot")
