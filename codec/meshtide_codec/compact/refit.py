"""Refit of a simplified mesh: its vertices move until its surface is as close as it can be to the original's.

Gauss-Newton on the symmetric distance of the surfaces: points spread evenly over each are projected on the other;
each pair gives a plane, and the vertices take the least squares of the distances to the planes, held by weak springs.
These are the iterated closest points of Chen and Medioni, "Object modelling by registration of multiple range
images", Image and Vision Computing 10 (1992), for the vertices of a mesh instead of a rigid motion.
O(rounds (m + samples log m)).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.closest_points import TriangleTree
from meshtide_codec.compact import refit_kernels as kernels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.closest_points import SurfacePoints

    Points = NDArray[np.float64]
    Integers = NDArray[np.int32]

ROUNDS = 3
ROUNDING_ROUNDS = 2  # projections while vertices move on the grid
ROUNDING_PASSES = 20  # over all vertices, after each projection; most end earlier
SAMPLES_PER_VERTEX = 12  # of either surface; more of them make it no closer
FEWEST_SAMPLES = 2000
STIFFNESS = 0.005  # of the spring that holds a vertex, for each sample that falls to it
PASSES = 30  # of conjugate gradients, in each round
TOLERANCE = 1e-2  # of the gradient: the projection of the next round changes more than that
CLOSE = 1e-3  # grid steps between points whose difference is too short to have a direction
SEED = 1


class Refitter:
    """Fits the vertices of one simplified mesh to an original surface.

    Args:
        original: the surface to fit to, in grid steps.
        faces: (m, 3) int32 faces of the simplified mesh, at least one.
        vertex_count: its vertices.
    """

    def __init__(self, original: TriangleTree, faces: Integers, vertex_count: int) -> None:
        self._original = original
        self._faces = faces
        self._count = max(FEWEST_SAMPLES, SAMPLES_PER_VERTEX * vertex_count)
        self._stiffness = STIFFNESS * 2 * self._count / vertex_count
        self._samples = original.samples(self._count, SEED)

    def fitted(self, vertices: Points) -> Points:
        """The vertices (n, 3) after some rounds of projection and least squares."""
        for _ in range(ROUNDS):
            vertices = kernels.solve(self._rows(vertices), vertices, self._stiffness, PASSES, TOLERANCE)
        return vertices

    def rounded(self, vertices: Points, step: float, last: int) -> Integers:
        """The points (n, 3) of a grid, `step` apart from 0 to `last`, that put the surface closest to the original.

        A vertex may go to any point of the grid that is near: along the surface it costs little to move, and some
        point is always close to the surface. That is worth most of a bit per coordinate.
        """
        grid = np.clip(np.rint(vertices / step), 0, last).astype(np.int32)
        for _ in range(ROUNDING_ROUNDS):
            rows = self._rows(grid.astype(np.float64) * step)
            kernels.round_to_grid(rows, vertices, grid, step, last, self._stiffness, ROUNDING_PASSES)
        return grid

    def distance(self, vertices: Points) -> float:
        """Root mean square distance of the surfaces in grid steps, of the worse direction."""
        tree = TriangleTree(vertices, self._faces)
        forth, _ = tree.mean_and_largest(self._samples.points)
        back, _ = self._original.mean_and_largest(tree.samples(self._count, SEED + 1).points)
        return math.sqrt(max(forth, back))

    def _rows(self, vertices: Points) -> kernels.Rows:
        """The equations of the samples of both surfaces, linearized at the given vertices."""
        tree = TriangleTree(vertices, self._faces)
        there = tree.closest(self._samples.points)
        onto_original = _directions(self._samples.points - there.points, tree, there)
        here = tree.samples(self._count, SEED + 1)
        back = self._original.closest(here.points)
        from_original = _directions(here.points - back.points, self._original, back)
        return kernels.Rows(
            np.concatenate([there.corners, here.corners]),
            np.concatenate([there.weights, here.weights]),
            np.concatenate([onto_original, from_original]),
            np.concatenate([_along(onto_original, self._samples.points), _along(from_original, back.points)]),
        )


def _directions(differences: Points, tree: TriangleTree, feet: SurfacePoints) -> Points:
    """Unit vectors along differences (k, 3); where they are too short, normals of the triangles of their feet."""
    lengths = np.linalg.norm(differences, axis=1)
    a, b, c = (tree.vertices[feet.corners[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), CLOSE)[:, None]
    directions: Points = np.where(
        (lengths > CLOSE)[:, None], differences / np.maximum(lengths, CLOSE)[:, None], normals
    )
    return directions


def _along(directions: Points, points: Points) -> Points:
    products: Points = (directions * points).sum(axis=1)
    return products
