"""Closest points on triangle meshes, and samples spread evenly over them.

A tree of boxes is built over a mesh once and then asked for many points (`closest_point_kernels`). Triangles without
area are as good as any, and a mesh without triangles is the set of its vertices. Building costs O(m log m) and about
150 bytes per triangle; a search O(log m).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec import closest_point_kernels as kernels
from meshtide_codec import surface_sample_kernels
from meshtide_codec.errors import MeshError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Points = NDArray[np.float64]

LARGEST_AXIS_BITS = 20  # of the curve that sorts the triangles


class SurfacePoints(NamedTuple):
    """Points on the triangles of a mesh.

    Attributes:
        points: (k, 3) float64.
        corners: (k, 3) int32, the vertices of the triangle that each point lies on.
        weights: (k, 3) float64, not negative and of sum 1: the point is the weighted sum of the corners.
    """

    points: Points
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
    >>> found.points.tolist(), found.weights.tolist()
    ([[0.25, 0.5, 0.0], [1.0, 0.0, 0.0]], [[0.25, 0.25, 0.5], [0.0, 1.0, 0.0]])
    """

    def __init__(self, vertices: Points, faces: NDArray[np.integer]) -> None:
        self.vertices, checked = _checked(vertices, faces)
        keys, order = _curve(self.vertices, checked)
        self.faces = np.ascontiguousarray(checked[order])
        self._links, self._boxes, self._beams = kernels.build_tree(self.vertices, self.faces, keys)

    @property
    def _tree(self) -> kernels.Tree:
        return self.vertices, self.faces, self._links, self._boxes, self._beams

    def closest(self, points: Points) -> SurfacePoints:
        """The closest point of the mesh for each of `points` (k, 3); faster when neighbours follow each other."""
        places = np.empty(len(points), np.int32)
        weights = np.empty((len(points), 3))
        kernels.closest(self._tree, _checked_points(points), places, weights)
        return self._surface_points(places, weights)

    def mean_and_largest(self, points: Points) -> tuple[float, float]:
        """Mean and maximum of the squared distances of `points` (k, 3), k >= 1, to the mesh.

        In a tangle of large triangles that all are near to every point, where searches are slow, only as many points
        are looked at, spread evenly over the list, as take reasonable time.
        """
        mean, largest = kernels.mean_and_largest(self._tree, _checked_points(points))
        return float(mean), float(largest)

    def used_vertices(self, limit: int) -> Points:
        """Vertices (k, 3) that the faces use, neighbours near each other; every j-th of them when they are too many.

        j is the smallest number that leaves no more than `limit`.
        """
        order = surface_sample_kernels.vertices_along(self.faces, len(self.vertices))
        stride = max(1, -(-len(order) // limit))
        return self.vertices[order[::stride]]

    def largest(self, points: Points, floor: float) -> float:
        """The largest of `floor` and the squared distances of `points` (k, 3): faster than to find each of them.

        In a tangle of large triangles fewer points are looked at, see `mean_and_largest`.
        """
        return float(kernels.largest_above(self._tree, _checked_points(points), floor))

    def visits_per_search(self, points: Points) -> float:
        """How many nodes of the tree a search visits on average: about 50 on surfaces, up to all of them in tangles."""
        return float(kernels.visits_per_search(self._tree, _checked_points(points)))

    def samples(self, count: int, seed: int) -> SurfacePoints:
        """`count` points on the mesh, evenly by area, neighbours near each other; the same for the same seed."""
        numbers = np.random.Generator(np.random.PCG64(seed)).random((3, count))
        places = np.empty(count, np.int32)
        weights = np.empty((count, 3))
        surface_sample_kernels.sample_triangles(self.vertices, self.faces, numbers, places, weights)
        return self._surface_points(places, weights)

    def _surface_points(self, places: NDArray[np.int32], weights: Points) -> SurfacePoints:
        corners = self.faces[places]
        points = np.empty(weights.shape)
        surface_sample_kernels.weighted_points(self.vertices, corners, weights, points)
        return SurfacePoints(points, corners, weights)


def _checked_points(points: Points) -> Points:
    checked = np.ascontiguousarray(points, np.float64)
    if checked.ndim != 2 or checked.shape[1] != 3:
        raise MeshError(f"points must be an array (k, 3), not of shape {checked.shape}")
    if not np.isfinite(checked).all():
        raise MeshError("points must be finite to have distances")
    return checked


def _checked(vertices: Points, faces: NDArray[np.integer]) -> tuple[Points, NDArray[np.int32]]:
    points = _checked_points(vertices)
    if len(points) == 0:
        raise MeshError("a mesh must have at least one point to be searched")
    if np.size(faces) == 0:
        return points, np.repeat(np.arange(len(points), dtype=np.int32), 3).reshape(-1, 3)
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise MeshError(f"faces must be an array (m, 3), not of shape {faces.shape}")
    if int(faces.min()) < 0 or int(faces.max()) >= len(points):
        bad = int(np.argmax(((faces < 0) | (faces >= len(points))).any(axis=1)))
        raise MeshError(f"face {bad} names a vertex outside of 0..{len(points) - 1}")
    return points, np.ascontiguousarray(faces, np.int32)


def _curve(vertices: Points, faces: NDArray[np.int32]) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
    """Keys of the faces along a Morton curve, sorted and all different, and the face of each."""
    index_bits = (len(faces) - 1).bit_length()
    axis_bits = min(LARGEST_AXIS_BITS, (64 - index_bits) // 3)
    keys: NDArray[np.uint64] = kernels.curve_keys(vertices, faces, axis_bits, index_bits)
    keys.sort()
    return keys, (keys & np.uint64((1 << index_bits) - 1)).astype(np.int64)
