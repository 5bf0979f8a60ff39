from __future__ import annotations

from dataclasses import replace

import pytest

from meshtide_codec.compact.display_filter import STRENGTHS, UNFILTERED
from meshtide_codec.compact.effort import DeepLayers, Effort
from meshtide_codec.compact.mirror import Mirror
from meshtide_codec.compact.options import CompactHeader, CompactOptions
from meshtide_codec.compact.slices import Slices
from meshtide_codec.errors import ContainerError, OptionError
from meshtide_codec.stream.header import LevelEntry, PacketEntry, StreamHeader
from meshtide_codec.stream.packets import PacketKind

BITS = 12
CHOSEN = STRENGTHS[3:12]
UNFILTERED_LEVELS = (UNFILTERED,) * 9
PLAIN = CompactHeader(4, CHOSEN, (6, 9, 12), None, Slices(12), 0)
FULL = CompactHeader(4, CHOSEN, (4, 12), Mirror(1, 77, 12), Slices(12, (0, 5, 900)), 2)


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
    header = StreamHeader(
        profile="compact",
        options=compact.to_options(),
        bits=BITS,
        origin=(0.0, 0.0, 0.0),
        extent=1.0,
        levels=(LevelEntry(0, len(places), 100, 200, 0.0, 0.0),),
        packets=tuple(PacketEntry(*place, 5, 0) for place in places),
    )
    return replace(header, **changes)  # type: ignore[arg-type]


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


@pytest.mark.parametrize(
    "header", [PLAIN, FULL, replace(FULL, strengths=UNFILTERED_LEVELS), replace(PLAIN, diff_depths=())]
)
def test_header_round_trip(header: CompactHeader) -> None:
    assert CompactHeader.from_header(stream_header(header)) == header


@pytest.mark.parametrize("deep", [*DeepLayers, DeepLayers.ALL, DeepLayers.NONE])
def test_each_layer_can_be_deep(deep: DeepLayers) -> None:
    header = replace(FULL, deep=deep)
    assert CompactHeader.from_header(stream_header(header)).deep == deep


def test_efforts_are_understood_by_name() -> None:
    assert CompactOptions(effort="high").effort is Effort.HIGH  # type: ignore[arg-type]
    assert CompactOptions().effort is Effort.DEFAULT
    assert CompactOptions().effort.deep_layers is DeepLayers.NONE
    assert Effort.HIGH.deep_layers == DeepLayers.ALL


def test_a_plain_header_says_nothing_needless() -> None:
    assert set(PLAIN.to_options()) == {"f"}
    assert replace(PLAIN, strengths=UNFILTERED_LEVELS).to_options() == {}
    few = (STRENGTHS[2], STRENGTHS[1], STRENGTHS[15], *UNFILTERED_LEVELS[3:])
    assert replace(PLAIN, strengths=few).to_options() == {"f": b"\x21\xf0"}


@pytest.mark.parametrize(
    "change",
    [
        {"f": bytes(6)},
        {"f": "text"},
        {"m": [3, 0]},
        {"m": [0]},
        {"m": [0, 1 << 13]},
        {"s": []},
        {"s": [1]},
        {"s": [0, 5, 5]},
        {"s": [0, 1 << 36]},
        {"s": list(range(5000))},
        {"b": 4},
        {"e": -1},
        {"e": DeepLayers.ALL + 1},
        {"e": b"1"},
        {"e": 1, "s": list(range(513))},
        {"x": 0},
    ],
    ids=str,
)
def test_damaged_options_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(ContainerError, match="damaged stream header"):
        CompactHeader.from_header(stream_header(FULL, options=FULL.to_options() | change))


def test_packets_that_do_not_make_a_compact_stream_are_refused() -> None:
    packets = stream_header(FULL).packets
    base = next(row for row in packets if row.kind is PacketKind.BASE)
    others = tuple(row for row in packets if row.kind is not PacketKind.BASE)
    preview = packets[0]
    for wrong, message in (
        (others, "0 Base packets"),
        ((*packets, base), "2 Base packets"),
        ((replace(base, level=13), *others), "base depth"),
        ((*packets, PacketEntry(PacketKind.DIFF, 9, 0, 5, 0)), "a Diff of depth 3"),
        ((*packets, PacketEntry(PacketKind.DIFF, 13, 0, 5, 0)), "a Diff of depth -1"),
        (packets + (preview,) * 7, "9 previews"),
    ):
        with pytest.raises(ContainerError, match=message):
            CompactHeader.from_header(stream_header(FULL, packets=wrong))
