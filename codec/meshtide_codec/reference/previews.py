"""Previews: a small mesh on a grid of its own, all of it in one packet (docs/format.md, section 8.8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.container import split_parts
from meshtide_codec.reference.diff_decoding import SliceDecoder
from meshtide_codec.reference.numbers import read_number
from meshtide_codec.reference.octree import deepened
from meshtide_codec.reference.reliable_decoding import ReliableDecoder

if TYPE_CHECKING:
    from meshtide_codec.reference.decoder import Drawn


def decode_preview(payload: bytes, preview_bits: int, bits: int) -> Drawn:
    """The preview of `preview_bits` bits, in finest steps of a mesh of `bits` bits."""
    vertices, position = read_number(payload, 0)
    deepest, position = read_number(payload, position)
    base, *planes = split_parts(payload[position:], preview_bits + 1)
    levels = ReliableDecoder(preview_bits, None).base(base, deepest, vertices)
    while levels[-1].depth < preview_bits:
        levels.append(deepened(levels[-1]))
    state = SliceDecoder(levels[0], [0], 0, preview_bits, None)
    for part, level in zip(planes, levels[1:], strict=True):
        state.decode(part, level)
    step = ((1 << bits) - 1) / ((1 << preview_bits) - 1)
    return [[coordinate * step for coordinate in cell] for cell in state.cells], levels[-1].faces
