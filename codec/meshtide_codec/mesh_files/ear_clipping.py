"""Ears cut off a polygon one by one, for the outlines that mapbox earcut cuts wrongly.

An ear is a corner that turns left and whose triangle holds no other corner; every polygon that does not cross itself
has two (G. Meisters, "Polygons have ears", 1975). On which side of a line a corner lies is known exactly: by floats
where the product is larger than what rounding may do to it, else by whole numbers (J. Shewchuk, "Adaptive precision
floating-point arithmetic and fast robust geometric predicates", 1997, for the bound). Corners in one place, as a slit
to a hole has them, are told apart by where the outline goes on from there. Cost: O(n^2), bounded by `Work`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_CORNERS = 1 << 12
"""Of an outline that is cut here: of larger ones the square is too much."""
_BOUND = (3 + 16 * 2.0**-53) * 2.0**-53
"""What rounding may do to the difference of two products, as a part of their sum."""
_TINY = 1e-300
_CALL = 1 << 12
_STRICT, _TOUCHING, _ANY = range(3)
"""No other corner may be in the triangle or on its border; on the outline's edges; on the cut as well."""


@dataclass(slots=True)
class Work:
    """How much may still be done for the polygons of a file, and what came of it.

    Args:
        left: looks at single corners; a look costs some nanoseconds, and each round of them as much as some thousands.
        crossed: polygons that cross themselves, so that their triangles overlap.
    """

    left: int = 1 << 29
    crossed: int = 0


def clipped(outline: NDArray[np.float64], work: Work) -> list[list[int]] | None:
    """The triangles (n - 2) of a polygon (n, 2) that turns left; None if it crosses itself or is too much work.

    >>> square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    >>> clipped(square, Work())
    [[0, 1, 3], [1, 2, 3]]
    """
    if len(outline) > MOST_CORNERS:
        return None
    return _Clipping(outline, work).triangles()


class _Clipping:
    """A polygon of which ears are cut off."""

    def __init__(self, outline: NDArray[np.float64], work: Work) -> None:
        self._points = outline
        self._work = work
        self._exact: list[tuple[int, int]] = []
        self._ring = np.arange(len(outline))
        self._refused: set[tuple[int, int, int]] = set()

    def triangles(self) -> list[list[int]] | None:
        found: list[list[int]] = []
        place, level, misses, stale = 0, _STRICT, 0, False
        while len(self._ring) > 3:
            place %= len(self._ring)
            a, b, c = (int(self._ring[(place + step) % len(self._ring)]) for step in (-1, 0, 1))
            if self._is_ear(a, b, c, level):
                found.append(sorted((a, b, c)))
                self._ring = np.delete(self._ring, place)
                # Beside the last ear the triangles would be thin. What was refused may be an ear from now on.
                place, level, misses, stale = place + 1, _STRICT, 0, True
                continue
            place, misses = place + 1, misses + 1
            if self._work.left < 0:
                return None
            if misses >= len(self._ring):
                if level == _ANY and not stale:
                    return None
                level, misses, stale = level + (not stale), 0, False
                self._refused.clear()
        return [*found, sorted(self._ring.tolist())]

    def _is_ear(self, a: int, b: int, c: int, level: int) -> bool:
        """Whether the corner b between a and c can be cut off; what was refused once is so until the level rises."""
        if (a, b, c) in self._refused:
            return False
        turn = int(self._sides(a, b, np.array([c]))[0])
        if turn > 0 and self._is_free(a, b, c, level):
            return True
        if turn == 0 and level > _STRICT:  # a corner on a straight line, or a spike: nothing is cut off
            return True
        self._refused.add((a, b, c))
        return False

    def _is_free(self, a: int, b: int, c: int, level: int) -> bool:
        """Whether the triangle holds no other corner."""
        points = self._points
        corners = points[[a, b, c]]
        low, high = corners.min(axis=0), corners.max(axis=0)
        ring = points[self._ring]
        self._work.left -= len(ring) + _CALL
        others = self._ring[((ring >= low) & (ring <= high)).all(axis=1)]
        others = others[(others != a) & (others != b) & (others != c)]
        first, last, cut = (self._kept(others, a, b), self._kept(others, b, c), self._kept(others, c, a))
        inside = (first >= 0) & (last >= 0) & (cut >= 0)
        if not inside.any():
            return True
        others, first, last, cut = others[inside], first[inside], last[inside], cut[inside]
        at = points[others]
        beside = (at == points[a]).all(axis=1) | (at == points[c]).all(axis=1)
        same = (at == points[b]).all(axis=1)
        if any(self._goes_in(int(other), a, b, c) for other in others[same]):
            return False
        border = (first == 0) | (last == 0)
        blocking = ~(beside | same)
        if level >= _TOUCHING:
            blocking &= ~border
        if level >= _ANY:
            blocking &= cut > 0
        return not blocking.any()

    def _kept(self, others: NDArray[np.int64], a: int, b: int) -> NDArray[np.int64]:
        return self._sides(a, b, others) if len(others) else np.zeros(0, np.int64)

    def _goes_in(self, other: int, a: int, b: int, c: int) -> bool:
        """Whether the outline goes from another corner in the place of b into the angle at b."""
        place = int(np.searchsorted(self._ring, other))
        beside = self._ring[[place - 1, (place + 1) % len(self._ring)]]
        return bool(((self._sides(a, b, beside) > 0) & (self._sides(b, c, beside) > 0)).any())

    def _sides(self, a: int, b: int, others: NDArray[np.int64]) -> NDArray[np.int64]:
        """On which side of the line from a to b others are: 1 left of it, -1 right, 0 on it."""
        (ax, ay), (bx, by) = self._points[a].tolist(), self._points[b].tolist()
        x, y = self._points[others, 0], self._points[others, 1]
        left, right = (bx - ax) * (y - ay), (by - ay) * (x - ax)
        product = left - right
        sides: NDArray[np.int64] = np.sign(product).astype(np.int64)
        for place in np.flatnonzero(np.abs(product) <= _BOUND * (np.abs(left) + np.abs(right)) + _TINY).tolist():
            sides[place] = self._exact_side(a, b, int(others[place]))
        return sides

    def _exact_side(self, a: int, b: int, other: int) -> int:
        self._work.left -= _CALL
        if not self._exact:
            self._exact = _whole_numbers(self._points)
        (ax, ay), (bx, by), (x, y) = self._exact[a], self._exact[b], self._exact[other]
        product = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
        return (product > 0) - (product < 0)


def _whole_numbers(points: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Points (n, 2) times one power of two, so that all coordinates are whole numbers."""
    ratios = [value.as_integer_ratio() for value in points.reshape(-1).tolist()]
    largest = max(below for _, below in ratios)
    whole = [above * (largest // below) for above, below in ratios]
    return list(zip(whole[0::2], whole[1::2], strict=True))
