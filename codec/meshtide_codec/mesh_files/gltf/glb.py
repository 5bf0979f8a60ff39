"""The frame of a GLB file: twelve bytes of header, a chunk of JSON, a chunk of bytes, others that nobody needs.

Format: Khronos, "glTF 2.0 Specification", section 4 (GLB File Format Specification).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from meshtide_codec.errors import MeshFileError

MAGIC = b"glTF"
VERSION = 2
_HEADER = struct.Struct("<4sII")
_CHUNK = struct.Struct("<I4s")
_JSON = b"JSON"
_BINARY = b"BIN\0"


@dataclass(frozen=True, slots=True)
class Frame:
    """What a GLB file holds.

    Args:
        text: its JSON, as bytes.
        binary: the bytes of its first buffer; None where it has no such chunk.
        rest: bytes after the end that its header gives.
    """

    text: bytes
    binary: memoryview | None
    rest: int = 0


def unpack(data: bytes | memoryview) -> Frame:
    """The chunks of a GLB file.

    Raises:
        MeshFileError: it is none, of another version, or cut short.

    >>> unpack(pack(b"{}", b"1234")).text
    b'{}  '
    """
    if len(data) < _HEADER.size:
        raise MeshFileError(f"the GLB file is cut short: it has {len(data)} bytes, its header alone takes 12")
    magic, version, length = _HEADER.unpack_from(data)
    if magic != MAGIC:
        raise MeshFileError("it is no GLB file: it does not begin with glTF")
    if version != VERSION:
        raise MeshFileError(f"the GLB file is of version {version}; version 2 is read. Convert it to glTF 2.0")
    if length > len(data):
        raise MeshFileError(f"the GLB file is cut short: it claims {length} bytes, but has {len(data)}")
    found: dict[bytes, memoryview] = {}
    place = _HEADER.size
    first = b""
    while place < length:
        if length - place < _CHUNK.size:
            raise MeshFileError(f"the GLB file is cut short: {length - place} bytes stand where a chunk would begin")
        size, kind = _CHUNK.unpack_from(data, place)
        place += _CHUNK.size
        if size > length - place:
            raise MeshFileError(
                f"the GLB file is cut short: a chunk at byte {place - _CHUNK.size} claims {size} bytes, "
                f"but {length - place} follow it"
            )
        first = first or kind
        found.setdefault(kind, memoryview(data)[place : place + size])
        place += size
    if first != _JSON:
        raise MeshFileError("the first chunk of the GLB file is not its JSON")
    return Frame(bytes(found[_JSON]), found.get(_BINARY), len(data) - length)


def pack(text: bytes, binary: bytes) -> bytes:
    """A GLB file of some JSON and, unless there are none, the bytes of its first buffer."""
    chunks = [(_JSON, text + b" " * (-len(text) % 4))]
    if binary:
        chunks.append((_BINARY, binary + bytes(-len(binary) % 4)))
    size = _HEADER.size + sum(_CHUNK.size + len(chunk) for _, chunk in chunks)
    if size >= 1 << 32:
        raise MeshFileError(f"a GLB file holds at most 4 GiB; this one would take {size} bytes. Write *.gltf")
    pieces = [_HEADER.pack(MAGIC, VERSION, size)]
    for kind, chunk in chunks:
        pieces += [_CHUNK.pack(len(chunk), kind), chunk]
    return b"".join(pieces)
