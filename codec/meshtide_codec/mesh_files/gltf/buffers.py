"""The bytes of a glTF file: its buffers, wherever they are, and the views into them, compressed or not.

Format: Khronos, "glTF 2.0 Specification", sections 3.6.1 (buffers and buffer views) and 4.4.3 (the buffer of a GLB
file); RFC 2397 (data URIs), RFC 3986 (percent encoding). Buffers are opened when something asks for them, so what
nobody needs may be missing. What a file makes out of less than it holds (compressed views, accessors without bytes) is
taken from one budget.
"""

from __future__ import annotations

import base64
import binascii
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING
from urllib.parse import unquote, unquote_to_bytes

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf.document import integer, shown
from meshtide_codec.mesh_files.gltf.meshopt import is_fallback, packed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.gltf.document import Document, Row
    from meshtide_codec.mesh_files.gltf.meshopt import PackedView
    from meshtide_codec.mesh_files.source import Source

_FREE_EXPANSION = 1 << 24
_LARGEST_EXPANSION = 100
"""A file may grow to 16 MiB, or to a hundred times its size."""
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


@dataclass(slots=True)
class Buffers:
    """The buffers and buffer views of a file.

    Args:
        document: its JSON.
        binary: the bytes of the first buffer that a GLB file holds itself.
        source: the file, which may have others beside it.
        limits: how large they may be.
    """

    document: Document
    binary: memoryview | None
    source: Source
    limits: FileLimits
    _buffers: dict[int, NDArray[np.uint8]] = field(default_factory=dict)
    _beside: dict[str, NDArray[np.uint8]] = field(default_factory=dict)
    _views: dict[int, NDArray[np.uint8]] = field(default_factory=dict)
    _extents: dict[int, tuple[int, int]] = field(default_factory=dict)
    _held: int = 0
    _made: int = 0

    def view(self, index: int, where: str) -> NDArray[np.uint8]:
        """The bytes of a buffer view, not copied unless they are compressed.

        Raises:
            MeshFileError: there is no such view, its bytes are missing, or it is damaged.
        """
        if index not in self._views:
            self._views[index] = self._view(index, where)
        return self._views[index]

    def _view(self, index: int, where: str) -> NDArray[np.uint8]:
        row = self.document.row("bufferViews", index, where)
        place = f"bufferViews[{index}]"
        compressed = packed(row, place)
        length = _length(row, compressed, place)
        if compressed is None:
            return self._part(integer(row, "buffer", place), integer(row, "byteOffset", place, 0), length, place)
        data = self._part(compressed.buffer, compressed.offset, compressed.length, f"{compressed.name} of {place}")
        self.take(length, f"{compressed.name} of {place}")
        return compressed.decoded(data)

    def extent(self, index: int, where: str) -> tuple[int, int]:
        """The bytes of a buffer view, and those from one element to the next, or 0 where they stand close.

        Raises:
            MeshFileError: there is no such view, or it contradicts itself.
        """
        if index not in self._extents:
            row, place = self.document.row("bufferViews", index, where), f"bufferViews[{index}]"
            length = _length(row, packed(row, place), place)
            self._extents[index] = length, integer(row, "byteStride", place, 0)
        return self._extents[index]

    def take(self, size: int, what: str) -> None:
        """Take bytes that the file does not hold from what it may make.

        Raises:
            MeshFileError: it is more than a hundred times the file, or more than the limits allow.
        """
        held = self._held + len(self.source.content)
        most = min(self.limits.file_bytes, max(_FREE_EXPANSION, _LARGEST_EXPANSION * held))
        if size > most - self._made:
            raise MeshFileError(f"{what} makes {size} bytes, more than a file of {held} bytes may")
        self._made += size

    def held(self) -> int:
        """Bytes of the buffers that were opened."""
        return sum(map(len, self._buffers.values()))

    def _part(self, index: int, offset: int, length: int, place: str) -> NDArray[np.uint8]:
        data = self.buffer(index, place)
        if offset + length > len(data):
            raise MeshFileError(
                f"{place} lies outside of its buffer: it ends at byte {offset + length}, "
                f"but buffers[{index}] has {len(data)}"
            )
        return data[offset : offset + length]

    def buffer(self, index: int, where: str) -> NDArray[np.uint8]:
        """All bytes of a buffer.

        Raises:
            MeshFileError: they are missing, or fewer than the JSON claims.
        """
        if index not in self._buffers:
            row = self.document.row("buffers", index, where)
            place = f"buffers[{index}]"
            length = integer(row, "byteLength", place)
            data = self._opened(index, row, place)
            if len(data) < length:
                raise MeshFileError(f"{place} is cut short: it claims {length} bytes, but holds {len(data)}")
            self._buffers[index] = data[:length]
        return self._buffers[index]

    def _opened(self, index: int, row: Row, place: str) -> NDArray[np.uint8]:
        uri = row.get("uri")
        if uri is None:
            if index == 0 and self.binary is not None:
                return np.frombuffer(self.binary, np.uint8)
            why = "stands for readers without the compression" if is_fallback(row, place) else "names no file"
            raise MeshFileError(f"{place} has no bytes: it {why}")
        if not isinstance(uri, str):
            raise MeshFileError(f"uri of {place} is not a text: {shown(uri)}")
        if uri not in self._beside:
            data = opened(uri, self.source, self.limits, place)
            if data is None:
                raise MeshFileError(f"{place} is not there: the file '{shown(unquote(uri))}' beside {self.source.name}")
            self._held += 0 if uri.startswith("data:") else len(data)
            if self._held > self.limits.file_bytes:
                raise MeshFileError(f"the buffers take more than the {self.limits.file_bytes} bytes that are read")
            self._beside[uri] = np.frombuffer(data, np.uint8)
        return self._beside[uri]


def _length(row: Row, compressed: PackedView | None, place: str) -> int:
    length = integer(row, "byteLength", place)
    if compressed is not None and compressed.count * compressed.stride != length:
        raise MeshFileError(
            f"{compressed.name} of {place} holds {compressed.count} elements of {compressed.stride} bytes, "
            f"but the view has {length}"
        )
    return length


def opened(uri: str, source: Source, limits: FileLimits, place: str) -> bytes | None:
    """The bytes that a URI stands for: in itself, or in a file beside; None where that file is not there.

    Raises:
        MeshFileError: it leads elsewhere, or cannot be read.
    """
    if uri[:5].lower() == "data:":
        return _data(uri, place)
    if _SCHEME.match(uri):
        raise MeshFileError(f"{place} names '{shown(uri)}'; only files beside {source.name} are read")
    for name in dict.fromkeys((unquote(uri), uri)):
        data = source.beside(name, limits)
        if data is not None:
            return data
    return None


def _data(uri: str, place: str) -> bytes:
    head, comma, body = uri.partition(",")
    if not comma:
        raise MeshFileError(f"{place} has a data URI without data")
    try:
        plain = unquote_to_bytes(body)
        if not head.lower().endswith(";base64"):
            return plain
        plain = b"".join(plain.split()).rstrip(b"=")
        return base64.b64decode(plain + b"=" * (-len(plain) % 4), validate=True)
    except (binascii.Error, ValueError) as error:
        raise MeshFileError(f"{place} has a data URI that is not base64") from error
