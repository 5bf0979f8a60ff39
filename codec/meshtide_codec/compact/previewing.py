"""Previews as packets: a simplified mesh on a coarser grid, coded by the compact profile itself in one payload.

The payload is: number of vertices; the depth at which all of them are alone in their cells; then as many parts as the
preview has bits, and one: the Base of all levels down to that depth, and the bit plane of each depth. Grid point p of
a preview of b bits stands at p (2^B - 1) / (2^b - 1) finest steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.diff_coder import known_positions
from meshtide_codec.compact.difference_coding import DifferenceCoder
from meshtide_codec.compact.octree import build_octree
from meshtide_codec.compact.reliable_coding import ReliableCoder
from meshtide_codec.compact.slices import Slices
from meshtide_codec.errors import PacketError
from meshtide_codec.quantize import grid_steps
from meshtide_codec.stream.parts import join_parts, read_number, split_parts, write_number
from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
    base = ReliableCoder(preview.bits, len(preview.cells), None).encode_base(octree, deepest)
    coder = DifferenceCoder(octree.levels[0], Slices(preview.bits), 0, None)
    planes = [coder.encode(octree, depth) for depth in range(1, preview.bits + 1)]
    return write_number(len(preview.cells)) + write_number(deepest) + join_parts([base, *planes])


def decode_preview(payload: bytes, bits: int, limits: Limits) -> GridPreview:
    """The preview of `bits` bits that `encode_preview` wrote.

    Raises:
        PacketError: the payload is damaged.
        LimitError: it claims more vertices or faces than `limits` allow.
    """
    try:
        count, position = read_number(payload, 0)
        deepest, position = read_number(payload, position)
        base, *planes = split_parts(payload[position:], bits + 1)
    except BadValueError as error:
        raise PacketError(f"{error}; the stream is damaged", offset=0) from error
    if count < 1 or deepest > bits:
        raise PacketError(f"a preview of {count} vertices at depth {deepest}; the stream is damaged", offset=0)
    limits.check_mesh(count, 0)
    levels = ReliableCoder(bits, count, None).decode_base(base, deepest, limits)
    if not levels[-1].all_leaves:
        raise PacketError("its vertices are not alone in their cells; the stream is damaged", offset=0)
    while levels[-1].depth < bits:
        levels.append(levels[-1].deepened())
    slices = Slices(bits)
    coder = DifferenceCoder(levels[0], slices, 0, None)
    coder.decode(join_parts(planes), levels[1:])
    middles, _ = known_positions(levels[-1], [coder.state], slices)
    cells = ((middles - 1) // 2).astype(np.int32)
    faces = levels[-1].faces
    return GridPreview(bits, cells, np.zeros((0, 3), np.int32) if faces is None else faces)
