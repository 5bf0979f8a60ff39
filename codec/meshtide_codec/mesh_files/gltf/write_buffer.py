"""The one buffer of a glTF file that is written, and the views and accessors into it.

Format: Khronos, "glTF 2.0 Specification", section 3.6.2.4 (alignment): all begins at a multiple of four bytes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_VERTICES, _INDICES = 34962, 34963
_LARGEST_SHORT = 0xFFFE
"""The largest index that two bytes take; the next one would restart strips."""


@dataclass(slots=True)
class Buffer:
    """Bytes that grow, with what points into them."""

    views: list[dict[str, Any]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)
    _pieces: list[bytes] = field(default_factory=list)
    _size: int = 0

    def data(self) -> bytes:
        """All bytes so far."""
        return b"".join(self._pieces)

    def view(self, data: bytes, **more: object) -> int:
        """A buffer view of some bytes, by its index."""
        self.views.append({"buffer": 0, "byteOffset": self._size, "byteLength": len(data), **more})
        padded = data + bytes(-len(data) % 4)
        self._pieces.append(padded)
        self._size += len(padded)
        return len(self.views) - 1

    def vertices(self, values: NDArray[Any], *, normalized: bool = False, bounds: bool = False) -> int:
        """An accessor of values (n, c) of vertices, with their bounds where they are asked for."""
        row_bytes = values.dtype.itemsize * values.shape[1]
        padding = -row_bytes % 4
        rows = np.ascontiguousarray(values, values.dtype.newbyteorder("<")).view(np.uint8).reshape(len(values), -1)
        padded = np.pad(rows, ((0, 0), (0, padding)))
        more = {"byteStride": row_bytes + padding} if padding else {}
        accessor = self._accessor(self.view(padded.tobytes(), target=_VERTICES, **more), values)
        if normalized:
            accessor["normalized"] = True
        if bounds:
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def indices(self, faces: NDArray[np.int64]) -> int:
        """An accessor of the corners of faces (m, 3), in as few bytes as they fit."""
        dtype = "<u2" if faces.max() <= _LARGEST_SHORT else "<u4"
        corners = faces.reshape(-1, 1).astype(dtype)
        self.accessors.append(self._accessor(self.view(corners.tobytes(), target=_INDICES), corners))
        return len(self.accessors) - 1

    @staticmethod
    def _accessor(view: int, values: NDArray[Any]) -> dict[str, Any]:
        component = _COMPONENTS[values.dtype.str[1:]]
        return {
            "bufferView": view,
            "componentType": component,
            "count": len(values),
            "type": _SHAPES[values.shape[1]],
        }
