"""Which face each pixel shows, and its colour: whole arrays of fragments at a time.

A depth buffer keeps the nearest face of each pixel; where depths are equal, the face that comes first. An edge that
two faces share is tested by products that differ in sign only, so no pixel falls between them. Cost: O(faces +
pixels of their bounding boxes), in blocks of a million pixels at most. Only + - * / and sqrt of doubles in a fixed
order: the same picture on every machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

NO_FACE = -1
FRAGMENTS = 1 << 20
"""Pixels that are looked at in one go."""


class PixelBuffers(NamedTuple):
    """What is known of each pixel of a picture (h, w).

    Attributes:
        depths: (h, w) float64, the largest height so far, towards the eye.
        owners: (h, w) int32, the face that has it, or `NO_FACE`.
        shares: (h, w, 2) float64, the barycentric weights of that face's first two corners.
    """

    depths: Floats
    owners: NDArray[np.int32]
    shares: Floats

    @classmethod
    def empty(cls, height: int, width: int) -> PixelBuffers:
        """Of a picture that shows nothing."""
        shape = (height, width)
        return cls(np.full(shape, -np.inf), np.full(shape, NO_FACE, np.int32), np.zeros((*shape, 2)))


class Light(NamedTuple):
    """How surfaces are lit.

    Attributes:
        direction: (3,) float64, of length 1, towards the light.
        ambient: brightness of what is turned away from it, 0 to 1.
    """

    direction: Floats
    ambient: float


class Pen(NamedTuple):
    """How edges of faces are drawn: width in pixels (0 for none), and colour (3,) float64."""

    width: float
    colour: Floats


def draw_faces(points: Floats, faces: Integers, buffers: PixelBuffers) -> None:
    """Draw faces (m, 3), whose indices are in range, of points (n, 3): column, row, and height towards the eye."""
    corners = points[faces]
    low, high = corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)
    sides = np.stack([_side(corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]) for k in range(3)], axis=1)
    a, b, c = (corners[:, k, :2] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    sides *= np.sign(area)[:, None, None]
    for block in _fragments(low, high, np.flatnonzero(area != 0.0), buffers.depths.shape):
        x, y, slopes = block.columns + 0.5, (block.rows + 0.5)[:, None], sides[block.owners]
        offsets = slopes[..., 1] * y + slopes[..., 2]
        one, two, three = (slopes[block.lines, k, 0] * x + offsets[block.lines, k] for k in range(3))
        total = one + two + three
        inside = np.flatnonzero((one >= 0.0) & (two >= 0.0) & (three >= 0.0) & (total > 0.0))
        owners, rows, columns = block.pixels(inside)
        one, two = one[inside] / total[inside], two[inside] / total[inside]
        a, b, c = (corners[owners, k, 2] for k in range(3))
        depths = one * a + two * b + (1.0 - one - two) * c
        nearest = _nearest(rows * buffers.depths.shape[1] + columns, depths, buffers.depths)
        place = rows[nearest], columns[nearest]
        buffers.depths[place] = depths[nearest]
        buffers.owners[place] = owners[nearest]
        buffers.shares[place] = np.stack([one[nearest], two[nearest]], axis=1)


def draw_dots(points: Floats, colours: Floats, radius: float, depths: Floats, image: Floats) -> None:
    """Draw each point (n, 3) as a disc of its colour (n, 3), the nearer before the farther."""
    middles = points[:, :2]
    every = np.arange(len(points))
    for block in _fragments(middles - radius, middles + radius, every, depths.shape):
        owners, rows, columns = block.pixels(slice(None))
        across, down = columns + 0.5 - points[owners, 0], rows + 0.5 - points[owners, 1]
        inside = np.flatnonzero(across * across + down * down <= radius * radius)
        owners, rows, columns = block.pixels(inside)
        nearest = _nearest(rows * depths.shape[1] + columns, points[owners, 2], depths)
        place = rows[nearest], columns[nearest]
        depths[place] = points[owners[nearest], 2]
        image[place] = colours[owners[nearest]]


def face_normals(points: Floats, faces: Integers) -> Floats:
    """(m, 3) float64: normals as long as twice the faces' areas; y is up there, though rows run downwards."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    u, v = b - a, c - a
    return np.stack(
        [
            v[:, 1] * u[:, 2] - v[:, 2] * u[:, 1],
            v[:, 0] * u[:, 2] - v[:, 2] * u[:, 0],
            u[:, 1] * v[:, 0] - u[:, 0] * v[:, 1],
        ],
        axis=1,
    )


def vertex_normals(points: Floats, faces: Integers) -> Floats:
    """(n, 3) float64: at each vertex the sum of the normals of its faces."""
    normals = np.zeros((len(points), 3))
    np.add.at(normals, faces.ravel(), np.repeat(face_normals(points, faces), 3, axis=0))
    return normals


