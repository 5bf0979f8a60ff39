"""Kernels of the refit: rows of a least squares problem, its solution by conjugate gradients, and rounding to a grid.

A row says how far a point of one surface is from the other along a direction, and which three vertices move that
distance with which weights. O(rows) a pass; sums run in a fixed order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer

    Points = NDArray[np.float64]
    Integers = NDArray[np.int32]

REACH = 1  # grid steps that a vertex may move in a round of the rounding, along each axis


class Rows(NamedTuple):
    """Linear equations sum_i weight_i direction . x_(corner i) = target, to be met by least squares.

    Attributes:
        corners: (r, 3) int32 vertices.
        weights: (r, 3) float64.
        directions: (r, 3) float64 unit vectors.
        targets: (r,) float64.
    """

    corners: Integers
    weights: Points
    directions: Points
    targets: Points


@kernel
def residuals(rows: Rows, positions: Points, out: Points) -> None:
    """Left minus right side of every row at the given vertex positions (n, 3)."""
    for row in range(len(rows.targets)):
        out[row] = _left_side(rows, positions, row) - rows.targets[row]


@kernel
def _left_side(rows: Rows, positions: Points, row: Integer) -> float:
    total = 0.0
    for corner in range(3):
        vertex = rows.corners[row, corner]
        along = 0.0
        for axis in range(3):
            along += rows.directions[row, axis] * positions[vertex, axis]
        total += rows.weights[row, corner] * along
    return total


@kernel
def _add_transposed(rows: Rows, values: Points, out: Points) -> None:
    """Add the transposed system times `values` (r,) to `out` (n, 3)."""
    for row in range(len(values)):
        for corner in range(3):
            scaled = rows.weights[row, corner] * values[row]
            vertex = rows.corners[row, corner]
            for axis in range(3):
                out[vertex, axis] += scaled * rows.directions[row, axis]


@kernel
def solve(rows: Rows, positions: Points, stiffness: float, passes: Integer, tolerance: float) -> Points:
    """Vertex positions of the least sum of squares, each tied to where it is by a spring of the given stiffness.

    Conjugate gradients on the normal equations, from `positions`, at most `passes` times over the rows, until the
    gradient has fallen by `tolerance`.
    """
    solution = positions.copy()
    values = np.empty(len(rows.targets))
    residuals(rows, positions, values)
    gradient = np.zeros(positions.shape)
    _add_transposed(rows, values, gradient)
    step = -gradient
    square = _dot(gradient, gradient)
    goal = square * tolerance * tolerance
    image = np.empty(positions.shape)
    for _ in range(passes):
        if square <= goal:
            break
        for row in range(len(values)):
            values[row] = _left_side(rows, step, row)
        image[:] = 0.0
        _add_transposed(rows, values, image)
        curvature = 0.0
        for vertex in range(len(step)):
            for axis in range(3):
                image[vertex, axis] += stiffness * step[vertex, axis]
                curvature += image[vertex, axis] * step[vertex, axis]
        if curvature <= 0.0:
            break
        length = square / curvature
        for vertex in range(len(step)):
            for axis in range(3):
                solution[vertex, axis] += length * step[vertex, axis]
                gradient[vertex, axis] += length * image[vertex, axis]
        previous = square
        square = _dot(gradient, gradient)
        for vertex in range(len(step)):
            for axis in range(3):
                step[vertex, axis] = square / previous * step[vertex, axis] - gradient[vertex, axis]
    return solution


@kernel
def _dot(left: Points, right: Points) -> float:
    total = 0.0
    for row in range(left.shape[0]):
        for column in range(left.shape[1]):
            total += left[row, column] * right[row, column]
    return total


@kernel
def rows_of_vertices(rows: Rows, vertex_count: Integer) -> tuple[Integers, Integers]:
    """For vertex v the slots (3 row + corner) `slots[starts[v]:starts[v + 1]]` where it stands."""
    starts = np.zeros(vertex_count + 1, np.int32)
    for row in range(len(rows.targets)):
        for corner in range(3):
            starts[rows.corners[row, corner] + 1] += 1
    for vertex in range(vertex_count):
        starts[vertex + 1] += starts[vertex]
    filled = starts[:vertex_count].copy()
    slots = np.empty(3 * len(rows.targets), np.int32)
    for row in range(len(rows.targets)):
        for corner in range(3):
            vertex = rows.corners[row, corner]
            slots[filled[vertex]] = 3 * row + corner
            filled[vertex] += 1
    return starts, slots


@kernel
def round_to_grid(
    rows: Rows, wanted: Points, grid: Integers, step: float, last: Integer, stiffness: float, rounds: Integer
) -> None:
    """Move the vertices among the points of a grid until no single move makes the sum of squares smaller.

    Args:
        rows: the system, with targets for positions in finest steps.
        wanted: (n, 3) positions that springs pull to, in finest steps.
        grid: (n, 3), the vertices' grid points, which are changed.
        step: side of the grid in finest steps.
        last: the largest grid coordinate.
        stiffness: of the springs.
        rounds: passes over all vertices at most.
    """
    starts, slots = rows_of_vertices(rows, len(grid))
    values = np.empty(len(rows.targets))
    residuals(rows, grid.astype(np.float64) * step, values)
    hessian = np.empty(6)
    for _ in range(rounds):
        moved = 0
        for vertex in range(len(grid)):
            gx = stiffness * (grid[vertex, 0] * step - wanted[vertex, 0])
            gy = stiffness * (grid[vertex, 1] * step - wanted[vertex, 1])
            gz = stiffness * (grid[vertex, 2] * step - wanted[vertex, 2])
            hessian[:] = 0.0
            hessian[0] = hessian[3] = hessian[5] = stiffness
            for index in range(starts[vertex], starts[vertex + 1]):
                row = slots[index] // 3
                weight = rows.weights[row, slots[index] % 3]
                x, y, z = (
                    weight * rows.directions[row, 0],
                    weight * rows.directions[row, 1],
                    weight * rows.directions[row, 2],
                )
                gx += values[row] * x
                gy += values[row] * y
                gz += values[row] * z
                hessian[0] += x * x
                hessian[1] += x * y
                hessian[2] += x * z
                hessian[3] += y * y
                hessian[4] += y * z
                hessian[5] += z * z
            best = 0.0
            best_x, best_y, best_z = 0, 0, 0
            for i in range(-REACH, REACH + 1):
                for j in range(-REACH, REACH + 1):
                    for k in range(-REACH, REACH + 1):
                        if not (
                            0 <= grid[vertex, 0] + i <= last
                            and 0 <= grid[vertex, 1] + j <= last
                            and 0 <= grid[vertex, 2] + k <= last
                        ):
                            continue
                        x, y, z = i * step, j * step, k * step
                        change = 2.0 * (gx * x + gy * y + gz * z)
                        change += hessian[0] * x * x + hessian[3] * y * y + hessian[5] * z * z
                        change += 2.0 * (hessian[1] * x * y + hessian[2] * x * z + hessian[4] * y * z)
                        if change < best:
                            best, best_x, best_y, best_z = change, i, j, k
            if best < 0.0:
                moved += 1
                grid[vertex, 0] += best_x
                grid[vertex, 1] += best_y
                grid[vertex, 2] += best_z
                for index in range(starts[vertex], starts[vertex + 1]):
                    row = slots[index] // 3
                    weight = rows.weights[row, slots[index] % 3]
                    along = rows.directions[row, 0] * best_x
                    along += rows.directions[row, 1] * best_y
                    along += rows.directions[row, 2] * best_z
                    values[row] += weight * step * along
        if moved == 0:
            break
