"""Kernels of the fit: orthonormal columns, projections, and sums of weighted products, in a fixed order.

Orthonormalisation is modified Gram-Schmidt, done twice ("twice is enough"), which stays orthogonal to
rounding however alike the columns are. Cost: O(n d^2). Sums run in four lanes: fast, accurate, and the same
bits everywhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

NEGLIGIBLE = 1e-10  # of the longest column: what is left of a column below this length is rounding noise


@kernel
def dot(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Sum of products, in four interleaved lanes that are added at the end."""
    lane_0 = 0.0
    lane_1 = 0.0
    lane_2 = 0.0
    lane_3 = 0.0
    whole = first.shape[0] - first.shape[0] % 4
    for row in range(0, whole, 4):
        lane_0 += first[row] * second[row]
        lane_1 += first[row + 1] * second[row + 1]
        lane_2 += first[row + 2] * second[row + 2]
        lane_3 += first[row + 3] * second[row + 3]
    for row in range(whole, first.shape[0]):
        lane_0 += first[row] * second[row]
    return (lane_0 + lane_1) + (lane_2 + lane_3)


@kernel
def clear_isolated_rows(offsets: NDArray[np.int64], columns: NDArray[np.float64]) -> None:
    """Set to 0 the rows of `columns` (n, k) that belong to vertices without neighbours: no filter moves those."""
    for row in range(columns.shape[0]):
        if offsets[row] == offsets[row + 1]:
            for column in range(columns.shape[1]):
                columns[row, column] = 0.0


@kernel
def orthonormalise(columns: NDArray[np.float64], triangle: NDArray[np.float64]) -> int:
    """Replace `columns` (n, k) by an orthonormal basis Q with columns = Q triangle, as far as they are independent.

    Returns how many leading columns are; the first one that is not ends the work.
    """
    count: int = columns.shape[1]
    longest = 0.0
    for column in range(count):
        current = columns[:, column]
        longest = max(longest, np.sqrt(dot(current, current)))
        for _ in range(2):
            for earlier in range(column):
                share = dot(columns[:, earlier], current)
                triangle[earlier, column] += share
                for row in range(columns.shape[0]):
                    current[row] -= share * columns[row, earlier]
        length = np.sqrt(dot(current, current))
        if not length > NEGLIGIBLE * longest:
            return column
        triangle[column, column] = length
        for row in range(columns.shape[0]):
            current[row] /= length
    return count


@kernel
def project(columns: NDArray[np.float64], rank: int, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Take from `values` (n) its part along the first `rank` orthonormal columns; returns the (rank) shares."""
    shares = np.zeros(rank, np.float64)
    for _ in range(2):
        for column in range(rank):
            share = dot(columns[:, column], values)
            shares[column] += share
            for row in range(columns.shape[0]):
                values[row] -= share * columns[row, column]
    return shares


@kernel
def combine(columns: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum of shares[k] * columns[:, k] over the leading columns."""
    result = np.zeros(columns.shape[0], np.float64)
    for column in range(shares.shape[0]):
        for row in range(columns.shape[0]):
            result[row] += shares[column] * columns[row, column]
    return result


@kernel
def weighted_products(
    columns: NDArray[np.float64],
    rank: int,
    weights: NDArray[np.float64],
    values: NDArray[np.float64],
    matrix: NDArray[np.float64],
    vector: NDArray[np.float64],
) -> None:
    """Set matrix = C^T W C and vector = C^T W values, C being the first `rank` columns: weighted normal equations."""
    weighted = np.empty(columns.shape[0], np.float64)
    for column in range(rank):
        for row in range(columns.shape[0]):
            weighted[row] = weights[row] * columns[row, column]
        vector[column] = dot(weighted, values)
        for other in range(column + 1):
            matrix[column, other] = dot(weighted, columns[:, other])
            matrix[other, column] = matrix[column, other]
