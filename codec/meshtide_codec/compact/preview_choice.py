"""Which previews open a stream: for each distance of a list the coarsest simplified mesh that is so close.

What a preview shows for its bytes differs from mesh to mesh: a machine part of flat faces is close with a hundred
vertices, a scan needs a thousand. So the simplified meshes of a ladder of ratios are fitted and measured until the
coarsest one within each distance is found, by bisection: a few fits, O(fits (m + samples log m)).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.closest_points import TriangleTree
from meshtide_codec.compact.previewing import GridPreview, encode_preview
from meshtide_codec.compact.previews import (
    FEWEST_PREVIEW_VERTICES,
    FEWEST_VERTICES,
    LARGEST_EXCESS,
    FittedMesh,
    Preview,
    can_be_searched,
    checked_faces,
    fitted_mesh,
    grid_bits,
    rounded_preview,
)
from meshtide_codec.compact.simplification import Simplifier
from meshtide_codec.quantize import grid_steps

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Points = NDArray[np.float64]
    Integers = NDArray[np.int32]

DISTANCES = (1e-2, 3e-3, 1e-3, 4e-4)
"""Root mean square distances to show early, in diagonals; beyond, the octree's levels are there about as soon."""

FINEST_RATIO = 18
STEP = 1.12
STEPS = 42
RATIOS = tuple(round(FINEST_RATIO * STEP**step) for step in range(STEPS, -1, -1))
"""Vertices of the mesh for one of a preview: steps of an eighth, as fine as the bytes of a preview matter."""

LARGE = 20_000
LARGE_RATIO = 40
"""Meshes of more than `LARGE` vertices have no preview finer than this: together at most 6 % of the stream."""
LAST_RATIO = 28
"""Nor has any mesh a preview finer than this for the last distance, which only shapes of flat faces reach so early."""

MARGIN = 0.98  # of a distance: what is measured with other samples differs by so much
SHARE_OF_FIT = 0.85  # of a distance: what the fit takes of it where the grid is as coarse as it should be
ROUNDING = 0.12  # root mean square distance that rounding adds, in steps of the preview's grid,
COARSE_ROUNDING = 0.15  # and on grids of `FEW_BITS`, where vertices meet and shapes get lost
LEAST_SHARE = 0.4  # of a distance that is left to the fit, however coarse the grid is
HOPELESS = 1.3  # distances by which a guess of the finest preview misses one that it is not tried for
FIRST_GUESS = 60  # vertices of the first mesh that is fitted
SLOPE = 0.85  # how fast distances grow with ratios, on logarithmic scales
FEW_BITS = 5
MORE_PLACES = 2
"""Previews of so few bits are tried with one more too, and at so many coarser places: fits of few vertices differ by
chance. Not those of meshes of more than `LARGE` vertices, for which it matters less and takes longer."""

SAMPLES = 4000
SEED = 3
TOO_SMALL_TO_WAIT = 40  # vertices of a preview, about 80 bytes, which needs no coarser one before it


def choose_previews(positions: Integers, faces: Integers, bits: int) -> list[Preview]:
    """Previews of a quantized mesh, coarsest first, chosen by their measured distance; none where none make sense.

    Args:
        positions: (n, 3) int32 in [0, 2^bits), pairwise different.
        faces: (m, 3) int32.
        bits: B, depth of the grid, 1 to 20.

    Raises:
        OptionError: `bits` is out of range.
        MeshError: positions or faces are not of that form.

    >>> choose_previews(np.zeros((1, 3), np.int32), np.zeros((0, 3), np.int32), bits=12)
    []
    """
    triangles = checked_faces(positions, faces, bits, [])
    if len(positions) < FEWEST_VERTICES or len(triangles) == 0:
        return []
    original = TriangleTree(positions.astype(np.float64), triangles)
    if not can_be_searched(original):
        return []
    candidates = _Candidates(original, positions, triangles, bits)
    diagonal = float(np.linalg.norm(np.ptp(positions, axis=0)))
    previews: list[Preview] = []
    place = 0
    reached = math.inf
    for wanted in DISTANCES:
        distance = MARGIN * wanted * diagonal
        finest_ratio = LARGE_RATIO if len(positions) > LARGE else FINEST_RATIO
        if wanted == DISTANCES[-1]:
            finest_ratio = max(finest_ratio, LAST_RATIO)
        found = None if reached <= distance else candidates.smallest_within(distance, place, finest_ratio)
        if found is not None:
            place, preview, reached = found
            previews.append(preview)
    return [
        preview
        for place, preview in enumerate(previews)
        if place + 1 == len(previews) or len(previews[place + 1].positions) > TOO_SMALL_TO_WAIT
    ]


