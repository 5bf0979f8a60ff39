"""Previews: a small mesh on a grid of its own, all of it in one packet (docs/format.md, section 8.8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.diff_decoding import SliceDecoder
from meshtide_codec.reference.numbers import read_number
from meshtide_codec.reference.octree import Level, deepened
from meshtide_codec.reference.range_decoder import RangeDecoder
from meshtide_codec.reference.reliable_decoding import ReliableDecoder

if TYPE_CHECKING:
    from meshtide_codec.reference.decoder import Drawn


def decode_preview(payload: bytes, vertices: int, bits: int) -> Drawn:
    """A preview of so many vertices, in finest steps of a mesh of `bits` bits."""
    shape, position = read_number(payload, 0)
    preview_bits = 0
    while shape > preview_bits:
        preview_bits += 1
        shape -= preview_bits
    with RangeDecoder(payload[position:]) as decoder:
        levels = ReliableDecoder(preview_bits, None).base_from(decoder, shape, vertices)
        state = SliceDecoder(levels[0], [0], 0, preview_bits, None)
        for level in _down_to(levels, preview_bits):
            state.decode(decoder, level)
    return _drawn(state, preview_bits, bits), levels[-1].faces


def _down_to(levels: list[Level], bits: int) -> list[Level]:
    """The levels of the depths from 1 to `bits`."""
    while levels[-1].depth < bits:
        levels.append(deepened(levels[-1]))
    return levels[1:]


def _drawn(state: SliceDecoder, preview_bits: int, bits: int) -> list[list[float]]:
    step = ((1 << bits) - 1) / ((1 << preview_bits) - 1)
    return [[coordinate * step for coordinate in cell] for cell in state.cells]
