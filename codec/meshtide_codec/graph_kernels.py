"""Kernels of the vertex graph: neighbour lists by counting sort, and the product with K.

Source: Balan & Taubin 2000, section 2, eq. (1). Every kernel is linear in the number of faces or edges.
Sums run over a vertex's neighbours in ascending order, so results are the same bits on every machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

NO_BAD_FACE = -1


@kernel
def first_bad_face(faces: NDArray[np.int32], vertex_count: int) -> int:
    """Row of the first face with an index outside of [0, vertex_count), or NO_BAD_FACE."""
    for face in range(faces.shape[0]):
        for corner in range(3):
            if faces[face, corner] < 0 or faces[face, corner] >= vertex_count:
                return face
    return NO_BAD_FACE


@kernel
def count_corner_neighbours(faces: NDArray[np.int32], starts: NDArray[np.int64]) -> None:
    """Fill `starts` (n+1, zeros) with where each vertex's list begins when repeated edges are kept.

    A face gives each corner its two other corners; corners that are the same vertex are no edge.
    """
    for face in range(faces.shape[0]):
        for corner in range(3):
            first = faces[face, corner]
            second = faces[face, (corner + 1) % 3]
            if first != second:
                starts[first + 1] += 1
                starts[second + 1] += 1
    for vertex in range(starts.shape[0] - 1):
        starts[vertex + 1] += starts[vertex]


@kernel
def scatter_corner_neighbours(faces: NDArray[np.int32], ends: NDArray[np.int64], sources: NDArray[np.int32]) -> None:
    """Write every directed edge's start into the list of its end; `ends` (n) begins as a copy of the starts."""
    for face in range(faces.shape[0]):
        for corner in range(3):
            first = faces[face, corner]
            second = faces[face, (corner + 1) % 3]
            if first != second:
                sources[ends[first]] = second
                ends[first] += 1
                sources[ends[second]] = first
                ends[second] += 1


@kernel
def transpose_unique(
    starts: NDArray[np.int64],
    sources: NDArray[np.int32],
    ends: NDArray[np.int64],
    neighbours: NDArray[np.int32],
) -> None:
    """Sort and thin the lists by transposing them: visited in ascending order, a vertex joins each list once.

    `ends` (n) begins as a copy of the starts and finishes behind the last neighbour of each vertex.
    """
    for vertex in range(starts.shape[0] - 1):
        for position in range(starts[vertex], starts[vertex + 1]):
            source = sources[position]
            end = ends[source]
            if end == starts[source] or neighbours[end - 1] != vertex:
                neighbours[end] = vertex
                ends[source] = end + 1


@kernel
def close_gaps(
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
    neighbours: NDArray[np.int32],
    offsets: NDArray[np.int64],
) -> None:
    """Move the lists together at the front of `neighbours`; `offsets` (n+1) receives where they begin."""
    total = 0
    for vertex in range(ends.shape[0]):
        offsets[vertex] = total
        for position in range(starts[vertex], ends[vertex]):
            neighbours[total] = neighbours[position]
            total += 1
    offsets[ends.shape[0]] = total


@kernel
def apply_k_to_column(
    offsets: NDArray[np.int64],
    neighbours: NDArray[np.int32],
    values: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Set result = K values for one value per vertex; 0 where a vertex has no neighbours."""
    for vertex in range(values.shape[0]):
        start = offsets[vertex]
        end = offsets[vertex + 1]
        if start == end:
            result[vertex] = 0.0
        else:
            total = 0.0
            for position in range(start, end):
                total += values[neighbours[position]]
            result[vertex] = values[vertex] - total / (end - start)


@kernel
def apply_k_to_points(
    offsets: NDArray[np.int64],
    neighbours: NDArray[np.int32],
    points: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Set result = K points for three coordinates per vertex; the same bits as `apply_k_to_column` on each of them."""
    for vertex in range(points.shape[0]):
        start = offsets[vertex]
        end = offsets[vertex + 1]
        if start == end:
            result[vertex, 0] = 0.0
            result[vertex, 1] = 0.0
            result[vertex, 2] = 0.0
        else:
            total_x = 0.0
            total_y = 0.0
            total_z = 0.0
            for position in range(start, end):
                neighbour = neighbours[position]
                total_x += points[neighbour, 0]
                total_y += points[neighbour, 1]
                total_z += points[neighbour, 2]
            count = end - start
            result[vertex, 0] = points[vertex, 0] - total_x / count
            result[vertex, 1] = points[vertex, 1] - total_y / count
            result[vertex, 2] = points[vertex, 2] - total_z / count
