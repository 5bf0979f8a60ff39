"""Kernels of the filters: polynomials in K without a matrix, and the solution of Q(K) x = b.

Source: Balan & Taubin 2000, eqs. (2), (3), (5), (12), (15), (16). A polynomial of degree d costs d products
with K. Chebyshev polynomials are taken of K - I, whose spectrum is [-1, 1]. All loops run in a fixed order.
Coordinates are columns of (n, 3) arrays, each with its own coefficients.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel
from meshtide_codec.graph_kernels import apply_k_to_column, apply_k_to_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

RELATIVE_RESIDUAL = 1e-11  # where conjugate gradients stop, in the norm weighted by vertex degrees
MAXIMUM_ITERATIONS = 256  # enough for that residual at the largest ratio of Q's values that is admitted, 256


@kernel
def power_polynomial(
    offsets: NDArray[np.int64],
    neighbours: NDArray[np.int32],
    points: NDArray[np.float64],
    coefficients: NDArray[np.float64],
) -> NDArray[np.float64]:
    """sum_k c_k K^k points, by Horner's rule; coefficients (3, d+1)."""
    degree = coefficients.shape[1] - 1
    result = np.empty_like(points)
    for vertex in range(points.shape[0]):
        for axis in range(3):
            result[vertex, axis] = coefficients[axis, degree] * points[vertex, axis]
    product = np.empty_like(points)
    for power in range(degree - 1, -1, -1):
        apply_k_to_points(offsets, neighbours, result, product)
        for vertex in range(points.shape[0]):
            for axis in range(3):
                result[vertex, axis] = product[vertex, axis] + coefficients[axis, power] * points[vertex, axis]
    return result


@kernel
def chebyshev_polynomial(
    offsets: NDArray[np.int64],
    neighbours: NDArray[np.int32],
    points: NDArray[np.float64],
    coefficients: NDArray[np.float64],
) -> NDArray[np.float64]:
    """sum_k c_k T_k(K - I) points, by Clenshaw's rule; coefficients (3, d+1)."""
    degree = coefficients.shape[1] - 1
    later = np.zeros_like(points)
    result = np.empty_like(points)
    for vertex in range(points.shape[0]):
        for axis in range(3):
            result[vertex, axis] = coefficients[axis, degree] * points[vertex, axis]
    product = np.empty_like(points)
    for order in range(degree - 1, -1, -1):
        factor = 2.0 if order > 0 else 1.0
        apply_k_to_points(offsets, neighbours, result, product)
        for vertex in range(points.shape[0]):
            for axis in range(3):
                shifted = factor * (product[vertex, axis] - result[vertex, axis])
                value = (shifted - later[vertex, axis]) + coefficients[axis, order] * points[vertex, axis]
                later[vertex, axis] = result[vertex, axis]
                result[vertex, axis] = value
    return result


@kernel
def power_columns(offsets: NDArray[np.int64], neighbours: NDArray[np.int32], columns: NDArray[np.float64]) -> None:
    """Fill columns 1.. of `columns` (n, d+1) with K^k of column 0."""
    for power in range(1, columns.shape[1]):
        apply_k_to_column(offsets, neighbours, columns[:, power - 1], columns[:, power])


@kernel
def chebyshev_columns(offsets: NDArray[np.int64], neighbours: NDArray[np.int32], columns: NDArray[np.float64]) -> None:
    """Fill columns 1.. of `columns` (n, d+1) with T_k(K - I) of column 0."""
    for order in range(1, columns.shape[1]):
        apply_k_to_column(offsets, neighbours, columns[:, order - 1], columns[:, order])
        for vertex in range(columns.shape[0]):
            shifted = columns[vertex, order] - columns[vertex, order - 1]
            if order > 1:
                shifted = 2.0 * shifted - columns[vertex, order - 2]
            columns[vertex, order] = shifted


@kernel
def apply_denominator(
    offsets: NDArray[np.int64],
    neighbours: NDArray[np.int32],
    denominator: NDArray[np.float64],
    values: NDArray[np.float64],
    product: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Set result = (I + q_1 K + q_2 K^2 + ...) values, by Horner's rule; `product` is room to work in."""
    degree = denominator.shape[0]
    for vertex in range(values.shape[0]):
        result[vertex] = denominator[degree - 1] * values[vertex]
    for power in range(degree - 1, -1, -1):
        factor = denominator[power - 1] if power > 0 else 1.0
        apply_k_to_column(offsets, neighbours, result, product)
        for vertex in range(values.shape[0]):
            result[vertex] = product[vertex] + factor * values[vertex]


@kernel
def weighted_dot(offsets: NDArray[np.int64], first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Sum of degree * first * second over the vertices, in order."""
    total = 0.0
    for vertex in range(first.shape[0]):
        total += (offsets[vertex + 1] - offsets[vertex]) * (first[vertex] * second[vertex])
    return total


@kernel
def solve_denominator(
    offsets: NDArray[np.int64],
    neighbours: NDArray[np.int32],
    denominator: NDArray[np.float64],
    right_side: NDArray[np.float64],
    solution: NDArray[np.float64],
) -> int:
    """Solve (I + q_1 K + ...) solution = right_side by conjugate gradients; returns the number of iterations.

    K is self-adjoint in the inner product weighted by degrees, so Q(K) is symmetric and, where Q > 0 on [0, 2],
    positive definite there. The search starts at the right side: isolated vertices, of weight 0, are solved by that.
    """
    count = right_side.shape[0]
    product = np.empty(count, np.float64)
    image = np.empty(count, np.float64)
    residual = np.empty(count, np.float64)
    direction = np.empty(count, np.float64)
    apply_denominator(offsets, neighbours, denominator, right_side, product, image)
    for vertex in range(count):
        solution[vertex] = right_side[vertex]
        residual[vertex] = right_side[vertex] - image[vertex]
        direction[vertex] = residual[vertex]
    goal = RELATIVE_RESIDUAL * RELATIVE_RESIDUAL * weighted_dot(offsets, right_side, right_side)
    energy = weighted_dot(offsets, residual, residual)
    for iteration in range(MAXIMUM_ITERATIONS):
        if energy <= goal:
            return iteration
        apply_denominator(offsets, neighbours, denominator, direction, product, image)
        curvature = weighted_dot(offsets, direction, image)
        if not curvature > 0.0:
            return iteration
        step = energy / curvature
        for vertex in range(count):
            solution[vertex] += step * direction[vertex]
            residual[vertex] -= step * image[vertex]
        next_energy = weighted_dot(offsets, residual, residual)
        growth = next_energy / energy
        energy = next_energy
        for vertex in range(count):
            direction[vertex] = residual[vertex] + growth * direction[vertex]
    return MAXIMUM_ITERATIONS


@kernel
def restore_isolated(offsets: NDArray[np.int64], points: NDArray[np.float64], result: NDArray[np.float64]) -> None:
    """Put every vertex without neighbours back to its place in `points` (n, 3)."""
    for vertex in range(points.shape[0]):
        if offsets[vertex] == offsets[vertex + 1]:
            for axis in range(3):
                result[vertex, axis] = points[vertex, axis]
