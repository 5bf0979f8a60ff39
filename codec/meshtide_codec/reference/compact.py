"""Profile compact: levels, Diffs and previews from their packets (docs/format.md, section 8)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec.reference.container import BASE, DIFF, MAP_CONN, PREVIEW, Key
from meshtide_codec.reference.diff_decoding import SliceDecoder
from meshtide_codec.reference.display_filter import STRENGTHS, Strength, drawn, known_cells
from meshtide_codec.reference.mirror import Mirror
from meshtide_codec.reference.octree import Level, deepened
from meshtide_codec.reference.previews import decode_preview
from meshtide_codec.reference.range_decoder import RangeDecoder
from meshtide_codec.reference.reliable_decoding import ReliableDecoder

if TYPE_CHECKING:
    from meshtide_codec.reference.container import Stream
    from meshtide_codec.reference.decoder import Drawn

DEEP_DIFFS, DEEP_MAPS, DEEP_FACES = 1, 2, 4


def decode_compact(stream: Stream, number: int) -> Drawn:
    """Level or preview `number`, as the packets that it needs show it."""
    packets = stream.packets_for(number)
    shape = shape_of(stream)
    coarsest = stream.bits - shape.base_depth
    if number > coarsest:
        return decode_preview(packets[PREVIEW, number, 0], stream.vertices_of(number), stream.bits)
    mirror = None
    if "m" in stream.options:
        axis, coordinate_sum = stream.options["m"]
        mirror = Mirror(axis, coordinate_sum, stream.bits)
    levels = _decode_levels(stream, packets, shape.base_depth, mirror)
    slices = stream.options.get("s", [0])
    deep = bool(stream.options.get("e", 0) & DEEP_DIFFS)
    states = [SliceDecoder(levels[0], slices, index, stream.bits, mirror, deep=deep) for index in range(len(slices))]
    for depth in shape.diff_depths:
        for index, state in enumerate(states):
            payload = packets.get((DIFF, stream.bits - depth, index))
            if payload is not None:
                with RangeDecoder(payload) as decoder:
                    for level in levels[state.depth + 1 : depth + 1]:
                        state.decode(decoder, level)
    level = levels[stream.bits - number]
    strength = shape.strengths[level.depth - shape.base_depth]
    return drawn(level, known_cells(level, states, stream.bits), strength), level.faces


@dataclass(frozen=True)
class Shape:
    """What is sent at which depth (section 8.1).

    Attributes:
        base_depth: of the coarsest level.
        strengths: of the display filter, from the base depth on.
        diff_depths: the depths at which Diff packets end.
    """

    base_depth: int
    strengths: list[Strength]
    diff_depths: list[int]


def shape_of(stream: Stream) -> Shape:
    """What the packets tell of it, and the options."""
    base_depth = next(stream.bits - level for kind, level, _ in stream.payloads if kind == BASE)
    diff_depths = sorted({stream.bits - level for kind, level, _ in stream.payloads if kind == DIFF})
    strengths = [STRENGTHS[half] for byte in stream.options.get("f", b"") for half in (byte // 16, byte % 16)]
    return Shape(base_depth, strengths + [STRENGTHS[0]] * (stream.bits + 1), diff_depths)


def _decode_levels(stream: Stream, packets: dict[Key, bytes], base_depth: int, mirror: Mirror | None) -> list[Level]:
    """The levels of all depths from 0 on, as far as the packets go."""
    deep = stream.options.get("e", 0)
    reliable = ReliableDecoder(
        stream.bits, mirror, deep_maps=bool(deep & DEEP_MAPS), deep_faces=bool(deep & DEEP_FACES)
    )
    levels = reliable.base(packets[BASE, stream.bits - base_depth, 0], base_depth, stream.states[-1].vertices)
    for depth in range(base_depth + 1, stream.bits + 1):
        number = stream.bits - depth
        if all(levels[-1].leaves):
            levels.append(deepened(levels[-1]))
        elif (MAP_CONN, number, 0) in packets:
            levels.append(reliable.map_conn(packets[MAP_CONN, number, 0], levels[-1], stream.faces_of(number)))
        else:
            break
    return levels
