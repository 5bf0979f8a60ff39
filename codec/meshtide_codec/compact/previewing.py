"""Previews as packets: a simplified mesh on a coarser grid, coded by the compact profile itself in one payload.

The payload is: number of vertices; then as many parts as the preview has bits, and one: the Base of all its levels,
and the bit plane of each depth. Its vertices are drawn at the middles of their cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic.hierarchy import cell_centres
from meshtide_codec.compact.diff_coder import known_positions
from meshtide_codec.compact.difference_coding import DifferenceCoder
from meshtide_codec.compact.octree import build_octree
from meshtide_codec.compact.reliable_coding import ReliableCoder
from meshtide_codec.compact.slices import Slices
from meshtide_codec.errors import PacketError
from meshtide_codec.mesh import canonical_faces
from meshtide_codec.quantize import morton_codes
from meshtide_codec.stream.parts import join_parts, read_number, split_parts, write_number
from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.limits import Limits


@dataclass(frozen=True, slots=True)
class GridPreview:
    """A preview on its own grid.

    Args:
        bits: bits per coordinate of the grid, which spans the same cube as the mesh's.
        cells: (k, 3) int32 in [0, 2^bits), distinct, in Morton order.
        faces: (j, 3) int32, canonical.
    """

    bits: int
    cells: NDArray[np.int32]
    faces: NDArray[np.int32]

    def drawn(self, bits: int) -> NDArray[np.float64]:
        """(k, 3) positions in finest steps of a mesh of `bits` bits."""
        return cell_centres(self.cells, bits - self.bits)


def grid_preview(vertices: NDArray[np.float64], faces: NDArray[np.int32], preview_bits: int, bits: int) -> GridPreview:
    """A simplified mesh, its vertices (k, 3) in finest steps of `bits` bits, put on a grid of `preview_bits` bits."""
    cells = np.floor((vertices + 0.5) / float(1 << (bits - preview_bits)))
    cells = np.clip(cells, 0, (1 << preview_bits) - 1).astype(np.int64)
    _, first, inverse = np.unique(morton_codes(cells), return_index=True, return_inverse=True)
    welded = canonical_faces(inverse.reshape(-1)[faces].astype(np.int32))
    used = np.zeros(len(first), bool)
    used[welded] = True
    return GridPreview(
        preview_bits,
        cells[first[used]].astype(np.int32),
        (np.cumsum(used, dtype=np.int32) - 1)[welded].astype(np.int32),
    )


def encode_preview(preview: GridPreview) -> bytes:
    """The payload of a Preview packet."""
    octree = build_octree(preview.cells, preview.faces, preview.bits)
    base = ReliableCoder(preview.bits, len(preview.cells), None).encode_base(octree, preview.bits)
    coder = DifferenceCoder(octree.levels[0], Slices(preview.bits), 0, None)
    planes = [coder.encode(octree, depth) for depth in range(1, preview.bits + 1)]
    return write_number(len(preview.cells)) + join_parts([base, *planes])


def decode_preview(payload: bytes, bits: int, limits: Limits) -> GridPreview:
    """The preview of `bits` bits that `encode_preview` wrote.

    Raises:
        PacketError: the payload is damaged.
        LimitError: it claims more vertices or faces than `limits` allow.
    """
    try:
        count, position = read_number(payload, 0)
        base, *planes = split_parts(payload[position:], bits + 1)
    except BadValueError as error:
        raise PacketError(f"{error}; the stream is damaged", offset=0) from error
    if count < 1:
        raise PacketError("a preview without vertices; the stream is damaged", offset=0)
    limits.check_mesh(count, 0)
    levels = ReliableCoder(bits, count, None).decode_base(base, bits, limits)
    slices = Slices(bits)
    coder = DifferenceCoder(levels[0], slices, 0, None)
    coder.decode(join_parts(planes), levels[1:])
    middles, _ = known_positions(levels[-1], [coder.state], slices)
    cells = ((middles - 1) // 2).astype(np.int32)
    faces = levels[-1].faces
    return GridPreview(bits, cells, np.zeros((0, 3), np.int32) if faces is None else faces)
