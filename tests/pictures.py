"""PNG files taken apart."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def unpacked(data: bytes) -> NDArray[np.uint8]:
    """The pixels (h, w, 3) of a PNG file, 8 bits a channel, whose rows are filtered by none, left or up."""
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    position, chunks = 8, {}
    while position < len(data):
        (length,) = struct.unpack_from(">I", data, position)
        kind, content = data[position + 4 : position + 8], data[position + 8 : position + 8 + length]
        assert struct.unpack_from(">I", data, position + 8 + length) == (zlib.crc32(kind + content),)
        chunks[kind] = content
        position += 12 + length
    width, height, *rest = struct.unpack(">2I5B", chunks[b"IHDR"])
    assert rest == [8, 2, 0, 0, 0]
    assert chunks[b"IEND"] == b""
    stored = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, 1 + 3 * width)
    image = np.zeros((height, width, 3), np.uint8)
    above = np.zeros((width, 3), np.uint8)
    for row, (kind, *_) in enumerate(stored):
        values = stored[row, 1:].reshape(width, 3)
        if kind == 1:
            values = np.cumsum(values, axis=0, dtype=np.uint8)
        elif kind == 2:
            values = values + above
        else:
            assert kind == 0
        image[row] = above = values
    return image


def png_size(data: bytes) -> tuple[int, int]:
    """Width and height of a PNG file of any kind."""
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    width, height = struct.unpack_from(">II", data, 16)
    return width, height
