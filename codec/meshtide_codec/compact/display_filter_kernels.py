"""The display filter's inner loops: a step along the Laplacian within known cells, and how far off a level is then."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel
def move_within_cells(
    positions: NDArray[np.float64],
    middles: NDArray[np.int64],
    half_sides: NDArray[np.int64],
    starts: NDArray[np.int32],
    members: NDArray[np.int32],
    strength: float,
) -> NDArray[np.float64]:
    """Positions x - strength K x, each coordinate clamped to middle +- half side; half side 1 means exactly known.

    All in half finest steps; K x is x minus the mean of the ring's members.
    """
    moved = np.empty(positions.shape, np.float64)
    for vertex in range(len(positions)):
        first, last = int(starts[vertex]), int(starts[vertex + 1])
        half_side = half_sides[vertex]
        for axis in range(3):
            position = positions[vertex, axis]
            if last > first and half_side > 1:
                total = 0.0
                for slot in range(first, last):
                    total += positions[members[slot], axis]
                position -= strength * (position - total / (last - first))
                middle = middles[vertex, axis]
                position = min(max(position, float(middle - half_side)), float(middle + half_side))
            moved[vertex, axis] = position
    return moved


@kernel
def squared_distance(
    positions: NDArray[np.float64],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    faces: NDArray[np.int32],
    areas: NDArray[np.float64],
) -> float:
    """Sum over faces of area times the square of how far its middle is from the planes through points, on average."""
    apart = np.empty(len(positions), np.float64)
    for vertex in range(len(positions)):
        total = 0.0
        for axis in range(3):
            total += (positions[vertex, axis] - points[vertex, axis]) * normals[vertex, axis]
        apart[vertex] = total
    cost = 0.0
    for face in range(len(faces)):
        mean = (apart[faces[face, 0]] + apart[faces[face, 1]] + apart[faces[face, 2]]) / 3.0
        cost += areas[face] * mean * mean
    return cost
