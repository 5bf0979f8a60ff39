"""The Diff coder's working rows: what is known of each vertex when a Diff begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.diff_kernels import ERROR_GROWTH, FOREIGN_ERROR, NEW_ERROR
from meshtide_codec.compact.diff_prediction_kernels import ERROR, KNOWN, ROW_SIZE
from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel
def fill_rows(
    centres: NDArray[np.int32],
    cell_depths: NDArray[np.uint8],
    depth: int,
    owners: NDArray[np.int32],
    cells: NDArray[np.int32],
    errors: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Rows (n, ROW_SIZE) of a level: cells of `depth` are known; `owners` stand in the middle of their `cells`.

    `cells` (k, 3) and `errors` (k,) are what the slice's Diffs have told of its `owners` (k,) up to depth - 1.
    Leaves of other slices stand at their centres.
    """
    rows = np.zeros((len(centres), ROW_SIZE))
    for vertex in range(len(centres)):
        for axis in range(3):
            rows[vertex, axis] = centres[vertex, axis]
        known = cell_depths[vertex] == depth
        rows[vertex, KNOWN] = 1.0 if known else 0.0
        rows[vertex, ERROR] = NEW_ERROR if known else FOREIGN_ERROR
    for index in range(len(owners)):
        vertex = owners[index]
        for axis in range(3):
            rows[vertex, axis] = 4 * cells[index, axis] + 2
        rows[vertex, ERROR] = errors[index] * ERROR_GROWTH
    return rows
