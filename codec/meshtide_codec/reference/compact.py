"""Profile compact: levels, Diffs and previews from their packets (docs/format.md, section 8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.container import BASE, DIFF, MAP_CONN, PREVIEW, Key, split_parts
from meshtide_codec.reference.diff_decoding import SliceDecoder
from meshtide_codec.reference.display_filter import drawn, known_cells
from meshtide_codec.reference.mirror import Mirror
from meshtide_codec.reference.octree import Level, deepened
from meshtide_codec.reference.previews import decode_preview
from meshtide_codec.reference.reliable_decoding import ReliableDecoder

if TYPE_CHECKING:
    from meshtide_codec.reference.container import Stream
    from meshtide_codec.reference.decoder import Drawn


def decode_compact(stream: Stream, number: int) -> Drawn:
    """Level or preview `number`, as the packets that it needs show it."""
    packets = stream.packets_for(number)
    coarsest = stream.bits - stream.options["b"]
    if number > coarsest:
        previews = stream.options.get("p", b"")
        bits = previews[coarsest + len(previews) - number]
        return decode_preview(packets[PREVIEW, number, 0], bits, stream.bits)
    mirror = None
    if "m" in stream.options:
        axis, coordinate_sum = stream.options["m"]
        mirror = Mirror(axis, coordinate_sum, stream.bits)
    levels = _decode_levels(stream, packets, mirror)
    slices = stream.options.get("s", [0])
    states = [SliceDecoder(levels[0], slices, index, stream.bits, mirror) for index in range(len(slices))]
    for depth in stream.options["d"]:
        for index, state in enumerate(states):
            payload = packets.get((DIFF, stream.bits - depth, index))
            if payload is not None:
                _decode_diff(payload, state, levels[state.depth + 1 : depth + 1])
    level = levels[stream.bits - number]
    strength = stream.options["f"][level.depth - stream.options["b"]]
    return drawn(level, known_cells(level, states, stream.bits), strength), level.faces


def _decode_levels(stream: Stream, packets: dict[Key, bytes], mirror: Mirror | None) -> list[Level]:
    """The levels of all depths from 0 on, as far as the packets go."""
    reliable = ReliableDecoder(stream.bits, mirror)
    base_depth = stream.options["b"]
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


def _decode_diff(payload: bytes, state: SliceDecoder, levels: list[Level]) -> None:
    """A packet with the bit planes of the depths of `levels`."""
    for part, level in zip(split_parts(payload, len(levels)), levels, strict=True):
        state.decode(part, level)
