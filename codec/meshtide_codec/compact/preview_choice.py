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
from meshtide_codec.compact.previews import (
    FEWEST_PREVIEW_VERTICES,
    FEWEST_VERTICES,
    LARGEST_EXCESS,
    Preview,
    can_be_searched,
    checked_faces,
    fitted_preview,
)
from meshtide_codec.compact.simplification import Simplifier

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Points = NDArray[np.float64]
    Integers = NDArray[np.int32]

DISTANCES = (1e-2, 3e-3, 1e-3)
"""Root mean square distances to show early, in diagonals; beyond, the octree's levels are there about as soon."""

RATIOS = (512, 400, 320, 256, 205, 164, 131, 105, 84, 67, 54, 43, 34, 27, 22, 18)
"""Vertices of the mesh for one of a preview: steps of a quarter, as fine as the bytes of a preview matter."""

LARGE = 20_000
LARGE_RATIO = 40
"""Meshes of more than `LARGE` vertices have no preview finer than this: together at most 6 % of the stream."""

MARGIN = 0.97  # of a distance: what is measured with other samples differs by so much
CLOSE_ENOUGH = 0.85  # of a distance: the preview of the next ratio would be beyond it
SAMPLES = 4000
SEED = 3
TOO_SMALL_TO_WAIT = 150  # vertices of a preview, about 300 bytes, which needs no coarser one before it


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
    places: list[int] = []
    for distance in DISTANCES:
        place = candidates.coarsest_within(MARGIN * distance * diagonal, places[-1] if places else 0)
        if place is not None and place not in places:
            places.append(place)
    chosen = [candidates.preview(place) for place in places]
    previews = [preview for preview in chosen if preview is not None]
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
        self._samples = original.samples(SAMPLES, SEED).points
        finest = LARGE_RATIO if len(positions) > LARGE else 2
        targets = {ratio: len(positions) // ratio for ratio in RATIOS if ratio >= finest}
        targets = {ratio: target for ratio, target in targets.items() if target >= FEWEST_PREVIEW_VERTICES}
        simplifier = Simplifier(positions, triangles, bits, max(targets.values()))
        self._meshes: list[tuple[int, Points, Integers]] = []
        for ratio, target in sorted(targets.items()):
            vertices, faces = simplifier.reduced_to(target)
            if len(faces) == 0 or len(vertices) > LARGEST_EXCESS * target:
                break
            self._meshes.insert(0, (ratio, vertices, faces))
        self._fitted: dict[int, tuple[Preview | None, float]] = {}

    def coarsest_within(self, distance: float, first: int) -> int | None:
        """The coarsest place from `first` on whose preview is within `distance` grid steps, None if none is."""
        low, high = first, len(self._meshes)
        while low < high:
            place = min(max(self._guess(distance), low), high - 1)
            far = self._measured(place)[1]
            if CLOSE_ENOUGH * distance <= far <= distance:
                return place
            if far <= distance:
                high = place
            else:
                low = place + 1
        return low if low < len(self._meshes) else None

    def _guess(self, distance: float) -> int:
        """Where a preview may be within `distance`, which falls as vertices rise: from the nearest one measured."""
        known = [
            (abs(math.log(distance / far)), place, far)
            for place, (_, far) in self._fitted.items()
            if 0 < far < math.inf
        ]
        if not known:
            return len(self._meshes) // 2
        _, nearest, far = min(known)
        ratio = self._meshes[nearest][0] * distance / far
        return sum(mesh[0] > ratio for mesh in self._meshes)

    def preview(self, place: int) -> Preview | None:
        """The preview at a place, None if it shows no more than an octree level of as many vertices."""
        return self._measured(place)[0]

    def _measured(self, place: int) -> tuple[Preview | None, float]:
        if place not in self._fitted:
            ratio, vertices, faces = self._meshes[place]
            preview = fitted_preview(self._original, vertices, faces, self._bits, ratio)
            self._fitted[place] = (preview, math.inf if preview is None else self._distance(preview))
        return self._fitted[place]

    def _distance(self, preview: Preview) -> float:
        """Root mean square distance in grid steps, of the worse direction."""
        tree = TriangleTree(preview.vertices(self._bits), preview.faces)
        forth, _ = tree.mean_and_largest(self._samples)
        back, _ = self._original.mean_and_largest(tree.samples(SAMPLES, SEED + 1).points)
        return math.sqrt(max(forth, back))
