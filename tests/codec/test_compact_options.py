from __future__ import annotations

from dataclasses import replace

import pytest

from meshtide_codec.compact.mirror import Mirror
from meshtide_codec.compact.options import CompactHeader, CompactOptions
from meshtide_codec.effort import Effort
from meshtide_codec.errors import ContainerError, OptionError
from meshtide_codec.packets import PacketKind
from meshtide_codec.stream.header import LevelEntry, PacketEntry, StreamHeader

BITS = 12
CHOSEN = (3, 4, 5, 6, 7, 8, 9, 10, 15)
PLAIN = CompactHeader(4, CHOSEN, (6, 9, 12), None, (0,), 0, Effort.DEFAULT)
FULL = CompactHeader(4, CHOSEN, (4, 12), Mirror(1, 77, 12), (0, 5, 900), 2, Effort.HIGH)


def stream_header(compact: CompactHeader, **changes: object) -> StreamHeader:
    """A header of a stream whose packets are those that `compact` tells of."""
    coarsest = BITS - compact.base_depth
    places = [(PacketKind.PREVIEW, coarsest + compact.previews - place, 0) for place in range(compact.previews)]
    places.append((PacketKind.BASE, coarsest, 0))
    for depth in range(compact.base_depth, BITS + 1):
        if depth > compact.base_depth:
            places.append((PacketKind.MAP_CONN, BITS - depth, 0))
        if depth in compact.diff_depths:
            places += [(PacketKind.DIFF, BITS - depth, part) for part in range(len(compact.slices))]
    levels = [place[1] for place in places]
    ends = {level: len(levels) - levels[::-1].index(level) for level in levels}
    header = StreamHeader(
        options=compact,
        bits=BITS,
        origin=(0.0, 0.0, 0.0),
        extent=1.0,
        levels=tuple(LevelEntry(level, end, 100, 200, 0.0, 0.0) for level, end in ends.items()),
        packets=tuple(PacketEntry(*place, 5, 0) for place in places),
    )
    return replace(header, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("vertices", "slices"), [(1, 1), (399_999, 1), (400_000, 2), (1_000_000, 3), (10_000_000, 10), (1 << 28, 51)]
)
def test_large_meshes_get_more_slices_unless_their_number_is_given(vertices: int, slices: int) -> None:
    assert CompactOptions().slice_count(vertices) == slices
    assert CompactOptions(effort=Effort.HIGH).slice_count(vertices) == slices
    assert CompactOptions(slices=7).slice_count(vertices) == 7


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"bits": 3}, "B must be"),
        ({"bits": 21}, "B must be"),
        ({"slices": 0}, "slices"),
        ({"slices": 5000}, "slices"),
        ({"previews": (64, 512)}, "coarsest preview comes first"),
        ({"previews": (64, 64)}, "coarsest preview comes first"),
        ({"previews": (1,)}, "ratios from 2 on"),
        ({"previews": tuple(range(20, 2, -1))}, "at most 8 previews"),
        ({"effort": "low"}, "effort is default or high, not 'low'"),
        ({"effort": "high", "slices": 513}, "effort high takes at most 512 slices"),
    ],
)
def test_options_out_of_range(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(OptionError, match=message):
        CompactOptions(**wrong)  # type: ignore[arg-type]


def read_again(header: StreamHeader) -> StreamHeader:
    return StreamHeader.from_bytes(header.to_bytes())


@pytest.mark.parametrize("header", [PLAIN, FULL, replace(FULL, strengths=(0,) * 9), replace(PLAIN, diff_depths=())])
def test_header_round_trip(header: CompactHeader) -> None:
    assert read_again(stream_header(header)).options == header


def test_efforts_are_understood_by_name() -> None:
    assert CompactOptions(effort="high").effort is Effort.HIGH  # type: ignore[arg-type]
    assert CompactOptions().effort is Effort.DEFAULT


def test_a_plain_header_says_nothing_needless() -> None:
    bare = replace(PLAIN, strengths=(0,) * 9)
    length = len(stream_header(bare).to_bytes())
    assert len(stream_header(PLAIN).to_bytes()) == length + 5  # two strengths in a byte, of nine depths
    assert len(stream_header(replace(bare, strengths=(2, 1, 15, *(0,) * 6))).to_bytes()) == length + 2
    mirrored = replace(bare, mirror=Mirror(1, 77, 12))
    assert len(stream_header(mirrored).to_bytes()) == length + 2


@pytest.mark.parametrize(
    "change",
    [
        {"strengths": (16, *CHOSEN[1:])},
        {"slices": (0, 5, 5)},
        {"slices": (0, 1 << 36)},
        {"slices": tuple(range(5000))},
        {"slices": tuple(range(102))},  # of 100 vertices
        {"base_depth": 13},
    ],
    ids=str,
)
def test_options_that_no_header_tells_are_refused(change: dict[str, object]) -> None:
    header = replace(stream_header(FULL), options=replace(FULL, **change))  # type: ignore[arg-type]
    with pytest.raises((ContainerError, OptionError)):
        read_again(header)


def test_damaged_options_are_refused() -> None:
    data = bytearray(stream_header(FULL).to_bytes())
    tail = len(data) - 5  # the strengths
    flags = data.index(bytes([7, 1, 77]), tail - 12)
    for place, byte, message in (
        (flags, 15, "options of a compact stream that there are not"),
        (flags + 1, 3, "a mirror plane outside of the grid"),
        (flags + 3, 0, "more slices than there can be"),
        (flags + 4, 0, "slices that do not ascend in the cube"),
    ):
        damaged = data.copy()
        damaged[place] = byte
        with pytest.raises(ContainerError, match=message):
            StreamHeader.from_bytes(damaged)


def test_packets_that_do_not_make_a_compact_stream_are_refused() -> None:
    packets = stream_header(FULL).packets
    base = next(row for row in packets if row.kind is PacketKind.BASE)
    others = tuple(row for row in packets if row.kind is not PacketKind.BASE)
    preview = packets[0]
    for wrong, message in (
        (others, "not one Base packet"),
        ((*packets, base), "not one Base packet"),
        ((replace(base, level=13), *others), "a Base packet of a level above B"),
        ((*packets, PacketEntry(PacketKind.DIFF, 9, 0, 5, 0)), "a Diff before the base depth"),
        ((*packets, PacketEntry(PacketKind.DIFF, 13, 0, 5, 0)), "a Diff packet of a level above B"),
        (packets + (preview,) * 7, "more than 8 previews"),
    ):
        with pytest.raises(ContainerError, match=message):
            header = stream_header(FULL, packets=wrong)
            last = replace(header.levels[-1], packet_count=len(wrong))
            read_again(replace(header, levels=(*header.levels[:-1], last)))
