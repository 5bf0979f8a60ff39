"""The surface of a cell, for the Map coder at effort high: where the neighbours say it passes.

Neighbours whose children are known stand at their mean, the others at their centres. A quadratic surface through two
rings (`surface_fit_kernels`) tells how far from it each octant lies, and how well it did so far at the neighbours how
far it can be trusted. O(two rings) per cell.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact import diff_prediction_kernels as prediction
from meshtide_codec.compact import surface_fit_kernels as fit
from meshtide_codec.compact.map_deep_layout import NO_NEIGHBOUR_FITTED, NO_SURFACE
from meshtide_codec.compilation import borrowing_kernel, inlined_kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.diff_prediction_kernels import Rows
    from meshtide_codec.compact.ring_kernels import Rings

    CellSurfaces = tuple[
        Rows, NDArray[np.float64], NDArray[np.int32], Rows, Rows, NDArray[np.float64], NDArray[np.float64]
    ]
    """Rows, misses, stamps; scratch of the fit: patch, matrix, solution; and the surface of the cell at hand."""

# Fields of the surface of a cell, float64.
NORMAL = 0  # three components of the unit normal, or zeros
HEIGHT = 3  # over the cell's centre, along the normal, in half cells
FIT_CLASS = 4
RING_NORMAL = 5  # three components, of the ring alone
SURFACE_SIZE = 8

_NO_MISS = -1.0  # of a cell whose children are not known, or that had no surface
_FIRST_ERROR_CLASS = 5


def new_cell_surfaces(centres: NDArray[np.int32]) -> CellSurfaces:
    """For cells at `centres` (n, 3), in half cells, before any of them is coded."""
    rows = np.zeros((len(centres), prediction.KNOWN + 1))
    rows[:, :3] = centres
    return (
        rows,
        np.full(len(centres), _NO_MISS),
        np.full(len(centres), -1, np.int32),
        np.zeros((fit.PATCH_LIMIT, 4)),
        np.zeros((fit.TERMS, fit.TERMS)),
        np.zeros(fit.TERMS),
        np.zeros(SURFACE_SIZE),
    )


@borrowing_kernel
def fit_cell(vertex: int, count: int, closed: bool, rings: Rings, cells: CellSurfaces) -> None:
    """Set the surface of a cell from the first `count` members of its ring and theirs."""
    starts, members, _ = rings
    rows, misses, stamps, patch, matrix, solution, surface = cells
    surface[:] = 0.0
    surface[FIT_CLASS] = NO_SURFACE
    if count < 3:
        return
    first = starts[vertex]
    scale = error = known = 0.0
    normal_x = normal_y = normal_z = 0.0
    before = members[first + count - 1] if closed else members[first]
    before_x = rows[before, 0] - rows[vertex, 0]
    before_y = rows[before, 1] - rows[vertex, 1]
    before_z = rows[before, 2] - rows[vertex, 2]
    for place in range(count):
        other = members[first + place]
        x = rows[other, 0] - rows[vertex, 0]
        y = rows[other, 1] - rows[vertex, 1]
        z = rows[other, 2] - rows[vertex, 2]
        scale += np.sqrt(x * x + y * y + z * z)
        if misses[other] >= 0.0:
            error += misses[other]
            known += 1.0
        if place > 0 or closed:
            normal_x += before_y * z - before_z * y
            normal_y += before_z * x - before_x * z
            normal_z += before_x * y - before_y * x
        before_x, before_y, before_z = x, y, z
    square = normal_x * normal_x + normal_y * normal_y + normal_z * normal_z
    if not square > 0.0:
        return
    share = 1.0 / np.sqrt(square)
    surface[RING_NORMAL] = normal_x * share
    surface[RING_NORMAL + 1] = normal_y * share
    surface[RING_NORMAL + 2] = normal_z * share
    size = fit.gather_patch(vertex, count, rows, starts, members, stamps, patch)
    ring_normal = surface[RING_NORMAL:]
    surface[HEIGHT] = fit.fit_surface(size, scale / count, ring_normal, patch, matrix, solution, surface)
    surface[FIT_CLASS] = NO_NEIGHBOUR_FITTED
    if known > 0.0:
        error_class = prediction.error_class(error / known) - _FIRST_ERROR_CLASS
        surface[FIT_CLASS] = min(max(error_class, 0), NO_NEIGHBOUR_FITTED - 1)


@inlined_kernel
def octant_over_surface(octant: int, surface: NDArray[np.float64]) -> float:
    """How far the octant's centre lies over the surface, in half cells."""
    x = 0.5 if octant & 4 else -0.5
    y = 0.5 if octant & 2 else -0.5
    z = 0.5 if octant & 1 else -0.5
    over: float = x * surface[0] + y * surface[1] + z * surface[2] - surface[HEIGHT]
    return over


@borrowing_kernel
def note_children(vertex: int, pattern: int, cells: CellSurfaces) -> None:
    """Move a cell to the mean of its children's centres, and note how far from the surface they lie."""
    rows, misses, _, _, _, _, surface = cells
    count = x = y = z = 0
    missed = 0.0
    for octant in range(8):
        if (pattern >> octant) & 1:
            count += 1
            x += 1 if octant & 4 else -1
            y += 1 if octant & 2 else -1
            z += 1 if octant & 1 else -1
            missed += abs(octant_over_surface(octant, surface))
    if surface[FIT_CLASS] < NO_SURFACE:
        misses[vertex] = missed / count
    rows[vertex, 0] += 0.5 * x / count
    rows[vertex, 1] += 0.5 * y / count
    rows[vertex, 2] += 0.5 * z / count
    rows[vertex, prediction.KNOWN] = 1.0
