"""Closest points on triangle meshes, and samples spread evenly over them.

A tree of boxes is built over a mesh once and then asked for many points (codec/core, surface/closest_points.hpp).
Triangles without area are as good as any, and a mesh without triangles is the set of its vertices. Building costs
O(m log m) and about 150 bytes per triangle; a search O(log m). Threads may share a tree.

The core multiplies four lengths, which would leave the range of doubles for coordinates near 1e100 or 1e-100. Such a
mesh is searched in another unit, a power of two, so that nothing is rounded by that.
"""

from __future__ import annotations

from ctypes import byref
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec import core
from meshtide_codec.errors import MeshError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Points = NDArray[np.float64]


LARGEST_EXPONENT = 100
"""Coordinates of a mesh from 2^-100 to 2^100 are searched as they are."""

LARGEST_REACH = 2.0**50
"""Times its own size that a point may be away from a mesh; the core looks no farther than 1e16 times."""


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


@dataclass(frozen=True, slots=True)
class Box:
    """The bounding box of points, by halves, which do not overflow.

    Attributes:
        half_centre: (3,), half of its centre.
        half_side: half of its longest side; 0 for a single place.
    """

    half_centre: Points
    half_side: float

    @classmethod
    def around(cls, points: Points) -> Box:
        """The box of points (n, 3), n >= 1."""
        low, high = points.min(axis=0) / 2, points.max(axis=0) / 2
        return cls(low / 2 + high / 2, float((high - low).max()))

    def reaches(self, points: Points) -> Points:
        """(k,), how far each of some points (k, 3) is from the centre, in sides; in units where there is no side."""
        with np.errstate(over="ignore"):
            farthest: Points = np.abs(points / 2 - self.half_centre).max(axis=1, initial=0.0)
            return farthest / (self.half_side or 0.5)


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
        self._tree = core.Handle("mt_tree_free")
        points = _checked_points(vertices)
        self._exponent = _unit_exponent(points)
        surface = lent_surface(_scaled(points, -self._exponent), faces)
        self._box = Box.around(surface.kept[0])
        core.call("mt_tree_new", byref(surface), byref(self._tree.pointer), argument_error=MeshError)

    def closest(self, points: Points) -> SurfacePoints:
        """The closest point of the mesh for each of `points` (k, 3); faster when neighbours follow each other.

        Raises:
            MeshError: the points are not finite, not of that form, or too far away.
        """
        with np.errstate(over="ignore"):
            wanted = _scaled(_checked_points(points), -self._exponent)
        reaches = self._box.reaches(wanted)
        if (reaches > LARGEST_REACH).any():
            bad = int(np.argmax(reaches))
            raise MeshError(
                f"point {bad} cannot be searched for: it is {reaches[bad]:.1e} times the size of the mesh away"
            )
        found = _room(len(wanted))
        core.call("mt_tree_closest", self._tree, wanted, len(wanted), byref(_lent_room(found)))
        return self._placed(found)

    def samples(self, count: int, seed: int) -> SurfacePoints:
        """`count` points on the mesh, evenly by area, neighbours near each other; the same for the same seed."""
        found = _room(count)
        core.call("mt_tree_sample", self._tree, seed, count, byref(_lent_room(found)))
        return self._placed(found)

    def _placed(self, found: SurfacePoints) -> SurfacePoints:
        """The same points in the unit of the mesh."""
        return found._replace(points=_scaled(found.points, self._exponent))


def lent_surface(vertices: Points, faces: NDArray[np.integer]) -> core.Surface:
    """The arrays as the core takes them.

    Raises:
        MeshError: they are not a mesh of finite vertices, of which there is at least one.
    """
    points = _checked_points(vertices)
    if len(points) == 0:
        raise MeshError("a mesh must have at least one point to be searched")
    if np.size(faces) == 0:
        return core.Surface.lent(points, np.zeros((0, 3), np.int32))
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise MeshError(f"faces must be an array (m, 3), not of shape {faces.shape}")
    if int(faces.min()) < 0 or int(faces.max()) >= len(points):
        bad = int(np.argmax(((faces < 0) | (faces >= len(points))).any(axis=1)))
        raise MeshError(f"face {bad} names a vertex outside of 0..{len(points) - 1}")
    return core.Surface.lent(points, np.ascontiguousarray(faces, np.int32))


def _unit_exponent(points: Points) -> int:
    """The power of two that is taken for the unit of a mesh; 0, its own, unless its coordinates are extreme."""
    largest = float(np.abs(points).max(initial=0.0))
    exponent = int(np.frexp(largest)[1])
    return 0 if largest == 0.0 or abs(exponent) <= LARGEST_EXPONENT else exponent


def _scaled(points: Points, exponent: int) -> Points:
    scaled: Points = points if exponent == 0 else np.ldexp(points, exponent)
    return scaled


def _room(count: int) -> SurfacePoints:
    return SurfacePoints(np.empty((count, 3)), np.empty((count, 3), np.int32), np.empty((count, 3)))


def _lent_room(room: SurfacePoints) -> core.Points:
    return core.Points(*(array.ctypes.data for array in room))


def _checked_points(points: Points) -> Points:
    checked = np.ascontiguousarray(points, np.float64)
    if checked.ndim != 2 or checked.shape[1] != 3:
        raise MeshError(f"points must be an array (k, 3), not of shape {checked.shape}")
    if not np.isfinite(checked).all():
        raise MeshError("points must be finite to have distances")
    return checked
