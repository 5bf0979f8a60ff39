"""Closest points on triangle meshes, and samples spread evenly over them.

A tree of boxes is built over a mesh once and then asked for many points (`closest_point_kernels`). Triangles without
area are as good as any, and a mesh without triangles is the set of its vertices. Building costs O(m log m) and about
100 bytes per triangle; a search O(log m).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec import closest_point_kernels as kernels
from meshtide_codec.errors import MeshError
from meshtide_codec.graph_kernels import NO_BAD_FACE, first_bad_face

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Points = NDArray[np.float64]

LARGEST_AXIS_BITS = 20  # of the curve that sorts the triangles


class ClosestPoints(NamedTuple):
    """What a search found for k points.

    Attributes:
        squared_distances: (k,) float64.
        corners: (k, 3) int32, the vertices of the triangle that each closest point lies on.
        weights: (k, 3) float64, not negative and of sum 1: the closest point is the weighted sum of the corners.
    """

    squared_distances: Points
    corners: NDArray[np.int32]
    weights: Points


class TriangleTree:
    """A mesh made ready for closest-point searches.

    Args:
        vertices: (n, 3) float64, finite, n >= 1.
        faces: (m, 3) integers; none at all stand for the vertices themselves.

    Raises:
        MeshError: the arrays are not of that form.

    >>> tree = TriangleTree(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    >>> found = tree.closest(np.array([[0.25, 0.5, 2.0], [2.0, 0.0, 0.0]]))
    >>> found.squared_distances.tolist(), found.weights.tolist()
    ([4.0, 1.0], [[0.25, 0.25, 0.5], [0.0, 1.0, 0.0]])
    """

    def __init__(self, vertices: Points, faces: NDArray[np.integer]) -> None:
        self.vertices, checked = _checked(vertices, faces)
        self.faces = _along_curve(self.vertices, checked)
        self._boxes = kernels.build_boxes(self.vertices, self.faces)

    @property
    def _tree(self) -> kernels.Tree:
        return self.vertices, self.faces, self._boxes

    def closest(self, points: Points) -> ClosestPoints:
        """The closest point of the mesh for each of `points` (k, 3); faster when neighbours follow each other."""
        squared_distances = np.empty(len(points))
        places = np.empty(len(points), np.int32)
        weights = np.empty((len(points), 3))
        kernels.closest(self._tree, np.ascontiguousarray(points, np.float64), squared_distances, places, weights)
        return ClosestPoints(squared_distances, self.faces[places], weights)

    def total_and_largest(self, points: Points) -> tuple[float, float]:
        """Sum and maximum of the squared distances of `points` (k, 3) to the mesh."""
        total, largest = kernels.total_and_largest(self._tree, np.ascontiguousarray(points, np.float64))
        return float(total), float(largest)

    def used_vertices(self, limit: int) -> Points:
        """Vertices (k, 3) that the faces use, neighbours near each other; every j-th of them when they are too many.

        j is the smallest number that leaves no more than `limit`.
        """
        order = kernels.vertices_along(self.faces, len(self.vertices))
        stride = max(1, -(-len(order) // limit))
        return self.vertices[order[::stride]]

    def largest(self, points: Points, floor: float) -> float:
        """The largest of `floor` and the squared distances of `points` (k, 3): faster than to find each of them."""
        return float(kernels.largest_above(self._tree, np.ascontiguousarray(points, np.float64), floor))

    def samples(self, count: int, seed: int) -> Points:
        """Points (count, 3) on the mesh, evenly by area, neighbours near each other; the same for the same seed."""
        numbers = np.random.Generator(np.random.PCG64(seed)).random((3, count))
        points: Points = kernels.sample_triangles(self.vertices, self.faces, numbers)
        return points


def _checked(vertices: Points, faces: NDArray[np.integer]) -> tuple[Points, NDArray[np.int32]]:
    points = np.ascontiguousarray(vertices, np.float64)
    triangles = np.ascontiguousarray(faces, np.int32)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise MeshError(f"vertices must be an array (n, 3) of at least one point, not of shape {points.shape}")
    if not np.isfinite(points).all():
        raise MeshError("vertices must be finite to have distances")
    if triangles.size == 0:
        return points, np.repeat(np.arange(len(points), dtype=np.int32), 3).reshape(-1, 3)
    if triangles.ndim != 2 or triangles.shape[1] != 3:
        raise MeshError(f"faces must be an array (m, 3), not of shape {triangles.shape}")
    bad = first_bad_face(triangles, len(points))
    if bad != NO_BAD_FACE:
        raise MeshError(f"face {bad} names a vertex outside of 0..{len(points) - 1}")
    return points, triangles


def _along_curve(vertices: Points, faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """The faces sorted along a Morton curve, in an order that does not depend on the sorting algorithm."""
    index_bits = (len(faces) - 1).bit_length()
    keys = kernels.curve_keys(vertices, faces, min(LARGEST_AXIS_BITS, (64 - index_bits) // 3), index_bits)
    keys.sort()
    return np.ascontiguousarray(faces[(keys & np.uint64((1 << index_bits) - 1)).astype(np.int64)])
