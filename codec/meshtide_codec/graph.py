"""The vertex graph of a mesh and its random-walk Laplacian K = I - D^-1 M.

An edge joins any two different vertices of one face, so non-manifold, open and degenerate meshes are as good
as others. Time and memory are linear in vertices and faces.
Source: Balan & Taubin 2000, section 2, eq. (1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec import graph_kernels
from meshtide_codec.errors import MeshError

if TYPE_CHECKING:
    from numpy.typing import NDArray

MAXIMUM_VERTICES = 2**31 - 1  # indices are int32


@dataclass(frozen=True, eq=False)
class Adjacency:
    """Neighbours of every vertex, one list behind the other.

    Args:
        offsets: (n+1,) int64; vertex v's neighbours are ``neighbours[offsets[v]:offsets[v + 1]]``.
        neighbours: (e,) int32, ascending within each list; each undirected edge appears twice.

    Raises:
        MeshError: the arrays do not describe n lists of vertices below n.
    """

    offsets: NDArray[np.int64]
    neighbours: NDArray[np.int32]

    def __post_init__(self) -> None:
        if self.offsets.ndim != 1 or self.offsets.dtype != np.int64 or len(self.offsets) == 0:
            raise MeshError("offsets must be an (n+1,) array of int64")
        if self.neighbours.ndim != 1 or self.neighbours.dtype != np.int32:
            raise MeshError("neighbours must be an (e,) array of int32")
        if self.offsets[0] != 0 or self.offsets[-1] != len(self.neighbours) or np.any(np.diff(self.offsets) < 0):
            raise MeshError("offsets must ascend from 0 to the number of neighbours")
        if len(self.neighbours) and (self.neighbours.min() < 0 or self.neighbours.max() >= self.vertex_count):
            raise MeshError(f"neighbours must lie in [0, {self.vertex_count})")

    @property
    def vertex_count(self) -> int:
        """Number of vertices, isolated ones included."""
        return len(self.offsets) - 1

    @property
    def degree(self) -> NDArray[np.int64]:
        """(n,) int64: number of neighbours of each vertex; 0 for an isolated one."""
        degree: NDArray[np.int64] = np.diff(self.offsets)
        return degree

    def __repr__(self) -> str:
        return f"Adjacency({self.vertex_count} vertices, {len(self.neighbours) // 2} edges)"


def build_adjacency(faces: NDArray[np.int32], vertex_count: int) -> Adjacency:
    """The vertex graph of a triangle set.

    Two passes of a counting sort: lists with repetitions, then their transpose, which comes out sorted and is
    thinned on the way. Besides the result it takes 48 bytes per face and 16 per vertex.

    Args:
        faces: (m, 3) int32.
        vertex_count: number of vertices, at least 0.

    Raises:
        MeshError: the faces have another shape or type, or an index is out of range.

    >>> adjacency = build_adjacency(np.array([[0, 1, 2], [2, 1, 3]], np.int32), 5)
    >>> adjacency
    Adjacency(5 vertices, 5 edges)
    >>> adjacency.neighbours[adjacency.offsets[1] : adjacency.offsets[2]].tolist()
    [0, 2, 3]
    >>> adjacency.degree.tolist()
    [2, 3, 3, 2, 0]
    """
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype != np.int32:
        raise MeshError(f"faces must be an (m, 3) array of int32, not {faces.shape} of {faces.dtype}")
    if not 0 <= vertex_count <= MAXIMUM_VERTICES:
        raise MeshError(f"vertex count {vertex_count} is outside of [0, {MAXIMUM_VERTICES}]")
    bad = graph_kernels.first_bad_face(faces, vertex_count)
    if bad != graph_kernels.NO_BAD_FACE:
        raise MeshError(f"face {bad} is {faces[bad].tolist()}, but there are {vertex_count} vertices")
    starts = np.zeros(vertex_count + 1, np.int64)
    graph_kernels.count_corner_neighbours(faces, starts)
    sources = np.empty(starts[-1], np.int32)
    ends = starts[:-1].copy()
    graph_kernels.scatter_corner_neighbours(faces, ends, sources)
    ends[:] = starts[:-1]
    neighbours = np.empty(starts[-1], np.int32)
    graph_kernels.transpose_unique(starts, sources, ends, neighbours)
    offsets = np.empty(vertex_count + 1, np.int64)
    graph_kernels.close_gaps(starts, ends, neighbours, offsets)
    return Adjacency(offsets, neighbours[: offsets[-1]].copy())


def apply_k(adjacency: Adjacency, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """K x: every value minus the mean of its neighbours' values (eq. 1); 0 for an isolated vertex.

    Bit for bit the same everywhere: neighbours are summed in ascending order.

    Args:
        adjacency: the vertex graph.
        values: (n,) or (n, 3) float64, finite.

    Raises:
        MeshError: the values have another shape or type, or are not finite.

    >>> adjacency = build_adjacency(np.array([[0, 1, 2]], np.int32), 4)
    >>> apply_k(adjacency, np.array([3.0, 0.0, 6.0, 9.0])).tolist()
    [0.0, -4.5, 4.5, 0.0]
    """
    if values.shape not in {(adjacency.vertex_count,), (adjacency.vertex_count, 3)}:
        count = adjacency.vertex_count
        raise MeshError(f"values must be of shape ({count},) or ({count}, 3), not {values.shape}")
    check_finite_values(values, "values")
    values = np.ascontiguousarray(values)
    result = np.empty_like(values)
    if values.ndim == 1:
        graph_kernels.apply_k_to_column(adjacency.offsets, adjacency.neighbours, values, result)
    else:
        graph_kernels.apply_k_to_points(adjacency.offsets, adjacency.neighbours, values, result)
    return result


def check_points(adjacency: Adjacency, points: NDArray[np.float64], name: str) -> None:
    """Raise MeshError unless `points` is (n, 3), float64 and finite, n being the graph's number of vertices."""
    if points.shape != (adjacency.vertex_count, 3):
        raise MeshError(f"{name} must be of shape ({adjacency.vertex_count}, 3), not {points.shape}")
    check_finite_values(points, name)


def check_finite_values(values: NDArray[np.float64], name: str) -> None:
    """Raise MeshError unless `values` is float64 and finite."""
    if values.dtype != np.float64:
        raise MeshError(f"{name} must be float64, not {values.dtype}")
    if not np.isfinite(values).all():
        row = int(np.argwhere(~np.isfinite(values))[0][0])
        raise MeshError(f"{name} must be finite; row {row} is {values[row]}")
