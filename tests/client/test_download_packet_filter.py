"""Packets that go through a filter before they are decoded, and where there is none."""

from __future__ import annotations

import math
from importlib.metadata import EntryPoint, EntryPoints
from typing import TYPE_CHECKING, Any

import pytest

from meshtide_client import other_packages
from meshtide_client.connection.tide_address import parse_address
from meshtide_client.download.download import Download
from meshtide_client.download.holding import Holding
from meshtide_client.download.packet_filter import GROUP, NAME, DirectReceiver, find_filter
from meshtide_codec.errors import OptionError, TransferError
from meshtide_codec.packets import PacketKind
from streams import encoded_grid

if TYPE_CHECKING:
    from pathlib import Path

    from meshtide_codec.limits import Limits
    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import StreamHeader

ENCODED = encoded_grid()
HEADER = ENCODED.header


class Report:
    """Counts what is lost."""

    lost = 0

    def plain(self) -> dict[str, Any]:
        return {"lost": self.lost}

    def summary(self) -> str:
        return f"{self.lost} lost"


class Leaking(DirectReceiver):
    """Loses packets of some kinds."""

    def __init__(self, header: StreamHeader, limits: Limits | None, kinds: set[PacketKind]) -> None:
        super().__init__(header, limits)
        self.report = Report()
        self._kinds = kinds
        self._sent = 0

    def take(self, packet: Packet) -> None:
        self._sent += 1
        if packet.kind in self._kinds:
            self.report.lost += 1
        else:
            super().take(packet)

    def is_settled(self, count: int) -> bool:
        return count <= self._sent


class Leak:
    """A filter that loses packets of some kinds."""

    def __init__(self, *kinds: PacketKind) -> None:
        self.kinds = set(kinds)
        self.counts: list[int] = []

    def receiver(self, header: StreamHeader, limits: Limits | None, count: int) -> Leaking:
        self.counts.append(count)
        return Leaking(header, limits, self.kinds)


@pytest.fixture(name="file")
def _file(tmp_path: Path) -> str:
    path = tmp_path / "vase.tide"
    path.write_bytes(ENCODED.to_bytes())
    return str(path)


async def test_levels_that_lost_something_are_shown_and_nothing_is_said_of_their_distance(file: str) -> None:
    leak = Leak(PacketKind.DIFF)
    download = Download(parse_address(file), Holding(), loss=leak)
    levels = [level async for level in download.levels()]
    assert leak.counts == [len(HEADER.packets)]
    assert [level.level for level in levels][-1] == 0
    inexact = [level for level in levels if not level.exact]
    assert inexact
    assert all(math.isnan(level.rms) and math.isnan(level.maximum) for level in inexact)
    assert all(level.rms == HEADER.entry(level.level).rms for level in levels if level.exact)
    assert download.link_report is not None
    assert download.link_report.lost == sum(entry.kind is PacketKind.DIFF for entry in HEADER.packets) > 0


async def test_a_filter_that_lets_everything_pass_changes_nothing(file: str) -> None:
    plain = Download(parse_address(file), Holding())
    filtered = Download(parse_address(file), Holding(), loss=Leak())
    expected = [level.level async for level in plain.levels()]
    assert [level.level async for level in filtered.levels()] == expected
    assert (plain.link_report, filtered.link_report is None) == (None, False)


async def test_a_filter_that_leaves_no_level_is_told(file: str) -> None:
    everything = Leak(*PacketKind)
    download = Download(parse_address(file), Holding(), loss=everything)
    with pytest.raises(TransferError, match=f"no level that can be shown: {len(HEADER.packets)} lost"):
        _ = [level async for level in download.levels()]


def test_without_the_laboratory_the_error_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(other_packages, "entry_points", EntryPoints().select)
    with pytest.raises(
        OptionError, match="needs the laboratory, the package meshtide_lab, which is not installed here"
    ):
        find_filter()
    points = EntryPoints([EntryPoint(NAME, "meshtide_no_lab.link:make", GROUP)])
    monkeypatch.setattr(other_packages, "entry_points", points.select)
    with pytest.raises(OptionError, match="not installed here; No module named 'meshtide_no_lab'"):
        find_filter()
