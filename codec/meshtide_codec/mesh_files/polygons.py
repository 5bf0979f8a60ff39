"""Polygons to triangles: inside of each polygon, the same for the same polygon, no corner lost.

Triangles pass as they are. Of a quadrilateral the shorter diagonal is taken, of those that lie inside. Other polygons
become a fan around their first corner where they are convex, seen along their mean normal (Newell's, so bent ones have
one too). The rest, concave polygons and those with holes that a slit joins to the outline, are cut by ears (mapbox
earcut) in the plane of that normal. Earcut leaves out corners on straight lines; they are put back, as the corner of
the next polygon may stand there. Polygons of no area are fans. Cost: linear in the corners, but for concave polygons.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.mesh_files.ear_clipping import Work
from meshtide_codec.mesh_files.ears import ears, planes

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

_QUAD = 4
_FIRST_DIAGONAL = [[0, 1, 2], [0, 2, 3]]
_SECOND_DIAGONAL = [[0, 1, 3], [1, 2, 3]]
_PART = 1 << 14  # polygons that are sorted by their sizes together: of all at once it would take several times more
_BATCH = 1 << 11  # corners that are looked at together: their arrays stay below what malloc maps anew each time
_STRAIGHT = 1e-12
"""What counts as straight or flat, as a part of the polygon's area: far above rounding, far below what one can see."""


_VISIBLE = 1e-9
"""What counts as an area, as a part of the square of a length: far above rounding."""


@dataclass(frozen=True, slots=True)
class Triangulation:
    """Triangles of polygons.

    Args:
        corners: (m, 3) int64, of each triangle's corners the place in the flat list of the polygons' corners.
        polygon: (m,) int64, the polygon that each triangle belongs to; they rise.
        inner: (m, 3) bool, whether the edge from a corner to the next one is inside of its polygon; None if none is.
        degenerate: how many polygons had fewer than three distinct vertices, and became nothing.
        crossed: how many polygons cross themselves, so that their triangles overlap.
    """

    corners: NDArray[np.int64]
    polygon: NDArray[np.int64]
    inner: NDArray[np.bool_] | None
    degenerate: int
    crossed: int = 0

    def notes(self, corners: str = "corners") -> list[str]:
        """What a person should know of it, a line each.

        Args:
            corners: what the file calls them.
        """
        notes = []
        if self.degenerate:
            notes.append(f"faces of fewer than three different {corners}, left out: {self.degenerate}")
        if self.crossed:
            notes.append(f"{self.crossed} polygons cross themselves: their triangles overlap")
        return notes


def triangulated(vertices: NDArray[np.float64], counts: NDArray[np.int64], corners: NDArray[np.int64]) -> Triangulation:
    """Cut polygons into triangles.

    Args:
        vertices: (n, 3) positions.
        counts: (p,) corners of each polygon; with fewer than three it becomes nothing.
        corners: (sum of counts,) the vertex of each corner, in range.

    >>> square = np.array([[0.0, 0, 0], [3, 0, 0], [3, 1, 0], [0, 1, 0]])
    >>> triangulated(square, np.array([4]), np.array([0, 1, 2, 3])).corners.tolist()
    [[0, 1, 2], [0, 2, 3]]
    """
    counts = np.asarray(counts, np.int64)
    if len(counts) and counts.min() == counts.max() == 3:
        faces = np.arange(len(corners), dtype=np.int64).reshape(-1, 3)
        return Triangulation(faces, np.arange(len(counts)), None, 0)
    most = int(np.maximum(counts - 2, 0).sum())
    triangles, polygon, inner = np.empty((most, 3), np.int64), np.empty(most, np.int64), np.zeros((most, 3), bool)
    filled = passed = degenerate = 0
    work = Work()
    for begin in range(0, len(counts), _PART):
        some = counts[begin : begin + _PART]
        size = int(some.sum())
        part = _triangulated(vertices, some, corners[passed : passed + size], work)
        rows = slice(filled, filled + len(part.polygon))
        np.add(part.corners, passed, out=triangles[rows])
        np.add(part.polygon, begin, out=polygon[rows])
        if part.inner is not None:
            inner[rows] = part.inner
        filled, passed, degenerate = rows.stop, passed + size, degenerate + part.degenerate
    kept = inner[:filled] if inner.any() else None
    return Triangulation(triangles[:filled], polygon[:filled], kept, degenerate, work.crossed)


