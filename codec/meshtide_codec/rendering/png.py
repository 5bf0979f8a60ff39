"""PNG files, written with zlib alone; each row is stored as it is, or as differences to its left or upper neighbour.

Source: PNG specification (third edition), sections 9 and 12.8: the row filter with the least sum of absolute
differences.
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.rendering.lettering import Image

SIGNATURE = b"\x89PNG\r\n\x1a\n"
NONE, LEFT, UP = range(3)
"""Row filters, by the numbers that the format gives them."""

_EIGHT_BIT_RGB = (8, 2, 0, 0, 0)


def png(image: Image) -> bytes:
    """An (h, w, 3) uint8 image as a PNG file."""
    height, width, _ = image.shape
    rows = image.reshape(height, 3 * width)
    chunks = (
        (b"IHDR", struct.pack(">2I5B", width, height, *_EIGHT_BIT_RGB)),
        (b"IDAT", zlib.compress(_filtered(rows).tobytes(), 9)),
        (b"IEND", b""),
    )
    return SIGNATURE + b"".join(_chunk(kind, data) for kind, data in chunks)


def _filtered(rows: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(h, 1 + 3 w): the number of each row's filter, and the filtered row."""
    left = rows.copy()
    left[:, 3:] -= rows[:, :-3]
    up = rows.copy()
    up[1:] -= rows[:-1]
    candidates = np.stack([rows, left, up])
    sums = np.abs(candidates.view(np.int8).astype(np.int64)).sum(axis=2)
    best = sums.argmin(axis=0)
    chosen = candidates[best, np.arange(len(rows))]
    return np.concatenate([best.astype(np.uint8)[:, None], chosen], axis=1)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
