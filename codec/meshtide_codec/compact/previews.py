"""Previews: a few small meshes that open a stream, each as close to the original as its bytes allow.

The mesh is simplified (`simplification`), its vertices are fitted to the original surface (`refit`), then rounded to
a coarse grid over the same cube, with the fit going on among the grid's points. A preview is coded like any mesh, on
its own: 15 to 23 bits for each of its vertices on surfaces, 30 on meshes of many parts. What it shows is measured by
the encoder like any level.

Vertices and bits go together: one more bit per coordinate lengthens a preview by a sixth, as a sixth more vertices
do, which bring the surface closer by as much. Measured on scans and machine parts, that much is lost to rounding
where a step of the grid is about six times the root mean square distance of the fit, so the grid is the coarsest
whose step is no longer than that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec.closest_points import TriangleTree
from meshtide_codec.compact.octree import check_grid_mesh
from meshtide_codec.compact.refit import Refitter
from meshtide_codec.compact.simplification import Simplifier
from meshtide_codec.errors import OptionError
from meshtide_codec.mesh import canonical_faces
from meshtide_codec.quantize import LARGEST_B, grid_steps, morton_codes

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    Points = NDArray[np.float64]
    Integers = NDArray[np.int32]

DEFAULT_RATIOS = (256, 40)
"""Vertices of the mesh for one of a preview: together about 4 % of a stream of 12 bits per vertex. The finer one shows
scans at less than 1e-3 of their diagonal, which the octree reaches ten times later."""

FEWEST_VERTICES = 2000
"""Meshes of fewer vertices have no previews: their levels take no longer to arrive."""

FEWEST_PREVIEW_VERTICES = 8
FEWEST_BITS = 4
TANGLED = 250  # nodes of the search tree visited for a point: a surface takes about 50, a fan of 20 000 slivers 160
STEP_PER_DISTANCE = 6.5  # longest step of a preview's grid, in root mean square distances of the fit
LARGEST_EXCESS = 1.5  # vertices of a preview against those wanted: some meshes cannot be simplified that far
OCTREE_DISTANCE = 0.35  # root mean square distance that an octree level shows, in sides of its cells


class Preview(NamedTuple):
    """A small mesh on a coarse grid over the same cube as the original.

    Attributes:
        positions: (k, 3) int32 in [0, 2^bits), pairwise different, in Morton order.
        faces: (j, 3) int32 in canonical form; every vertex is in use.
        bits: depth of the grid; `dequantize(positions, bits, origin, extent)` with the original's cube places it.
        ratio: the ratio that it was made for.
    """

    positions: Integers
    faces: Integers
    bits: int
    ratio: int

    def vertices(self, bits: int) -> Points:
        """(k, 3) float64 positions in the steps of the original's grid of depth `bits`."""
        return self.positions.astype(np.float64) * (grid_steps(bits) / grid_steps(self.bits))