def shade(
    points: Floats,
    faces: Integers,
    buffers: PixelBuffers,
    *,
    normals: Floats | None,
    colours: Floats,
    light: Light,
    pen: Pen,
) -> tuple[NDArray[np.bool_], Floats]:
    """The colours of the pixels that show a face.

    Args:
        points: (n, 3) float64, as for `draw_faces`.
        faces: (m, 3) int64.
        buffers: as `draw_faces` left them.
        normals: (n, 3) float64 of the vertices, blended across faces; None for those of the faces. A normal that
            points away from the eye is turned round: faces have two sides.
        colours: (n, 3) float64 of the vertices, blended.
        light: from where.
        pen: pixels within half of its width of an edge of their face have its colour.

    Returns:
        Which pixels (h, w) show a face, and their colours (k, 3), row by row.
    """
    shown = buffers.owners != NO_FACE
    owners = buffers.owners[shown]
    one, two = buffers.shares[shown].T
    weights = np.stack([one, two, 1.0 - one - two], axis=1)[..., None]
    flat = face_normals(points, faces)
    corners = faces[owners]
    blended = flat[owners] if normals is None else (weights * normals[corners]).sum(axis=1)
    lengths = np.sqrt((blended * blended).sum(axis=1))
    lit = np.zeros(len(owners))
    np.divide((blended * light.direction).sum(axis=1), lengths, out=lit, where=lengths > 0.0)
    lit = np.where(blended[:, 2] < 0.0, -lit, lit)
    brightness = light.ambient + (1.0 - light.ambient) * np.maximum(lit, 0.0)
    result = brightness[:, None] * (weights * colours[corners]).sum(axis=1)
    if pen.width > 0.0:
        distance = (weights[..., 0] * _altitudes(points, faces, flat)[owners]).min(axis=1)
        result[2.0 * distance < pen.width] = pen.colour
    return shown, result


def _altitudes(points: Floats, faces: Integers, normals: Floats) -> Floats:
    """(m, 3) float64: in the picture's plane, how far each corner is from the edge opposite to it."""
    corners = points[faces][..., :2]
    edges = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    lengths = np.sqrt((edges * edges).sum(axis=2))
    altitudes = np.zeros(lengths.shape)
    np.divide(np.abs(normals[:, 2:]), lengths, out=altitudes, where=lengths > 0.0)
    return altitudes


def _side(start: Floats, end: Floats) -> Floats:
    """A, B, C (m, 3) of A x + B y + C: twice the area between edge and (x, y), exactly minus the turned edge's."""
    return np.stack(
        [start[:, 1] - end[:, 1], end[:, 0] - start[:, 0], start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]], axis=1
    )


class _Block(NamedTuple):
    """Some pixels of some boxes: of each line of pixels its box and row, of each pixel its line and column."""

    owners: Integers
    rows: Integers
    lines: Integers
    columns: Integers

    def pixels(self, which: Integers | slice) -> tuple[Integers, Integers, Integers]:
        """Box, row and column of these pixels."""
        lines = self.lines[which]
        return self.owners[lines], self.rows[lines], self.columns[which]


def _fragments(low: Floats, high: Floats, which: Integers, shape: tuple[int, ...]) -> Iterator[_Block]:
    """The pixels in the boxes [low, high] (n, 2) of those in `which`, in their order."""
    left, right = _pixel_range(low[which, 0], high[which, 0], shape[1])
    top, bottom = _pixel_range(low[which, 1], high[which, 1], shape[0])
    widths = right - left
    heights = np.where(widths > 0, bottom - top, 0)
    lines = np.cumsum(heights)
    start = 0
    while start < len(which):  # as many boxes as have so many rows, and at least one
        end = max(start + 1, int(np.searchsorted(lines, (lines[start - 1] if start else 0) + FRAGMENTS, "right")))
        boxes = np.arange(start, end)
        box, row = _expanded(boxes, top[start:end], heights[start:end])
        ends = np.cumsum(widths[box])
        begin = 0
        while begin < len(box):  # as many rows as have so many pixels
            done = ends[begin - 1] if begin else 0
            stop = max(begin + 1, int(np.searchsorted(ends, done + FRAGMENTS, "right")))
            here = box[begin:stop]
            yield _Block(which[here], row[begin:stop], *_expanded(np.arange(stop - begin), left[here], widths[here]))
            begin = stop
        start = end


def _expanded(items: Integers, starts: Integers, counts: Integers) -> tuple[Integers, Integers]:
    """Each item as often as its count, and beside it start, start + 1, ..."""
    before = np.cumsum(counts) - counts
    return np.repeat(items, counts), np.arange(int(counts.sum())) + np.repeat(starts - before, counts)


def _pixel_range(low: Floats, high: Floats, size: int) -> tuple[Integers, Integers]:
    """Pixels 0 .. size - 1 whose middles lie in [low, high], as the first one and the one after the last."""
    starts = np.ceil(np.clip(low, 0.0, size + 1.0) - 0.5).astype(np.int64)
    ends = (np.floor(np.clip(high, -1.0, float(size)) - 0.5) + 1.0).astype(np.int64)
    return np.maximum(starts, 0), np.maximum(np.clip(ends, 0, size), np.maximum(starts, 0))


def _nearest(pixels: Integers, heights: Floats, depths: Floats) -> Integers:
    """Of the fragments in front of what their pixels show, the nearest of each pixel; the first one among equals."""
    before = np.flatnonzero(heights > depths.ravel()[pixels])
    order = before[np.lexsort((-heights[before], pixels[before]))]
    first = np.ones(len(order), bool)
    first[1:] = pixels[order[1:]] != pixels[order[:-1]]
    nearest: Integers = order[first]
    return nearest
