"""A quadratic surface through the known surroundings of a vertex, for the Diff coder at effort high.

In a frame of the ring's normal, the heights of the ring's members and of their neighbours are fitted by a quadratic
polynomial in the two tangential coordinates, weighted by distance, known vertices twice: normal equations, slightly
damped, solved by an LDL^T factorization. What is wanted is where the surface passes the middle of the vertex' cell:
its height there, and its normal. O(patch) per vertex.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact import diff_prediction_kernels as prediction
from meshtide_codec.compact.ring_kernels import RING_LIMIT
from meshtide_codec.compilation import borrowing_kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.diff_prediction_kernels import Predictions, Rows

PATCH_LIMIT = 40
TERMS = 6  # 1, u, v, u u, u v, v v
_NEAR = 0.25  # squared distance, in mean edge lengths, that is added before it weakens a point
_KNOWN_WEIGHT = 2.0
_SLOPE_DAMPING = 0.001
_CURVATURE_DAMPING = 0.01


@borrowing_kernel
def gather_patch(
    vertex: int,
    count: int,
    rows: Rows,
    starts: NDArray[np.int32],
    members: NDArray[np.int32],
    stamps: NDArray[np.int32],
    patch: Rows,
) -> int:
    """Offsets and weights of the ring's first `count` members, then of theirs, each once; returns how many.

    At most PATCH_LIMIT, and of each ring the first RING_LIMIT members. `stamps` (n,) holds for each vertex the last
    one whose patch it was in, -1 at first.
    """
    begin = starts[vertex]
    size = 0
    stamps[vertex] = vertex
    for place in range(count):
        size = _add_to_patch(vertex, members[begin + place], rows, stamps, patch, size)
    for place in range(count):
        neighbour = members[begin + place]
        first = starts[neighbour]
        for slot in range(first, min(starts[neighbour + 1], first + RING_LIMIT)):
            size = _add_to_patch(vertex, members[slot], rows, stamps, patch, size)
        if size == PATCH_LIMIT:
            break
    return size


@borrowing_kernel
def _add_to_patch(vertex: int, other: int, rows: Rows, stamps: NDArray[np.int32], patch: Rows, size: int) -> int:
    if stamps[other] == vertex or size == PATCH_LIMIT:
        return size
    stamps[other] = vertex
    for axis in range(3):
        patch[size, axis] = rows[other, axis] - rows[vertex, axis]
    patch[size, 3] = _KNOWN_WEIGHT if rows[other, prediction.KNOWN] > 0.0 else 1.0
    return size + 1


@borrowing_kernel
def fit_surface(
    size: int, scale: float, normal: Predictions, patch: Rows, matrix: Rows, solution: Rows, surface: Rows
) -> float:
    """The height over the vertex of the surface through `patch`, along its unit normal there.

    The unit normal is left in `surface` (3,).
    `normal` (3,) is a unit vector, `scale` > 0 the mean length of the ring's edges; `matrix` (6, 6) and `solution`
    (6,) are scratch.
    """
    least = 0
    if abs(normal[1]) < abs(normal[least]):
        least = 1
    if abs(normal[2]) < abs(normal[least]):
        least = 2
    unit_x, unit_y, unit_z = 1.0 * (least == 0), 1.0 * (least == 1), 1.0 * (least == 2)
    u_x = normal[1] * unit_z - normal[2] * unit_y
    u_y = normal[2] * unit_x - normal[0] * unit_z
    u_z = normal[0] * unit_y - normal[1] * unit_x
    length = np.sqrt(u_x * u_x + u_y * u_y + u_z * u_z)
    u_x, u_y, u_z = u_x / length, u_y / length, u_z / length
    v_x = normal[1] * u_z - normal[2] * u_y
    v_y = normal[2] * u_x - normal[0] * u_z
    v_z = normal[0] * u_y - normal[1] * u_x
    matrix[:, :] = 0.0
    solution[:] = 0.0
    inverse = 1.0 / scale
    for place in range(size):
        x, y, z = patch[place, 0] * inverse, patch[place, 1] * inverse, patch[place, 2] * inverse
        u = x * u_x + y * u_y + z * u_z
        v = x * v_x + y * v_y + z * v_z
        height = x * normal[0] + y * normal[1] + z * normal[2]
        slack = _NEAR + u * u + v * v
        weight = patch[place, 3] / (slack * slack)
        terms = (1.0, u, v, u * u, u * v, v * v)
        for row in range(TERMS):
            weighted = weight * terms[row]
            solution[row] += weighted * height
            for column in range(row + 1):
                matrix[row, column] += weighted * terms[column]
    for row in range(1, TERMS):
        matrix[row, row] += (_SLOPE_DAMPING if row < 3 else _CURVATURE_DAMPING) * matrix[0, 0]
    _solve(matrix, solution)
    slope_u = min(max(solution[1], -1.0), 1.0)
    slope_v = min(max(solution[2], -1.0), 1.0)
    x = normal[0] - slope_u * u_x - slope_v * v_x
    y = normal[1] - slope_u * u_y - slope_v * v_y
    z = normal[2] - slope_u * u_z - slope_v * v_z
    length = np.sqrt(x * x + y * y + z * z)
    surface[0], surface[1], surface[2] = x / length, y / length, z / length
    return float(solution[0] * scale / length)


@borrowing_kernel
def _solve(matrix: Rows, solution: Rows) -> None:
    """Replace `solution` by matrix^-1 solution; the lower triangle of a positive definite matrix is given, and lost."""
    for row in range(TERMS):
        for column in range(row):
            total = matrix[row, column]
            for inner in range(column):
                total -= matrix[row, inner] * matrix[column, inner] * matrix[inner, inner]
            matrix[row, column] = total / matrix[column, column]
        total = matrix[row, row]
        for inner in range(row):
            total -= matrix[row, inner] * matrix[row, inner] * matrix[inner, inner]
        matrix[row, row] = total
    for row in range(TERMS):
        for inner in range(row):
            solution[row] -= matrix[row, inner] * solution[inner]
    for row in range(TERMS):
        solution[row] /= matrix[row, row]
    for row in range(TERMS - 1, -1, -1):
        for inner in range(row + 1, TERMS):
            solution[row] -= matrix[inner, row] * solution[inner]
