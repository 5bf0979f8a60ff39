"""A quadratic surface through the surroundings of a vertex (docs/format.md, section 8.5.1)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from meshtide_codec.reference.octree import RING_LIMIT

if TYPE_CHECKING:
    from meshtide_codec.reference.diff_rows import Row
    from meshtide_codec.reference.octree import Level

LARGEST_PATCH = 40
TERMS = 6

Point = tuple[list[float], float]
"""An offset from the vertex, and a weight."""


def patch_of(level: Level, rows: list[Row], vertex: int) -> list[Point]:
    """The members of the ring of a vertex, then theirs, each once."""
    members = level.rings[vertex].members[:RING_LIMIT]
    seen = {vertex: None}
    for other in members + [other for member in members for other in level.rings[member].members[:RING_LIMIT]]:
        seen.setdefault(other)
    middle = rows[vertex].position
    return [
        ([there - here for there, here in zip(rows[other].position, middle, strict=True)], 1.0 + rows[other].known)
        for other in list(seen)[1 : LARGEST_PATCH + 1]
    ]


def fit_surface(patch: list[Point], scale: float, normal: list[float]) -> tuple[float, list[float]]:
    """The height of the surface over the vertex, along its unit normal there; and that normal."""
    least = min(range(3), key=lambda axis: abs(normal[axis]))
    first = _cross(normal, [float(axis == least) for axis in range(3)])
    length = math.sqrt(first[0] * first[0] + first[1] * first[1] + first[2] * first[2])
    first = [component / length for component in first]
    second = _cross(normal, first)
    matrix = [[0.0] * TERMS for _ in range(TERMS)]
    right = [0.0] * TERMS
    inverse = 1.0 / scale
    for offset, point_weight in patch:
        x, y, z = (component * inverse for component in offset)
        u = x * first[0] + y * first[1] + z * first[2]
        v = x * second[0] + y * second[1] + z * second[2]
        height = x * normal[0] + y * normal[1] + z * normal[2]
        slack = 0.25 + u * u + v * v
        weight = point_weight / (slack * slack)
        terms = [1.0, u, v, u * u, u * v, v * v]
        for row in range(TERMS):
            weighted = weight * terms[row]
            right[row] += weighted * height
            for column in range(row + 1):
                matrix[row][column] += weighted * terms[column]
    for row in range(1, TERMS):
        matrix[row][row] += (0.001 if row < 3 else 0.01) * matrix[0][0]  # slopes less than curvatures
    solution = _solve(matrix, right)
    slope_u, slope_v = (min(max(slope, -1.0), 1.0) for slope in solution[1:3])
    surface = [normal[axis] - slope_u * first[axis] - slope_v * second[axis] for axis in range(3)]
    length = math.sqrt(surface[0] * surface[0] + surface[1] * surface[1] + surface[2] * surface[2])
    return solution[0] * scale / length, [component / length for component in surface]


def _cross(a: list[float], b: list[float]) -> list[float]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _solve(matrix: list[list[float]], right: list[float]) -> list[float]:
    """By L D L^T, D on the diagonal, from the lower triangle."""
    for row in range(TERMS):
        for column in range(row + 1):
            total = matrix[row][column]
            for inner in range(column):
                total -= matrix[row][inner] * matrix[column][inner] * matrix[inner][inner]
            matrix[row][column] = total if row == column else total / matrix[column][column]
    solution = list(right)
    for row in range(TERMS):
        for inner in range(row):
            solution[row] -= matrix[row][inner] * solution[inner]
    for row in range(TERMS):
        solution[row] /= matrix[row][row]
    for row in reversed(range(TERMS)):
        for inner in range(row + 1, TERMS):
            solution[row] -= matrix[inner][row] * solution[inner]
    return solution
