"""Seeds and leftovers: faces without a known neighbour, corner by corner (docs/format.md, section 9.8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import MapConnError
from meshtide_codec.reference.faces_candidates import CAPACITY, EVERYTHING, NOBODY, SIBLING, Candidate, Gathering
from meshtide_codec.reference.faces_choices import AT_CORNER, LEFTOVER, LISTED
from meshtide_codec.reference.faces_mesh import Marks
from meshtide_codec.reference.faces_scores import FULL_WEIGHT

if TYPE_CHECKING:
    from meshtide_codec.reference.faces_growth import Growth


class SpeltFaces:
    """Goes over the coarse faces for seeds, and over the vertices for leftovers."""

    def __init__(self, growth: Growth) -> None:
        self._growth = growth
        self._coarse_face = 0
        self._vertex = 0

    def decode_seed(self) -> bool:
        """Add a face above the next coarse face that lacks one; False when none does."""
        coarse = self._growth.coarse
        while self._coarse_face < len(coarse.faces) and coarse.covered[self._coarse_face]:
            self._coarse_face += 1
        if self._coarse_face == len(coarse.faces):
            return False
        corners: list[int] = []
        for parent in coarse.faces[self._coarse_face]:
            corners.append(self._child(parent, corners))
        self._growth.add_anywhere(*corners)
        return True

    def decode_leftover(self) -> bool:
        """Add the next face that nothing else has reached; False when vertices run out."""
        coarse, fine = self._growth.coarse, self._growth.fine
        while self._vertex < len(coarse.parents):
            if coarse.split[coarse.parents[self._vertex]]:
                faces = min(len(fine.leaving[self._vertex]), 3)
                if self._growth.choices.adaptive_bit(LEFTOVER + faces * 2 + fine.at_border[self._vertex]):
                    second = self._other_corner([self._vertex])
                    third = self._other_corner([self._vertex, second])
                    self._growth.add_anywhere(self._vertex, second, third)
                    return True
            self._vertex += 1
        return False

    def _child(self, parent: int, corners: list[int]) -> int:
        """Which child of a coarse vertex is the next corner."""
        children = self._growth.coarse.children[parent]
        if len(children) > CAPACITY:
            place = self._growth.choices.decoder.raw_bits((len(children) - 1).bit_length())
            if place >= len(children):
                raise MapConnError("a face names a vertex outside of its family; the stream is damaged")
            return children[place]
        return self._listed([Candidate(child, SIBLING) for child in children], corners)

    def _other_corner(self, corners: list[int]) -> int:
        """The next corner of a leftover face: from the list around the corners, or by its distance from the first."""
        growth = self._growth
        ends = (corners[0], corners[-1], NOBODY)
        candidates = Gathering(growth.coarse, growth.fine, ends, Marks(), EVERYTHING).candidates
        if growth.choices.adaptive_bit(LISTED + len(corners) - 1):
            return self._listed(candidates, corners)
        vertex = corners[0] + growth.choices.offset()
        if not 0 <= vertex < len(growth.coarse.parents):
            raise MapConnError("a face names a vertex outside of the level; the stream is damaged")
        return vertex

    def _listed(self, candidates: list[Candidate], corners: list[int]) -> int:
        """Which vertex of the list is the next corner: the nearer to the corners so far the likelier."""
        if not candidates:
            raise MapConnError("a face names a candidate of an empty list; the stream is damaged")
        distances = [self._distance(candidate.vertex, corners) for candidate in candidates]
        nearest = min(distances)
        for candidate, distance in zip(candidates, distances, strict=True):
            candidate.weight = int(FULL_WEIGHT * nearest / distance)
        best = max(candidates, key=lambda candidate: candidate.weight)
        total = sum(candidate.weight for candidate in candidates)
        return self._growth.choices.choose(AT_CORNER, candidates, best, total).vertex

    def _distance(self, vertex: int, corners: list[int]) -> float:
        """How far a vertex is from the corners, at least 1; without positions by the order of vertices."""
        fine = self._growth.fine
        distance = 1.0
        for corner in corners:
            distance += fine.shapes.squared(corner, vertex) if fine.shapes else abs(float(corner - vertex))
        if fine.leaving[vertex] and fine.shapes is None:
            distance *= 2.0
        return distance
