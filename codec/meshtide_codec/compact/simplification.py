"""Simplified versions of a mesh, for previews: clusters on a grid, then edges collapsed in the order of quadric error.

Vertices are first clustered in the cells of the octree's depth that has enough of them, each cluster with the sum of
its vertices' quadrics (Lindstrom, "Out-of-core simplification of large polygonal models", SIGGRAPH 2000): far cheaper
than to collapse them one by one, and no worse when ten times as many are left as are wanted in the end. The rest is
`simplification_kernels`. O((n + m) log m).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact import simplification_kernels as kernels
from meshtide_codec.compact.quadric_kernels import QUADRIC_SIZE, settle, sum_quadrics
from meshtide_codec.mesh import canonical_faces
from meshtide_codec.quantize import morton_codes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Points = NDArray[np.float64]
    Integers = NDArray[np.int32]

CLUSTERS_PER_VERTEX = 10  # before the first collapse, for each vertex of the finest simplified mesh
FEWEST_CLUSTERS = 3000  # before the first collapse: it is quick from there, and details of small meshes are not lost
HEAP_PER_EDGE = 2  # entries, outdated ones included


class Simplifier:
    """A mesh that gets coarser from call to call.

    Args:
        positions: (n, 3) int32 in [0, 2^bits), pairwise different.
        faces: (m, 3) int32 with indices in range, three different corners each.
        bits: depth of the grid.
        finest_target: vertices of the finest mesh that will be asked for.
    """

    def __init__(self, positions: Integers, faces: Integers, bits: int, finest_target: int) -> None:
        owners = _clusters(positions, bits, max(FEWEST_CLUSTERS, CLUSTERS_PER_VERTEX * finest_target))
        count = int(owners.max()) + 1
        vertices = positions.astype(np.float64)
        borders = _borders(faces, len(positions))
        quadrics = np.zeros((count, QUADRIC_SIZE))
        sum_quadrics(vertices, faces, borders, owners, quadrics)
        middles = _means(vertices, owners, count)
        if count < len(positions):
            settle(quadrics, middles)
        clustered = canonical_faces(owners[faces])
        keys = np.sort(_edge_keys(clustered, count))
        keys = keys[np.r_[True, keys[1:] != keys[:-1]]] if len(keys) else keys
        edges = np.stack([keys // count, keys % count], axis=1).astype(np.int32)
        heap = HEAP_PER_EDGE * len(edges) + 1
        self._mesh = kernels.Simplification(
            positions=middles,
            faces=clustered,
            alive=np.ones(len(clustered), np.bool_),
            quadrics=quadrics,
            first=np.empty(count, np.int32),
            last=np.empty(count, np.int32),
            following=np.empty(3 * len(clustered), np.int32),
            versions=np.empty(count, np.int32),
            marks=np.zeros(count, np.int64),
            costs=np.empty(heap),
            entries=np.empty((heap, 4), np.int32),
            sum_of_two=np.empty(QUADRIC_SIZE),
            progress=np.zeros(kernels.PROGRESS_SIZE, np.int64),
        )
        kernels.prepare(self._mesh, edges)

    def reduced_to(self, target: int) -> tuple[Points, Integers]:
        """Vertices (k, 3) and faces (j, 3) of the mesh simplified to `target` vertices, or as near as it goes."""
        kernels.simplify(self._mesh, target)
        faces = self._mesh.faces[self._mesh.alive]
        used, renumbered = np.unique(faces, return_inverse=True)
        return self._mesh.positions[used], canonical_faces(renumbered.reshape(-1, 3).astype(np.int32))


def _clusters(positions: Integers, bits: int, fewest: int) -> Integers:
    """(n,) the cluster of each vertex: cells of the smallest depth that has at least `fewest` of them, in order."""
    codes = morton_codes(positions)
    sorted_codes = np.sort(codes)
    for depth in range(bits):
        shift = np.uint64(3 * (bits - depth))
        prefixes = sorted_codes >> shift
        if np.count_nonzero(prefixes[1:] != prefixes[:-1]) + 1 >= fewest:
            owners: Integers = np.unique(codes >> shift, return_inverse=True)[1].astype(np.int32)
            return owners
    return np.arange(len(positions), dtype=np.int32)


def _means(vertices: Points, owners: Integers, count: int) -> Points:
    """(count, 3) mean position of each cluster."""
    sizes = np.bincount(owners, minlength=count)
    return np.stack([np.bincount(owners, vertices[:, axis], count) / sizes for axis in range(3)], axis=1)


def _edge_keys(faces: Integers, count: int) -> NDArray[np.int64]:
    """(3 m,) a number for the edge from each corner to the next: the same for the same two ends."""
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    keys: NDArray[np.int64] = np.minimum(starts, ends).astype(np.int64) * count + np.maximum(starts, ends)
    return keys


def _borders(faces: Integers, count: int) -> Integers:
    """The corners (3 face + corner) where a border edge begins: one that has a single face."""
    keys = _edge_keys(faces, count)
    order = np.argsort(keys, kind="stable")
    repeated = np.diff(keys[order]) == 0
    single = np.ones(len(keys), bool)
    single[1:] &= ~repeated
    single[:-1] &= ~repeated
    return order[single].astype(np.int32)
