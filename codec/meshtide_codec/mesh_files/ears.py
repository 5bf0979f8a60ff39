"""Concave polygons cut by ears, with mapbox earcut, in the plane across their mean normal.

Earcut leaves out corners on straight lines, and may cut wrongly where a corner is off its line by a rounding error. So
such corners are taken out first, and put back into the triangles on whose edges they lie, for a corner of the next
polygon may stand there. Cost: that of earcut, about linear in the corners.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.mesh_files.ear_clipping import Work, clipped

if TYPE_CHECKING:
    from numpy.typing import NDArray

_STRAIGHT = 1e-12
"""What counts as straight or flat, as a part of the polygon's area: far above rounding, far below what one can see."""
_ROUNDING = 1e-15
"""Errors of coordinates near 1 after a rotation."""
_SAME = 1e-11
"""How much areas may differ, as a part of them."""
_PASSES = 64
"""Corners that are left out may straighten others, seldom more than once."""


def planes(points: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Polygons (k, n, 3) seen along their normals (k, 3): (k, n, 2)."""
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    axis = np.zeros_like(unit)
    axis[np.arange(len(unit)), np.argmin(np.abs(unit), axis=1)] = 1.0
    across = np.cross(unit, axis)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    seen: NDArray[np.float64] = points @ np.stack([across, np.cross(unit, across)], axis=2)
    return seen


def ears(outlines: NDArray[np.float64], work: Work) -> NDArray[np.int64]:
    """Triangles (k, n - 2, 3) of polygons (k, n, 2); corners rise along the outline, whichever way earcut turned it.

    Args:
        outlines: that turn left, of sizes near 1.
        work: what may be done for those that earcut cuts wrongly; counts those that cross themselves.
    """
    from mapbox_earcut import triangulate_float64  # noqa: PLC0415 - few files have concave polygons

    size = outlines.shape[1]
    cut = np.zeros((len(outlines), size - 2, 3), np.int64)
    straight = _straight(outlines).sum(axis=1)
    whole = np.array([size], np.uint32)
    for place, plane in enumerate(outlines):
        if straight[place] == 0:
            found = triangulate_float64(plane, whole)
            if len(found) == 3 * (size - 2) and len(set(found.tolist())) == size:
                cut[place] = found.reshape(-1, 3)
                continue
        bends = _bends(plane)
        found = triangulate_float64(plane[bends], np.array([len(bends)], np.uint32)).reshape(-1, 3)
        triangles = _with_all_corners(bends[np.sort(found, axis=1)].tolist(), size)
        cut[place] = _fan(size) if triangles is None else triangles
    cut.sort(axis=2)
    for place in np.flatnonzero(~_fits(outlines, cut)).tolist():
        cut[place] = _mended(outlines[place], cut[place], work)
    return cut


def _mended(plane: NDArray[np.float64], cut: NDArray[np.int64], work: Work) -> NDArray[np.int64]:
    """Triangles of a polygon (n, 2) that earcut cut wrongly; where nothing fits, those that overlap least."""
    size = len(plane)
    bends = _bends(plane)
    best, least = cut, abs(float(_excess(plane[None], cut[None])[0][0]))
    for corners in (bends, np.arange(size)) if 2 < len(bends) < size else (np.arange(size),):
        found = clipped(plane[corners], work)
        triangles = None if found is None else _with_all_corners(corners[np.array(found)].tolist(), size)
        if triangles is None:
            continue
        other = np.sort(np.array(triangles), axis=1)
        if _fits(plane[None], other[None])[0]:
            return other
        excess = abs(float(_excess(plane[None], other[None])[0][0]))
        if excess < least:
            best, least = other, excess
    work.crossed += 1
    return best


def _fan(size: int) -> list[list[int]]:
    return [[0, i + 1, i + 2] for i in range(size - 2)]


def _fits(outlines: NDArray[np.float64], cut: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Of which polygons (k, n, 2) the triangles (k, n - 2, 3) have the area, so that none overlap."""
    excess, area = _excess(outlines, cut)
    fits: NDArray[np.bool_] = np.abs(excess) <= _SAME * area + outlines.shape[1] * _ROUNDING
    return fits


def _excess(outlines: NDArray[np.float64], cut: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How much larger the areas of triangles (k, n - 2, 3) are than those (k,) of their polygons; the latter."""
    following = np.roll(outlines, -1, axis=1)
    area = np.abs((outlines[..., 0] * following[..., 1] - outlines[..., 1] * following[..., 0]).sum(axis=1)) / 2
    a, b, c = (np.take_along_axis(outlines, cut[:, :, place, None], axis=1) for place in range(3))
    b, c = b - a, c - a
    total = np.abs(b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0]).sum(axis=1) / 2
    excess: NDArray[np.float64] = total - area
    return excess, area


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
