"""Previews as packets: a simplified mesh on a coarser grid, coded by the compact profile itself in one payload.

The payload is a number that tells the preview's bits and the depth at which all vertices are alone in their cells;
then, range-coded in one go, the Base of all levels down to that depth and the bit plane of each depth. How many
vertices there are stands in the stream's header. Grid point p of a preview of b bits stands at p (2^B - 1) / (2^b - 1)
finest steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.diff_coder import known_positions
from meshtide_codec.compact.difference_coding import DifferenceCoder
from meshtide_codec.compact.octree import build_octree
from meshtide_codec.compact.reliable_coding import ReliableCoder
from meshtide_codec.compact.slices import Slices
from meshtide_codec.entropy.codec import PayloadReader, PayloadWriter
from meshtide_codec.errors import PacketError
from meshtide_codec.quantize import SMALLEST_B, grid_steps
from meshtide_codec.stream.parts import read_number, write_number
from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.level import Level
    from meshtide_codec.limits import Limits


@dataclass(frozen=True, slots=True)
class GridPreview:
    """A preview on its own grid.

    Args:
        bits: bits per coordinate of its grid, whose corners are those of the mesh's.
        cells: (k, 3) int32 in [0, 2^bits), distinct, in Morton order.
        faces: (j, 3) int32, canonical.
    """

    bits: int
    cells: NDArray[np.int32]
    faces: NDArray[np.int32]

    def drawn(self, bits: int) -> NDArray[np.float64]:
        """(k, 3) positions in finest steps of a mesh of `bits` bits."""
        return self.cells.astype(np.float64) * (grid_steps(bits) / grid_steps(self.bits))


def encode_preview(preview: GridPreview) -> bytes:
    """The payload of a Preview packet."""
    octree = build_octree(preview.cells, preview.faces, preview.bits)
    deepest = next(level.depth for level in octree.levels if level.all_leaves)
    writer = PayloadWriter()
    ReliableCoder(preview.bits, len(preview.cells), None).write_base(writer, octree, deepest)
    coder = DifferenceCoder(octree.levels[0], Slices(preview.bits), 0, None)
    for depth in range(1, preview.bits + 1):
        coder.write(writer, octree, depth)
    return write_number(preview.bits * (preview.bits + 1) // 2 + deepest) + writer.payload()


def decode_preview(payload: bytes, vertices: int, largest_bits: int, limits: Limits) -> GridPreview:
    """The preview that `encode_preview` wrote.

    Args:
        payload: its packet.
        vertices: how many it has, which is within the limits.
        largest_bits: B of the stream, which it must not exceed.
        limits: what it may claim.

    Raises:
        PacketError: the payload is damaged.
        LimitError: it claims more faces than `limits` allow.
    """
    try:
        shape, position = read_number(payload, 0)
    except BadValueError as error:
        raise PacketError(f"{error}; the stream is damaged", offset=0) from error
    bits = (math.isqrt(8 * shape + 1) - 1) // 2
    deepest = shape - bits * (bits + 1) // 2
    if not SMALLEST_B <= bits <= largest_bits:
        raise PacketError(f"a preview of {bits} bits in a stream of {largest_bits}; the stream is damaged", offset=0)
    reader = PayloadReader(payload[position:])
    levels = ReliableCoder(bits, vertices, None).read_base(reader, deepest, limits)
    _deepen(levels, bits)
    coder = DifferenceCoder(levels[0], Slices(bits), 0, None)
    for level in levels[1:]:
        coder.read(reader, level)
    if not reader.finished:
        raise PacketError("bytes follow the last bit plane; the stream is damaged", offset=position + reader.offset)
    return _preview(bits, levels, coder)


def _deepen(levels: list[Level], bits: int) -> None:
    """Add the levels down to `bits`, which have the same cells as the last one.

    Raises:
        PacketError: there are vertices that share a cell.
    """
    if not levels[-1].all_leaves:
        raise PacketError("its vertices are not alone in their cells; the stream is damaged", offset=0)
    while levels[-1].depth < bits:
        levels.append(levels[-1].deepened())


def _preview(bits: int, levels: list[Level], coder: DifferenceCoder) -> GridPreview:
    middles, _ = known_positions(levels[-1], [coder.state], Slices(bits))
    cells = ((middles - 1) // 2).astype(np.int32)
    faces = levels[-1].faces
    return GridPreview(bits, cells, np.zeros((0, 3), np.int32) if faces is None else faces)
