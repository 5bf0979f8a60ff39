"""A picture of levels side by side: orthographic, flat shaded, hidden surfaces removed, written as PNG.

Triangles are grouped by the size of their bounding box; each group is tested against the pixels of its boxes at
once, and a depth buffer keeps the nearest. Cost: O(faces + pixels of all boxes).
"""

from __future__ import annotations

import math
import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np

from meshtide_client.lettering import ROWS, Image, draw_text, text_width
from meshtide_codec.files import write_atomically

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from meshtide_codec.mesh import Mesh

TILE = 360
COLUMNS = 3
_CAPTION = 28
_MARGIN = 0.06
_OVERSAMPLING = 2
_LARGEST_BATCH = 1 << 21
"""Candidate pixels that are looked at together; bounds the memory."""

_TURN = math.radians(25.0)
_TILT = math.radians(15.0)
_LIGHT = np.array([0.4, 0.5, 0.77])
_PAPER = np.array([250, 249, 246], np.uint8)
_SURFACE = np.array([122.0, 166.0, 190.0])
_INK = (60, 60, 64)


def draw_levels(captioned: Sequence[tuple[str, Mesh]], path: Path) -> None:
    """Draw one tile a mesh, all in the scale of the last, with its caption below, into a PNG file.

    Raises:
        OSError: the file cannot be written; nothing is left behind.
    """
    columns = min(COLUMNS, len(captioned))
    rows = -(-len(captioned) // COLUMNS)
    sheet = np.broadcast_to(_PAPER, (rows * (TILE + _CAPTION), columns * TILE, 3)).copy()
    centre, scale = _frame(captioned[-1][1])
    for i, (caption, mesh) in enumerate(captioned):
        top, left = i // COLUMNS * (TILE + _CAPTION), i % COLUMNS * TILE
        sheet[top : top + TILE, left : left + TILE] = draw_mesh(mesh, centre, scale)
        indent = max(0, (TILE - text_width(caption)) // 2)
        baseline = top + TILE + (_CAPTION - ROWS) // 2
        draw_text(sheet[:, : left + TILE], caption, left + indent, baseline, colour=_INK)
    write_atomically(path, png(sheet))


def draw_mesh(mesh: Mesh, centre: NDArray[np.float64], scale: float) -> Image:
    """A (TILE, TILE, 3) picture of `mesh`; `centre`, turned, comes to its middle, `scale` is in pixels a unit."""
    side = TILE * _OVERSAMPLING
    turned = (_turned(mesh.vertices) - centre) * (scale * _OVERSAMPLING)
    points = np.stack([turned[:, 0] + side / 2, side / 2 - turned[:, 1], turned[:, 2]], axis=1)
    nearest = _nearest_faces(points, mesh.faces, side)
    corners = points[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * [1.0, -1.0, 1.0]
    lengths = np.linalg.norm(normals, axis=1)
    brightness = np.abs(normals @ (_LIGHT / np.linalg.norm(_LIGHT))) / np.where(lengths > 0.0, lengths, 1.0)
    colours = np.concatenate([_SURFACE * (0.35 + 0.8 * brightness[:, None]), _PAPER[None]])  # the last for no face
    fine = np.minimum(colours[nearest], 255.0)
    coarse: Image = fine.reshape(TILE, _OVERSAMPLING, TILE, _OVERSAMPLING, 3).mean(axis=(1, 3)).astype(np.uint8)
    return coarse


def png(image: Image) -> bytes:
    """An (h, w, 3) image as a PNG file."""
    height, width, _ = image.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), image.reshape(height, -1)], axis=1)  # filter 0: as it is
    header = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)  # 8 bits, RGB
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _turned(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions as seen from the front, a little from the right and from above; y is up, z towards the eye."""
    x, y, z = vertices.T
    x, z = x * math.cos(_TURN) - z * math.sin(_TURN), x * math.sin(_TURN) + z * math.cos(_TURN)
    y, z = y * math.cos(_TILT) - z * math.sin(_TILT), y * math.sin(_TILT) + z * math.cos(_TILT)
    return np.stack([x, y, z], axis=1)


def _frame(mesh: Mesh) -> tuple[NDArray[np.float64], float]:
    """The middle of the turned mesh, and pixels a unit so that it fits a tile."""
    turned = _turned(mesh.vertices)
    low, high = turned.min(axis=0), turned.max(axis=0)
    side = float((high - low)[:2].max())
    centre: NDArray[np.float64] = (low + high) / 2
    return centre, TILE * (1 - 2 * _MARGIN) / side if side > 0.0 else 1.0


def _nearest_faces(points: NDArray[np.float64], faces: NDArray[np.int64], side: int) -> NDArray[np.int64]:
    """(side, side) index of the face nearest to the eye at each pixel, -1 where there is none."""
    depth = np.full(side * side, -np.inf)
    nearest = np.full(side * side, -1, np.int64)
    for batch, span in _batches(points, faces):
        pixels, depths, owners = _covered(points[faces[batch]], batch, span, side)
        order = np.argsort(depths, kind="stable")  # the nearest comes last, and the last assignment stays
        pixels, depths, owners = pixels[order], depths[order], owners[order]
        nearer = depths > depth[pixels]
        depth[pixels[nearer]] = depths[nearer]
        nearest[pixels[nearer]] = owners[nearer]
    return nearest.reshape(side, side)


def _batches(points: NDArray[np.float64], faces: NDArray[np.int64]) -> Iterator[tuple[NDArray[np.int64], int]]:
    """Indices of faces whose bounding boxes have about the same size, and that size in pixels, a power of two."""
    if len(faces) == 0:
        return
    planar = points[faces, :2]
    extents = (np.floor(planar.max(axis=1)) - np.floor(planar.min(axis=1))).max(axis=1) + 1.0
    powers = np.ceil(np.log2(extents)).astype(np.int64)
    for power in np.unique(powers):
        span = 1 << int(power)
        members = np.flatnonzero(powers == power)
        count = max(1, _LARGEST_BATCH // (span * span))
        for start in range(0, len(members), count):
            yield members[start : start + count], span


def _covered(
    corners: NDArray[np.float64], owners: NDArray[np.int64], span: int, side: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Pixels whose centres lie in the triangles (n, 3, 3), the depths there, and the triangle of each."""
    steps = np.arange(span)
    start = np.floor(corners[:, :, :2].min(axis=1)).astype(np.int64)
    x = start[:, 0, None, None] + steps[None, None, :]
    y = start[:, 1, None, None] + steps[None, :, None]
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (corners[:, i, :, None, None].transpose(1, 0, 2, 3) for i in range(3))
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    inverse = 1.0 / np.where(area == 0.0, 1.0, area)
    px, py = x + 0.5, y + 0.5
    first = ((bx - px) * (cy - py) - (by - py) * (cx - px)) * inverse
    second = ((cx - px) * (ay - py) - (cy - py) * (ax - px)) * inverse
    third = 1.0 - first - second
    inside = (first >= 0.0) & (second >= 0.0) & (third >= 0.0) & (area != 0.0)
    inside &= (x >= 0) & (x < side) & (y >= 0) & (y < side)
    depth = first * az + second * bz + third * cz
    triangle = np.nonzero(inside)[0]
    pixel = np.broadcast_to(y * side + x, inside.shape)[inside]
    return pixel, depth[inside], owners[triangle]
