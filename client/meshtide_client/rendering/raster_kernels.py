"""Kernels of the rasterizer: which face each pixel shows, and its colour.

A depth buffer keeps the nearest face of each pixel; where depths are equal, the face that comes first. An edge that
two faces share is tested by products that differ in sign only, so no pixel falls between them. Cost: O(faces +
pixels of their bounding boxes). Only + - * / and sqrt of doubles in a fixed order: the same picture on every machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer

    Floats = NDArray[np.float64]

NO_FACE = -1


@kernel
def draw_faces(
    points: Floats,
    faces: NDArray[np.int64],
    depths: Floats,
    owners: NDArray[np.int32],
    shares: Floats,
) -> None:
    """Draw faces (m, 3), whose indices are in range, of points (n, 3): column, row, and height towards the eye.

    Keeps in `depths` (h, w) the largest height, in `owners` (h, w) its face, and in `shares` (h, w, 2) the barycentric
    weights of that face's first two corners at the middle of the pixel.
    """
    height, width = depths.shape
    for face in range(faces.shape[0]):
        ax, ay, az = points[faces[face, 0]]
        bx, by, bz = points[faces[face, 1]]
        cx, cy, cz = points[faces[face, 2]]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        left, right = _pixel_range(min(ax, bx, cx), max(ax, bx, cx), width)
        top, bottom = _pixel_range(min(ay, by, cy), max(ay, by, cy), height)
        if area == 0.0:
            continue
        sign = 1.0 if area > 0.0 else -1.0
        for row in range(top, bottom):
            y = row + 0.5
            for column in range(left, right):
                x = column + 0.5
                first = ((bx - x) * (cy - y) - (by - y) * (cx - x)) * sign
                second = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) * sign
                third = ((ax - x) * (by - y) - (ay - y) * (bx - x)) * sign
                total = first + second + third
                if first < 0.0 or second < 0.0 or third < 0.0 or not total > 0.0:
                    continue
                first /= total
                second /= total
                depth = first * az + second * bz + (1.0 - first - second) * cz
                if depth > depths[row, column]:
                    depths[row, column] = depth
                    owners[row, column] = face
                    shares[row, column, 0] = first
                    shares[row, column, 1] = second


@kernel
def _pixel_range(low: float, high: float, size: Integer) -> tuple[int, int]:
    """Pixels 0 .. size - 1 whose middles lie in [low, high], as the first one and the one after the last."""
    start = np.ceil(max(low, 0.0) - 0.5)
    end = np.floor(min(high, float(size)) - 0.5) + 1.0
    return int(max(start, 0.0)), int(max(min(end, float(size)), 0.0))


@kernel
def shade_faces(
    points: Floats,
    faces: NDArray[np.int64],
    owners: NDArray[np.int32],
    shares: Floats,
    normals: Floats,
    colours: Floats,
    light: Floats,
    ambient: float,
    edge_width: float,
    edge_colour: Floats,
    image: Floats,
) -> None:
    """Colour the pixels of `image` (h, w, 3) that show a face.

    `normals` (n, 3) of the vertices are interpolated, or the face's own is taken where there are none (0, 3);
    `colours` (n, 3) are interpolated. A normal that points away from the eye is turned round: faces have two sides.
    Pixels within half of `edge_width` of an edge of their face take `edge_colour`.
    """
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            face = owners[row, column]
            if face < 0:
                continue
            a, b, c = faces[face]
            first, second = shares[row, column]
            third = 1.0 - first - second
            ux, uy, uz = points[b] - points[a]
            vx, vy, vz = points[c] - points[a]
            nx = vy * uz - vz * uy  # rows run downwards, which turns the product's sign round
            ny = vx * uz - vz * ux
            nz = uy * vx - ux * vy
            if edge_width > 0.0:
                edge = min(
                    first * _altitude(points, b, c, nz),
                    second * _altitude(points, c, a, nz),
                    third * _altitude(points, a, b, nz),
                )
                if 2.0 * edge < edge_width:
                    image[row, column] = edge_colour
                    continue
            if normals.shape[0] > 0:
                nx = first * normals[a, 0] + second * normals[b, 0] + third * normals[c, 0]
                ny = first * normals[a, 1] + second * normals[b, 1] + third * normals[c, 1]
                nz = first * normals[a, 2] + second * normals[b, 2] + third * normals[c, 2]
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            lit = 0.0
            if length > 0.0:
                lit = (nx * light[0] + ny * light[1] + nz * light[2]) / length
                if nz < 0.0:
                    lit = -lit
            brightness = ambient + (1.0 - ambient) * max(lit, 0.0)
            for channel in range(3):
                colour = first * colours[a, channel] + second * colours[b, channel] + third * colours[c, channel]
                image[row, column, channel] = brightness * colour


@kernel
def _altitude(points: Floats, start: Integer, end: Integer, area: float) -> float:
    """Distance, in the picture's plane, of a face's corner from the edge opposite to it; `area` is twice the face's."""
    x = points[end, 0] - points[start, 0]
    y = points[end, 1] - points[start, 1]
    return float(abs(area) / np.sqrt(x * x + y * y))


@kernel
def add_face_normals(points: Floats, faces: NDArray[np.int64], normals: Floats) -> None:
    """Add to `normals` (n, 3) of each corner the normal of its face, as long as the face's area; y is up there."""
    for face in range(faces.shape[0]):
        a, b, c = faces[face]
        ux, uy, uz = points[b] - points[a]
        vx, vy, vz = points[c] - points[a]
        for corner in range(3):
            vertex = faces[face, corner]
            normals[vertex, 0] += vy * uz - vz * uy
            normals[vertex, 1] += vx * uz - vz * ux
            normals[vertex, 2] += uy * vx - ux * vy


@kernel
def draw_dots(points: Floats, colours: Floats, radius: float, depths: Floats, image: Floats) -> None:
    """Draw each point (n, 3) as a disc of its colour (n, 3), the nearer before the farther."""
    height, width = depths.shape
    for point in range(points.shape[0]):
        x, y, z = points[point]
        left, right = _pixel_range(x - radius, x + radius, width)
        top, bottom = _pixel_range(y - radius, y + radius, height)
        for row in range(top, bottom):
            for column in range(left, right):
                across, down = column + 0.5 - x, row + 0.5 - y
                if across * across + down * down <= radius * radius and z > depths[row, column]:
                    depths[row, column] = z
                    image[row, column] = colours[point]