def _triangulated(
    vertices: NDArray[np.float64], counts: NDArray[np.int64], corners: NDArray[np.int64], work: Work
) -> Triangulation:
    """The same of some polygons: by their sizes, in arrays that are much larger than the triangles."""
    starts = np.cumsum(counts) - counts
    amounts = np.maximum(counts - 2, 0)
    for chosen, places in _batches(counts, starts, 4):
        amounts[chosen[_few_vertices(corners[places])]] = 0
    rows = np.cumsum(amounts) - amounts
    triangles = np.empty((int(amounts.sum()), 3), np.int64)
    inner = np.zeros(triangles.shape, bool)
    for chosen, places in _batches(counts, starts, 3):
        whole = amounts[chosen] > 0
        kept, begins = places[whole], rows[chosen[whole]]
        if kept.shape[1] == 3:
            triangles[begins] = kept
        else:
            _put(_cut(vertices[corners[kept]], work), kept, begins, triangles, inner)
    del rows, starts
    polygon = np.repeat(np.arange(len(counts)), amounts)
    return Triangulation(triangles, polygon, inner if inner.any() else None, int((amounts == 0).sum()))


def _batches(
    counts: NDArray[np.int64], starts: NDArray[np.int64], least: int
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Polygons of one size, `least` or more, some at a time: their numbers (k,), the places of their corners (k, n)."""
    if len(counts) == 0:
        return
    order = None
    ordered = counts
    if counts.min() < counts.max():
        order = np.argsort(counts, kind="stable")
        ordered = counts[order]
    begins = np.flatnonzero(np.diff(ordered, prepend=-1))
    sizes, ends = ordered[begins], np.append(begins[1:], len(counts))
    for size, begin, end in zip(sizes.tolist(), begins.tolist(), ends.tolist(), strict=True):
        if size < least:
            continue
        step = max(_BATCH // size, 1)
        for low in range(begin, end, step):
            high = min(low + step, end)
            chosen = np.arange(low, high) if order is None else order[low:high]
            yield chosen, starts[chosen, None] + np.arange(size)


def _put(
    parts: Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]],
    places: NDArray[np.int64],
    rows: NDArray[np.int64],
    triangles: NDArray[np.int64],
    inner: NDArray[np.bool_],
) -> None:
    """Put the triangles of polygons (k, n), and their inner edges, into the rows that begin at `rows` (k,)."""
    size = places.shape[1]
    for polygons, cut in parts:
        where = rows[polygons][:, None] + np.arange(size - 2)
        triangles[where] = cut + places[polygons, 0][:, None, None]
        pattern = cut[:1] if cut.strides[0] == 0 else cut  # all may be cut alike
        inner[where] = (pattern + 1) % size != pattern[:, :, [1, 2, 0]]


def _few_vertices(corners: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which rows have fewer than three distinct vertices."""
    ordered = np.sort(corners, axis=1)
    few: NDArray[np.bool_] = (ordered[:, 1:] != ordered[:, :-1]).sum(axis=1) < 2
    return few


def _cut(points: NDArray[np.float64], work: Work) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Triangles of k polygons (k, n, 3), some at a time: which polygons (j,), the corners of each (j, n - 2, 3)."""
    size = points.shape[1]
    points = _near_one(points)
    along = np.ascontiguousarray(points.transpose(2, 1, 0))  # (3, n, k): long rows are what numpy is fast at
    with np.errstate(all="ignore"):  # what is not finite becomes a fan, and is refused with its vertex's name
        edges = np.roll(along, -1, axis=1) - along
        normal = _cross(along, np.roll(along, -1, axis=1)).sum(axis=1)
        square = (normal * normal).sum(axis=0)
        before = np.roll(edges, 1, axis=1)
        turn = (_cross(before, edges) * normal[:, None]).sum(axis=0)
        left = turn > _STRAIGHT * square
        if size == _QUAD:
            if (odd := ~(left[0] & left[2] | left[1] & left[3])).any():
                twice = (turn[:, odd] < -_STRAIGHT * square[odd]).sum(axis=0) == 2
                work.crossed += int((twice | (square[odd] == 0) & _spread(along[..., odd])).sum())
            yield from _halves(along, left)
            return
        longest = (edges * edges).sum(axis=0).max(axis=0)
        flat = ~(np.sqrt(square) > _STRAIGHT * longest)
        if flat.any():
            work.crossed += int(_spread(along[..., flat]).sum())
        level = turn > -_STRAIGHT * square
        ahead = (before * edges).sum(axis=0) * np.sqrt(square)
        once = np.abs(np.arctan2(turn, ahead).sum(axis=0)) < 3 * np.pi  # a star turns round twice
    # A fan around a corner has no flat triangle if its two neighbours are not corners on straight lines.
    apexes = np.roll(left, 1, axis=0) & np.roll(left, -1, axis=0)
    convex = level.all(axis=0) & once & apexes.any(axis=0)
    fans = np.flatnonzero(convex | flat)
    apex = np.where(convex, np.argmax(apexes, axis=0), 0)[fans, None]
    ring = (apex + np.arange(size)) % size
    spans = np.arange(size - 2)
    yield fans, ring[:, np.stack([np.zeros_like(spans), spans + 1, spans + 2], axis=1)]
    rest = np.flatnonzero(~(convex | flat))
    if len(rest):
        yield rest, ears(planes(points[rest], normal[:, rest].T), work)


def _near_one(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Polygons (k, n, 3) moved so that the first corner is at the origin, and scaled by powers of two to sizes near 1.

    No product of coordinates overflows or vanishes then.
    """
    with np.errstate(all="ignore"):
        moved = points * 0.5
        moved -= moved[:, :1].copy()
        _, exponents = np.frexp(np.abs(moved).max(axis=(1, 2)))
        near: NDArray[np.float64] = np.ldexp(moved, -exponents[:, None, None])
    return near


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The cross products of vectors (3, n, k)."""
    products = np.empty_like(a)
    other = np.empty_like(a[0])
    for axis in range(3):
        np.multiply(a[axis - 2], b[axis - 1], out=products[axis])
        products[axis] -= np.multiply(a[axis - 1], b[axis - 2], out=other)
    return products


def _spread(along: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which polygons (3, n, k) of no area have triangles that have some, as what crosses itself has."""
    spokes = along - along[:, :1]
    areas = _cross(spokes[:, :-1], spokes[:, 1:])
    longest = (spokes * spokes).sum(axis=0).max(axis=0)
    spread: NDArray[np.bool_] = np.sqrt((areas * areas).sum(axis=(0, 1))) > _VISIBLE * longest
    return spread


def _halves(
    along: NDArray[np.float64], left: NDArray[np.bool_]
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Quadrilaterals (3, 4, k) as two triangles each; `left` (4, k) are the corners at which the outline turns left."""
    first = left[1] & left[3]
    second = left[0] & left[2]
    across = along[:, :2] - along[:, 2:]
    lengths = (across * across).sum(axis=0)
    other = second & (~first | (lengths[1] < lengths[0]))
    for mask, corners in ((~other, _FIRST_DIAGONAL), (other, _SECOND_DIAGONAL)):
        chosen = np.flatnonzero(mask)
        yield chosen, np.broadcast_to(np.array(corners), (len(chosen), 2, 3))