def make_previews(
    positions: Integers, faces: Integers, bits: int, ratios: Iterable[int] = DEFAULT_RATIOS
) -> list[Preview]:
    """Previews of a quantized mesh, coarsest first, each of about 1/ratio of its vertices.

    There are fewer than ratios, or none, where previews make no sense: the mesh is small, has no faces, cannot be
    simplified so far, or falls apart when it is. The same arguments give the same previews.

    Args:
        positions: (n, 3) int32 in [0, 2^bits), pairwise different.
        faces: (m, 3) int32.
        bits: B, depth of the grid, 1 to 20.
        ratios: vertices of the mesh for one of each preview, in any order, 2 or more.

    Raises:
        OptionError: a ratio or `bits` is out of range.
        MeshError: positions or faces are not of that form.

    >>> make_previews(np.zeros((1, 3), np.int32), np.zeros((0, 3), np.int32), bits=12)
    []
    """
    wanted = sorted(set(ratios))
    triangles = checked_faces(positions, faces, bits, wanted)
    targets = {ratio: len(positions) // ratio for ratio in wanted}
    targets = {ratio: target for ratio, target in targets.items() if target >= FEWEST_PREVIEW_VERTICES}
    if len(positions) < FEWEST_VERTICES or len(triangles) == 0 or not targets:
        return []
    original = TriangleTree(positions.astype(np.float64), triangles)
    if not can_be_searched(original):
        return []
    simplifier = Simplifier(positions, triangles, bits, max(targets.values()))
    previews: list[Preview] = []
    for ratio, target in targets.items():
        vertices, coarse_faces = simplifier.reduced_to(target)
        if len(coarse_faces) == 0 or len(vertices) > LARGEST_EXCESS * target:
            break
        fitted = fitted_mesh(original, vertices, coarse_faces, bits)
        if fitted is None:
            continue
        preview = rounded_preview(fitted, bits, grid_bits(fitted.distance, bits), ratio)
        previews += [] if preview is None else [preview]
    return previews[::-1]


def can_be_searched(original: TriangleTree) -> bool:
    """Whether searches on a surface take reasonable time: a tangle of large triangles has no previews."""
    return original.visits_per_search(original.samples(1000, seed=0).points) <= TANGLED


def checked_faces(positions: Integers, faces: Integers, bits: int, ratios: list[int]) -> Integers:
    """The faces (m, 3) of three different corners.

    Raises:
        OptionError: one of the ascending `ratios` or `bits` is out of range.
        MeshError: positions or faces are not those of a mesh on the grid.
    """
    if not 1 <= bits <= LARGEST_B:
        raise OptionError(f"the grid's depth must be 1 to {LARGEST_B}, not {bits}")
    if ratios and ratios[0] < 2:
        raise OptionError(f"a preview must have fewer vertices than the mesh: ratio {ratios[0]} is less than 2")
    check_grid_mesh(positions, faces, bits)
    triangles: Integers = np.ascontiguousarray(faces, np.int32)
    a, b, c = triangles.T
    proper: Integers = triangles[(a != b) & (b != c) & (c != a)]
    return proper


class FittedMesh(NamedTuple):
    """A simplified mesh whose vertices have been moved to the original surface.

    Attributes:
        refitter: what moved them.
        vertices: (k, 3) in the original's grid steps.
        faces: (j, 3) int32.
        distance: root mean square distance from the original in grid steps, of the worse direction.
    """

    refitter: Refitter
    vertices: Points
    faces: Integers
    distance: float


def fitted_mesh(original: TriangleTree, vertices: Points, faces: Integers, bits: int) -> FittedMesh | None:
    """The simplified mesh fitted, or None when an octree level of as many vertices shows no less."""
    refitter = Refitter(original, faces, len(vertices))
    fitted = refitter.fitted(vertices)
    distance = refitter.distance(fitted)
    if distance > OCTREE_DISTANCE * _cell_side(original.vertices, bits, len(vertices)):
        return None
    return FittedMesh(refitter, fitted, faces, distance)


def rounded_preview(mesh: FittedMesh, bits: int, preview_bits: int, ratio: int) -> Preview | None:
    """A fitted mesh on a grid of depth `preview_bits`, or None when no face is left of it.

    Args:
        mesh: in steps of the grid of depth `bits`.
        bits: B.
        preview_bits: depth of the preview's grid.
        ratio: what it was made for.
    """
    step = grid_steps(bits) / grid_steps(preview_bits)
    welded, welded_faces = _welded(mesh.refitter.rounded(mesh.vertices, step, grid_steps(preview_bits)), mesh.faces)
    return Preview(welded, welded_faces, preview_bits, ratio) if len(welded_faces) else None


def grid_bits(distance: float, bits: int) -> int:
    """Depth of the coarsest grid that suits a preview whose fit is `distance` steps of the grid of depth `bits` away.

    >>> grid_bits(5.3, 12), grid_bits(17.4, 12), grid_bits(0.0, 12)
    (7, 6, 12)
    """
    for depth in range(FEWEST_BITS, bits):
        if grid_steps(bits) / grid_steps(depth) <= STEP_PER_DISTANCE * distance:
            return depth
    return bits


def _cell_side(positions: Points, bits: int, count: int) -> float:
    """Side of the cells, in grid steps, of the octree's first level of at least `count` cells."""
    codes = np.sort(morton_codes(positions.astype(np.int64)))
    for depth in range(bits):
        prefixes = codes >> np.uint64(3 * (bits - depth))
        if np.count_nonzero(prefixes[1:] != prefixes[:-1]) + 1 >= count:
            return float(1 << (bits - depth))
    return 1.0


def _welded(grid: Integers, faces: Integers) -> tuple[Integers, Integers]:
    """Vertices on the grid in Morton order, those that meet made one, those without faces left out."""
    _, first, owners = np.unique(morton_codes(grid), return_index=True, return_inverse=True)
    welded = canonical_faces(owners[faces].astype(np.int32))
    used, renumbered = np.unique(welded, return_inverse=True)
    positions = np.ascontiguousarray(grid[first][used], np.int32)
    return positions, renumbered.reshape(-1, 3).astype(np.int32)
