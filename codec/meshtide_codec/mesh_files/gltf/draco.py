"""A primitive that KHR_draco_mesh_compression holds, decoded by DracoPy.

Format: Khronos, "KHR_draco_mesh_compression"; Google, "Draco Bitstream Specification", sections on the header, metadata
and connectivity, whose counts are held against the limits before the library is asked for anything.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf.extensions import DRACO

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

REMEDY = "install it: pip install 'meshtide[gltf]'"
_MAGIC = b"DRACO"
_METADATA = 0x8000
_DEEPEST = 16


@dataclass(frozen=True, slots=True)
class DracoMesh:
    """What a Draco stream holds.

    Args:
        faces: (m, 3) int64.
        attributes: values (n, c) by the stream's numbers of attributes.
    """

    faces: NDArray[np.int64]
    attributes: Mapping[int, NDArray[Any]]


def is_available() -> bool:
    """Whether the library is installed."""
    try:
        import DracoPy  # noqa: F401, PLC0415 - an extra
    except ImportError:
        return False
    return True


def counts(data: bytes) -> tuple[int, int]:
    """The vertices and faces that a stream claims.

    Raises:
        MeshFileError: it is none of a mesh, or ends within its header.
    """
    reader = _Reader(data)
    if reader.taken(5) != _MAGIC:
        raise MeshFileError(f"a stream of {DRACO} does not begin with DRACO")
    major, minor, kind, method = reader.taken(4)
    flags = int.from_bytes(reader.taken(2), "little")
    if kind != 1 or method > 1 or major not in {1, 2}:
        raise MeshFileError(f"a stream of {DRACO} is not a mesh, or of unknown version {major}.{minor}")
    if flags & _METADATA:
        reader.skip_metadata()
    version = (major, minor)
    if method == 0:  # sequential
        number = reader.word if version < (2, 2) else reader.number
        faces = number()
        return number(), faces
    reader.taken(1)  # the kind of its traversal
    number = reader.word if version < (2, 0) else reader.number
    if version < (2, 2):
        number()  # vertices that splits make
    return number(), number()


def decode(data: bytes) -> DracoMesh:
    """What a stream holds; its counts have been held against the limits.

    Raises:
        MeshFileError: the library is missing, or the stream is damaged; the message names the extension.
    """
    try:
        import DracoPy  # noqa: PLC0415 - an extra
    except ImportError:
        raise MeshFileError(f"the file is compressed by {DRACO}, which DracoPy decodes; {REMEDY}") from None
    try:
        decoded: Any = DracoPy.decode(data)
        faces = np.asarray(decoded.faces)
        attributes = {int(one["unique_id"]): np.asarray(one["data"]) for one in decoded.attributes}
    except MemoryError:
        raise
    except Exception as error:  # the library raises whatever its decoder meets
        raise MeshFileError(f"a stream of {DRACO} is damaged: DracoPy cannot decode it") from error
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise MeshFileError(f"a stream of {DRACO} holds no triangles")
    tables = {key: one.reshape(len(one), -1) for key, one in attributes.items() if one.ndim in {1, 2}}
    return DracoMesh(faces.astype(np.int64), tables)


class _Reader:
    """Goes through the head of a stream."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.place = 0

    def taken(self, size: int) -> bytes:
        part = self.data[self.place : self.place + size]
        if len(part) < size:
            raise MeshFileError(f"a stream of {DRACO} is cut short within its header")
        self.place += size
        return part

    def word(self) -> int:
        return int.from_bytes(self.taken(4), "little")

    def number(self) -> int:
        value = 0
        for shift in range(0, 70, 7):
            byte = self.taken(1)[0]
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
        raise MeshFileError(f"a stream of {DRACO} has a number that does not end")

    def skip_metadata(self) -> None:
        for _ in range(self.number()):
            self.number()
            self._skip_element(0)
        self._skip_element(0)

    def _skip_element(self, depth: int) -> None:
        if depth > _DEEPEST:
            raise MeshFileError(f"a stream of {DRACO} has metadata nested more than {_DEEPEST} times")
        for _ in range(self.number()):
            self.taken(self.taken(1)[0])
            self.taken(self.number())
        for _ in range(self.number()):
            self.taken(self.taken(1)[0])
            self._skip_element(depth + 1)
