"""Kernels that choose points of a surface: samples spread by area, and vertices in the order of the faces.

Linear in the numbers of faces and points; sums run in a fixed order, so a seed gives the same bits on every machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer

    Points = NDArray[np.float64]


@kernel
def vertices_along(faces: NDArray[np.int32], vertex_count: Integer) -> NDArray[np.int32]:
    """The vertices that the faces use, each once, in the order of their first faces, which are in range."""
    seen = np.zeros(vertex_count, np.bool_)
    order = np.empty(vertex_count, np.int32)
    count = 0
    for face in range(len(faces)):
        for corner in range(3):
            vertex = faces[face, corner]
            if not seen[vertex]:
                seen[vertex] = True
                order[count] = vertex
                count += 1
    return order[:count].copy()


@kernel
def sample_triangles(
    vertices: Points, faces: NDArray[np.int32], numbers: Points, places: NDArray[np.int32], weights: Points
) -> None:
    """Points on the triangles, evenly by area, in the triangles' order; by count when none has any area.

    Args:
        vertices: (n, 3).
        faces: (m, 3), m >= 1, indices in range.
        numbers: (3, k) random numbers in [0, 1): the place in the sample's share of area, and two in the triangle.
        places: (k,), becomes the triangles.
        weights: (k, 3), becomes the weights of their corners.
    """
    count = numbers.shape[1]
    ends = np.empty(len(faces))
    total = 0.0
    for face in range(len(faces)):
        total += _area(vertices, faces, face)
        ends[face] = total
    if total == 0.0:
        for face in range(len(faces)):
            ends[face] = face + 1.0
        total = float(len(faces))
    face = 0
    for sample in range(count):
        target = (sample + numbers[0, sample]) * (total / count)
        while face < len(faces) - 1 and ends[face] < target:
            face += 1
        root = np.sqrt(numbers[1, sample])
        places[sample] = face
        weights[sample, 0] = 1.0 - root
        weights[sample, 1] = root * (1.0 - numbers[2, sample])
        weights[sample, 2] = root * numbers[2, sample]


@kernel
def weighted_points(vertices: Points, corners: NDArray[np.int32], weights: Points, points: Points) -> None:
    """Fill `points` (k, 3) with the weighted sums of the corners (k, 3)."""
    for point in range(len(corners)):
        for axis in range(3):
            points[point, axis] = (
                weights[point, 0] * vertices[corners[point, 0], axis]
                + weights[point, 1] * vertices[corners[point, 1], axis]
                + weights[point, 2] * vertices[corners[point, 2], axis]
            )


@kernel
def _area(vertices: Points, faces: NDArray[np.int32], face: Integer) -> float:
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    bx, by, bz = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
    cx, cy, cz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
    nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    return float(0.5 * np.sqrt(nx * nx + ny * ny + nz * nz))
