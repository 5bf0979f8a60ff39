"""Where a mirror plane takes cells and vertices, at any depth of the octree; integers only.

A plane is given by the sum x + x' of a finest coordinate and its mirror image; it lies at (sum + 1) / 2 finest cells
from the cube's corner. O(n).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.cell_table_kernels import ABSENT, build_cell_table, find_cell
from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.cell_table_kernels import CellTable


@kernel
def find_mirrored_cells(
    cells: NDArray[np.int32],
    leaves: NDArray[np.bool_],
    table: CellTable,
    axis: int,
    coordinate_sum: int,
    depth: int,
    bits: int,
) -> NDArray[np.int32]:
    """For both halves along `axis` of every cell that is not a leaf, 2 * cell + half where the plane takes it, or -1.

    `cells` (n, 3) and `table` are of the grid of `depth`; `bits` is the depth that `coordinate_sum` counts in. A half
    lands in the half that its centre lands in.
    """
    mirrored = np.full((len(cells), 2), ABSENT, np.int32)
    shift = bits - depth - 1  # finest steps per half cell, as a power of two
    side_count = 1 << depth
    for vertex in range(len(cells)):
        if leaves[vertex]:
            continue
        x, y, z = int(cells[vertex, 0]), int(cells[vertex, 1]), int(cells[vertex, 2])
        along = x if axis == 0 else (y if axis == 1 else z)
        for side in range(2):
            doubled_centre = (2 * (2 * along + side) + 1) << shift  # in half finest steps
            half = (2 * (coordinate_sum + 1) - doubled_centre) >> (shift + 1)
            cell = half >> 1
            if cell < 0 or cell >= side_count:
                continue
            if axis == 0:
                found = find_cell(table, cell, y, z)
            elif axis == 1:
                found = find_cell(table, x, cell, z)
            else:
                found = find_cell(table, x, y, cell)
            if found != ABSENT:
                mirrored[vertex, side] = 2 * found + (half & 1)
    return mirrored


PARTNER_REACH = 3.6  # half cells along the axis within which a leaf may be the mirror image of another


@kernel
def find_partners(
    rows: NDArray[np.float64],
    owners: NDArray[np.int32],
    owner_cells: NDArray[np.int32],
    leaf_vertices: NDArray[np.int32],
    leaf_cells: NDArray[np.int32],
    axis: int,
    plane: float,
    depth: int,
    partners: NDArray[np.int32],
) -> None:
    """Give each owner without a partner the leaf nearest to its image, in a cell that is the same across the axis.

    `rows` hold positions in half cells of `depth`, in which `plane` is twice the plane's position. `owner_cells` and
    `leaf_cells` are of the grid of depth - 1; of several leaves in a cell the first one counts.
    """
    keys, entries = build_cell_table(leaf_cells, np.ones(len(leaf_cells), np.uint8))
    side_count = 1 << (depth - 1)
    for index in range(len(owners)):
        vertex = owners[index]
        if partners[vertex] >= 0:
            continue
        image = plane - rows[vertex, axis]
        middle = int(np.floor(image * 0.25))
        nearest = PARTNER_REACH
        for shift in range(-1, 2):
            along = middle + shift
            if along < 0 or along >= side_count:
                continue
            x, y, z = int(owner_cells[index, 0]), int(owner_cells[index, 1]), int(owner_cells[index, 2])
            if axis == 0:
                x = along
            elif axis == 1:
                y = along
            else:
                z = along
            found = find_cell((keys, entries), x, y, z)
            if found == ABSENT or leaf_vertices[found] == vertex:
                continue
            distance = abs(rows[leaf_vertices[found], axis] - image)
            if distance < nearest:
                nearest = distance
                partners[vertex] = leaf_vertices[found]
