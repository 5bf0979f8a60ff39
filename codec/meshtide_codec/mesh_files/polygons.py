"""Polygons to triangles: inside of each polygon, the same for the same polygon, no corner lost.

Triangles pass as they are. Of a quadrilateral the shorter diagonal is taken, of those that lie inside. Other polygons
become a fan around their first corner where they are convex, seen along their mean normal (Newell's, so bent ones have
one too). The rest, concave polygons and those with holes that a slit joins to the outline, are cut by ears (mapbox
earcut) in the plane of that normal. Corners on straight lines are left out before that and put back after it, as the
corner of the next polygon may stand there. Polygons of no area are fans. Cost: linear in the corners, but for concave
polygons.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

_QUAD = 4
_DIAGONALS = np.array([[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]])
_CORNERS_AT_ONCE = 1 << 13
"""Cutting takes some 200 bytes a corner, but only for so many at once."""
_STRAIGHT = 1e-12
"""What counts as straight or flat, as a part of the polygon's area: far above rounding, far below what one can see."""

_ROUNDING = 1e-15
"""Errors of coordinates near 1 after a rotation."""
_PASSES = 64
"""Corners that are left out may straighten others, seldom more than once."""


@dataclass(frozen=True, slots=True)
class Triangulation:
    """Triangles of polygons.

    Args:
        corners: (m, 3) int64, of each triangle's corners the place in the flat list of the polygons' corners.
        polygon: (m,) int64, the polygon that each triangle belongs to; they rise.
        inner: (m, 3) bool, whether the edge from a corner to the next one is inside of its polygon; None if none is.
        degenerate: how many polygons had fewer than three distinct vertices, and became nothing.
    """

    corners: NDArray[np.int64]
    polygon: NDArray[np.int64]
    inner: NDArray[np.bool_] | None
    degenerate: int


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
    starts = np.cumsum(counts) - counts
    if len(counts) and counts.min() == counts.max() == 3:
        faces = np.arange(len(corners), dtype=np.int64).reshape(-1, 3)
        return Triangulation(faces, np.arange(len(counts)), None, 0)
    parts: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = []  # polygons and their triangles
    degenerate = int((counts < 3).sum())
    for size in np.unique(counts[counts >= 3]).tolist():
        of_size = np.flatnonzero(counts == size)
        step = max(1, _CORNERS_AT_ONCE // size)
        for chosen in (of_size[begin : begin + step] for begin in range(0, len(of_size), step)):
            places = starts[chosen, None] + np.arange(size)
            if size == 3:
                parts.append((chosen, places))
                continue
            few = _few_vertices(corners[places])
            degenerate += int(few.sum())
            places = places[~few]
            parts += _cut(vertices[corners[places]], chosen[~few], places)
    if not parts:
        return Triangulation(np.zeros((0, 3), np.int64), np.zeros(0, np.int64), None, degenerate)
    polygon = np.concatenate([one for one, _ in parts])
    triangles = np.concatenate([one for _, one in parts])
    parts.clear()
    if (polygon[1:] < polygon[:-1]).any():
        order = np.argsort(polygon, kind="stable")
        polygon, triangles = polygon[order], triangles[order]
    return Triangulation(triangles, polygon, _inner(triangles, polygon, counts, starts), degenerate)


def _few_vertices(corners: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which rows have fewer than three distinct vertices."""
    ordered = np.sort(corners, axis=1)
    few: NDArray[np.bool_] = (ordered[:, 1:] != ordered[:, :-1]).sum(axis=1) < 2
    return few


def _cut(
    points: NDArray[np.float64], chosen: NDArray[np.int64], places: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Triangles of k polygons of n corners each: their positions (k, n, 3), their numbers, their corners' places."""
    size = points.shape[1]
    points = _near_one(points)
    with np.errstate(all="ignore"):  # what is not finite becomes a fan, and is refused with its vertex's name
        edges = np.roll(points, -1, axis=1) - points
        normal = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)
        square = (normal * normal).sum(axis=1)
        before = np.roll(edges, 1, axis=1)
        turn = np.einsum("kni,ki->kn", np.cross(before, edges), normal)
        left = turn > _STRAIGHT * square[:, None]
        level = turn > -_STRAIGHT * square[:, None]
        along = (before * edges).sum(axis=2) * np.sqrt(square)[:, None]
        once = np.abs(np.arctan2(turn, along).sum(axis=1)) < 3 * np.pi  # a star turns round twice
        longest = (edges * edges).sum(axis=2).max(axis=1)
        flat = ~(np.sqrt(square) > _STRAIGHT * longest)
    if size == _QUAD:
        first = left[:, 1] & left[:, 3]
        second = left[:, 0] & left[:, 2]
        with np.errstate(all="ignore"):
            lengths = [((points[:, i] - points[:, i + 2]) ** 2).sum(axis=1) for i in (0, 1)]
            shorter = lengths[1] < lengths[0]
        other = (second & ~first) | (second & shorter)
        corners = _DIAGONALS[other.astype(np.intp)].reshape(-1, 6)
        yield np.repeat(chosen, 2), np.take_along_axis(places, corners, axis=1).reshape(-1, 3)
        return
    # A fan around a corner has no flat triangle if its two neighbours are no corners on straight lines.
    apexes = np.roll(left, 1, axis=1) & np.roll(left, -1, axis=1)
    convex = level.all(axis=1) & once & apexes.any(axis=1)
    fans = convex | flat
    apex = np.where(convex, np.argmax(apexes, axis=1), 0)[fans, None]
    ring = (apex + np.arange(size)) % size
    turned = np.take_along_axis(places[fans], ring, axis=1)
    spans = np.arange(size - 2)
    fan = np.stack([np.zeros_like(spans), spans + 1, spans + 2], axis=1)
    yield np.repeat(chosen[fans], size - 2), turned[:, fan].reshape(-1, 3)
    rest = np.flatnonzero(~fans)
    if len(rest):
        ears = _ears(_planes(points[rest], normal[rest]))
        cut = np.take_along_axis(places[rest], ears.reshape(len(rest), -1), axis=1)
        yield np.repeat(chosen[rest], size - 2), cut.reshape(-1, 3)


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


def _planes(points: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Polygons (k, n, 3) seen along their normals (k, 3): (k, n, 2)."""
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    axis = np.zeros_like(unit)
    axis[np.arange(len(unit)), np.argmin(np.abs(unit), axis=1)] = 1.0
    across = np.cross(unit, axis)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    planes: NDArray[np.float64] = points @ np.stack([across, np.cross(unit, across)], axis=2)
    return planes


def _ears(planes: NDArray[np.float64]) -> NDArray[np.int64]:
    """Triangles (k, n - 2, 3) of polygons (k, n, 2); corners rise along the outline, whichever way earcut turned it."""
    from mapbox_earcut import triangulate_float64  # noqa: PLC0415 - few files have concave polygons

    size = planes.shape[1]
    ears = np.zeros((len(planes), size - 2, 3), np.int64)
    straight = _straight(planes).sum(axis=1)
    whole = np.array([size], np.uint32)
    for place, plane in enumerate(planes):
        if straight[place] == 0:
            found = triangulate_float64(plane, whole)
            if len(found) == 3 * (size - 2) and len(set(found.tolist())) == size:
                ears[place] = found.reshape(-1, 3)
                continue
        bends = _bends(plane)
        found = triangulate_float64(plane[bends], np.array([len(bends)], np.uint32)).reshape(-1, 3)
        triangles = _with_all_corners(bends[np.sort(found, axis=1)].tolist(), size)
        # An outline that crosses itself becomes a fan.
        ears[place] = [(0, i + 1, i + 2) for i in range(size - 2)] if triangles is None else triangles
    ears.sort(axis=2)
    return ears


def _bends(plane: NDArray[np.float64]) -> NDArray[np.int64]:
    """The corners of an outline (n, 2) that are neither on a straight line nor in one place with the next.

    Earcut may cut wrongly where a corner is off its line by a rounding error.
    """
    kept = np.arange(len(plane))
    for _ in range(_PASSES):
        dropped = _straight(plane[None, kept])[0] if len(kept) > 2 else np.zeros(0, bool)
        if not dropped.any():
            break
        kept = kept[~dropped]
    return kept


def _straight(planes: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which corners of outlines (k, n, 2) of sizes near 1 go straight on, or are in one place with the next one."""
    edges = np.roll(planes, -1, axis=1) - planes
    before = np.roll(edges, 1, axis=1)
    lengths = np.linalg.norm(edges, axis=2)
    turn = np.abs(before[..., 0] * edges[..., 1] - before[..., 1] * edges[..., 0])
    product, total = lengths * np.roll(lengths, 1, axis=1), lengths + np.roll(lengths, 1, axis=1)
    onward = (turn <= _STRAIGHT * product + _ROUNDING * total) & ((before * edges).sum(axis=2) > 0)
    straight: NDArray[np.bool_] = onward | (lengths <= _ROUNDING)
    return straight


def _with_all_corners(triangles: list[list[int]], size: int) -> list[list[int]] | None:
    """The triangles with the corners that were left out put back into the edges that they lie on; None if none fits."""
    present = sorted({corner for triangle in triangles for corner in triangle})
    if not present:
        return None
    edges = {(triangle[i], triangle[(i + 1) % 3]): place for place, triangle in enumerate(triangles) for i in range(3)}
    result: list[list[int] | None] = list(triangles)
    for start, end in zip(present, [*present[1:], present[0]], strict=True):
        missing = [corner % size for corner in range(start + 1, end + (size if end <= start else 0))]
        if not missing:
            continue
        place = edges.get((start, end))
        split = None if place is None else result[place]
        if place is None or split is None:
            return None
        apex = next(corner for corner in split if corner not in (start, end))
        chain = [start, *missing, end]
        fan = [sorted((apex, a, b)) for a, b in pairwise(chain)]
        result[place] = None
        for triangle in fan:  # other edges of the same triangle may be split later
            edges |= {(triangle[i], triangle[(i + 1) % 3]): len(result) for i in range(3)}
            result.append(triangle)
    whole = [triangle for triangle in result if triangle is not None]
    return whole if len(whole) == size - 2 else None


def _inner(
    triangles: NDArray[np.int64], polygon: NDArray[np.int64], counts: NDArray[np.int64], starts: NDArray[np.int64]
) -> NDArray[np.bool_] | None:
    """Which edges (m, 3) do not lead from a corner of the outline to the next one."""
    inner = np.zeros(triangles.shape, np.bool_)
    start, count = starts[polygon], counts[polygon]
    for place in range(3):
        following = (triangles[:, place] - start + 1) % count + start
        inner[:, place] = following != triangles[:, (place + 1) % 3]
    return inner if inner.any() else None