class _Candidates:
    """The simplified meshes of all ratios, coarsest first; each is fitted and measured when it is asked for.

    Args:
        original: the surface.
        positions: (n, 3) int32 its vertices.
        triangles: (m, 3) int32 proper faces.
        bits: depth of the grid.
    """

    def __init__(self, original: TriangleTree, positions: Integers, triangles: Integers, bits: int) -> None:
        self._original = original
        self._bits = bits
        self._large = len(positions) > LARGE
        self._samples = original.samples(SAMPLES, SEED).points
        finest = LARGE_RATIO if self._large else FINEST_RATIO
        targets = {ratio: len(positions) // ratio for ratio in RATIOS if ratio >= finest}
        targets = {ratio: target for ratio, target in targets.items() if target >= FEWEST_PREVIEW_VERTICES}
        simplifier = Simplifier(positions, triangles, bits, max(targets.values()))
        self._meshes: list[tuple[int, Points, Integers]] = []
        for ratio, target in sorted(targets.items()):
            vertices, faces = simplifier.reduced_to(target)
            if len(faces) == 0 or len(vertices) > LARGEST_EXCESS * target:
                break
            self._meshes.insert(0, (ratio, vertices, faces))
        self._fits: dict[int, FittedMesh | None] = {}
        self._rounded: dict[tuple[int, int], tuple[Preview | None, float]] = {}

    def smallest_within(self, distance: float, first: int, finest_ratio: int) -> tuple[int, Preview, float] | None:
        """The smallest preview within `distance` grid steps, its place and its distance; None if there is none.

        Args:
            distance: in grid steps.
            first: the coarsest place to look at.
            finest_ratio: no place of a ratio below this is looked at.
        """
        bits = grid_bits(SHARE_OF_FIT * distance, self._bits)
        thorough = bits <= FEW_BITS and not self._large
        found: list[tuple[int, Preview, float]] = []
        for depth in (bits, min(bits + 1, self._bits)):
            place = self._coarsest_within(distance, depth, first, finest_ratio)
            if place is None:
                continue
            coarser = range(max(place - MORE_PLACES, first), place) if thorough else range(0)
            for near in (place, *coarser):
                preview, far = self._measured(near, depth, distance)
                if preview is not None and far <= distance:
                    found.append((near, preview, far))
            if not thorough:
                break
        return min(found, key=lambda one: _size(one[1]), default=None)

    def _coarsest_within(self, distance: float, bits: int, first: int, finest_ratio: int) -> int | None:
        """The coarsest place from `first` on whose preview of so many bits is within a distance, None if none is."""
        end = sum(mesh[0] >= finest_ratio for mesh in self._meshes)
        low, high = first, end
        if any(self._fits.values()) and self._guess(HOPELESS * distance, bits) >= end:
            return None
        while low < high:
            guess = self._guess(distance, bits)
            if high < end and guess >= high:
                return high  # what is at `high` is within the distance, and nothing coarser is expected to be
            place = min(max(guess, low), high - 1)
            if self._measured(place, bits, distance)[1] <= distance:
                high = place
            else:
                low = place + 1
        return low if low < end else None

    def _guess(self, distance: float, bits: int) -> int:
        """The coarsest place whose preview may be within `distance`: by the fit that is nearest to it.

        The distance of a fit falls as its vertices rise; what rounding adds to its square does not.
        """
        rounding = (ROUNDING if bits > FEW_BITS else COARSE_ROUNDING) * grid_steps(self._bits) / grid_steps(bits)
        wanted = math.sqrt(max(distance**2 - rounding**2, (LEAST_SHARE * distance) ** 2))
        known = sorted(
            (abs(math.log(wanted / fit.distance)), math.log(fit.distance), math.log(self._meshes[place][0]))
            for place, fit in self._fits.items()
            if fit is not None and fit.distance > 0.0
        )
        if not known:
            return sum(len(mesh[1]) < FIRST_GUESS for mesh in self._meshes)
        _, log_distance, log_ratio = known[0]
        slopes = ((log_distance - far) / (log_ratio - other) for _, far, other in known if abs(log_ratio - other) > 0.5)
        slope = min(max(next(slopes, SLOPE), SLOPE / 2), 2 * SLOPE)
        ratio = math.exp(log_ratio + (math.log(wanted) - log_distance) / slope)
        return sum(mesh[0] > ratio for mesh in self._meshes)

    def _measured(self, place: int, bits: int, wanted: float) -> tuple[Preview | None, float]:
        """The preview at a place on a grid of `bits` bits and its distance in grid steps of the mesh.

        None, and infinity, if it shows no more than an octree level of as many vertices, or the fit alone is farther
        than `wanted`.
        """
        if place not in self._fits:
            _, vertices, faces = self._meshes[place]
            self._fits[place] = fitted_mesh(self._original, vertices, faces, self._bits)
        fit = self._fits[place]
        if fit is None or fit.distance > wanted:
            return None, math.inf
        if (place, bits) not in self._rounded:
            preview = rounded_preview(fit, self._bits, bits, self._meshes[place][0])
            self._rounded[place, bits] = preview, math.inf if preview is None else self._distance(preview)
        return self._rounded[place, bits]

    def _distance(self, preview: Preview) -> float:
        """Root mean square distance in grid steps, of the worse direction."""
        tree = TriangleTree(preview.vertices(self._bits), preview.faces)
        forth, _ = tree.mean_and_largest(self._samples)
        back, _ = self._original.mean_and_largest(tree.samples(SAMPLES, SEED + 1).points)
        return math.sqrt(max(forth, back))


def _size(preview: Preview) -> int:
    """Bytes of its packet."""
    return len(encode_preview(GridPreview(preview.bits, preview.positions, preview.faces)))
