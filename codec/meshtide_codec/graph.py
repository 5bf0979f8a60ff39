"""The vertex graph of a mesh and its random-walk Laplacian K = I - D^-1 M.

An edge joins any two different vertices of one face, so non-manifold, open and degenerate meshes are as good
as others. Time and memory are linear in vertices and faces.
Source: Balan & Taubin 2000, section 2, eq. (1).
"""

from __future__ import annotations

from ctypes import byref
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec import core
from meshtide_codec.errors import MeshError

if TYPE_CHECKING:
    from numpy.typing import NDArray

MAXIMUM_VERTICES = 2**31 - 1  # indices are int32


class Adjacency:
    """Neighbours of every vertex of a triangle set; made by `build_adjacency`.

    Args:
        graph: the core's, mt_graph.
    """

    def __init__(self, graph: core.Handle) -> None:
        self.graph = graph
        self._lists = core.GraphLists()
        core.library().mt_graph_get_lists(graph, byref(self._lists))

    @property
    def vertex_count(self) -> int:
        """Number of vertices, isolated ones included."""
        return int(self._lists.vertex_count)

    @cached_property
    def offsets(self) -> NDArray[np.int64]:
        """(n+1,) int64; vertex v's neighbours are ``neighbours[offsets[v]:offsets[v + 1]]``."""
        return core.copied(self._lists.offsets, (self.vertex_count + 1,), np.uint32).astype(np.int64)

    @cached_property
    def neighbours(self) -> NDArray[np.int32]:
        """(e,) int32, ascending within each vertex's list; each undirected edge appears twice."""
        return core.copied(self._lists.neighbours, (self._lists.neighbour_count,), np.int32)

    @property
    def degree(self) -> NDArray[np.int64]:
        """(n,) int64: number of neighbours of each vertex; 0 for an isolated one."""
        degree: NDArray[np.int64] = np.diff(self.offsets)
        return degree

    def __repr__(self) -> str:
        return f"Adjacency({self.vertex_count} vertices, {self._lists.neighbour_count // 2} edges)"


def build_adjacency(faces: NDArray[np.int32], vertex_count: int) -> Adjacency:
    """The vertex graph of a triangle set.

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
    bad = ((faces < 0) | (faces >= vertex_count)).any(axis=1)
    if bad.any():
        first = int(bad.argmax())
        raise MeshError(f"face {first} is {faces[first].tolist()}, but there are {vertex_count} vertices")
    graph = core.Handle("mt_graph_free")
    faces = np.ascontiguousarray(faces)
    core.call("mt_graph_new", faces, len(faces), vertex_count, byref(graph.pointer), argument_error=MeshError)
    return Adjacency(graph)


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
    products = np.empty(values.shape)
    columns = 1 if values.ndim == 1 else 3
    core.call("mt_graph_apply", adjacency.graph, np.ascontiguousarray(values), columns, products)
    return products


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
