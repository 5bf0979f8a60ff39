"""glTF files for tests: built from arrays, legal ones and others; and read as the tests look at them."""

from __future__ import annotations

import base64
import json
import struct
import tracemalloc
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from meshtide_codec.errors import MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.read import mesh_of, read_source
from meshtide_codec.mesh_files.source import Source
from meshtide_codec.scene import Scene

if TYPE_CHECKING:
    from numpy.typing import NDArray

COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
PYRAMID = np.array([[0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0], [1, 1, 1.5]], "<f4")
AREA = 15.7111026
"""Of the pyramid."""
PYRAMID_FACES = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])


@dataclass
class GltfFile:
    """A file that grows; its JSON may be changed at will before it is packed."""

    root: dict[str, Any] = field(default_factory=lambda: {"asset": {"version": "2.0"}})
    binary: bytearray = field(default_factory=bytearray)

    def add(self, name: str, row: dict[str, Any]) -> int:
        self.root.setdefault(name, []).append(row)
        return len(self.root[name]) - 1

    def view(self, data: bytes, **more: Any) -> int:
        place = len(self.binary)
        self.binary += data + bytes(-len(data) % 4)
        return self.add("bufferViews", {"buffer": 0, "byteOffset": place, "byteLength": len(data), **more})

    def accessor(self, values: Any, dtype: str | None = None, stride: int = 0, **more: Any) -> int:
        """An accessor of values (n, c), or (n,) for numbers; with a stride its elements stand apart."""
        table = np.asarray(values, dtype)
        table = table[:, None] if table.ndim == 1 else table
        rows = np.ascontiguousarray(table).view(np.uint8).reshape(len(table), table.shape[1] * table.dtype.itemsize)
        if stride:
            rows = np.pad(rows, ((0, 0), (0, stride - rows.shape[1])), constant_values=0xEE)
        view = self.view(rows.tobytes(), **({"byteStride": stride} if stride else {}))
        return self.add("accessors", {"bufferView": view, **shape_of(table), **more})

    def mesh(self, *primitives: dict[str, Any], **more: Any) -> int:
        return self.add("meshes", {"primitives": list(primitives), **more})

    def shown(self, *nodes: dict[str, Any]) -> GltfFile:
        """The nodes, all of them roots of a scene."""
        added = [self.add("nodes", node) for node in nodes]
        self.root |= {"scene": 0, "scenes": [{"nodes": added}]}
        return self

    def glb(self) -> bytes:
        if self.binary:
            self.root.setdefault("buffers", [{"byteLength": len(self.binary)}])
        return glb(self.root, bytes(self.binary))

    def gltf(self, uri: str | None = None) -> bytes:
        """The JSON; the buffer as a data URI, or by the name of a file."""
        inline = "data:application/octet-stream;base64," + base64.b64encode(self.binary).decode()
        self.root["buffers"] = [{"byteLength": len(self.binary), "uri": uri or inline}]
        return json.dumps(self.root).encode()


def shape_of(table: NDArray[Any]) -> dict[str, Any]:
    return {"componentType": COMPONENTS[table.dtype.str[1:]], "count": len(table), "type": SHAPES[table.shape[1]]}


def glb(root: dict[str, Any] | bytes, binary: bytes = b"", *, version: int = 2, length: int | None = None) -> bytes:
    body = root if isinstance(root, bytes) else json.dumps(root).encode()
    body += b" " * (-len(body) % 4)
    chunks = struct.pack("<I4s", len(body), b"JSON") + body
    if binary:
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", version, 12 + len(chunks) if length is None else length) + chunks


def triangle_file(**changes: Any) -> GltfFile:
    """One triangle; keys of its JSON may be replaced."""
    file = GltfFile()
    file.mesh({"attributes": {"POSITION": file.accessor(TRIANGLE)}})
    file.shown({"mesh": 0})
    file.root |= changes
    return file


def pyramid_file(**changes: Any) -> GltfFile:
    """Six triangles on five vertices, indexed."""
    file = GltfFile()
    position, indices = file.accessor(PYRAMID), file.accessor(PYRAMID_FACES.reshape(-1), "<u2")
    file.mesh({"attributes": {"POSITION": position}, "indices": indices})
    file.shown({"mesh": 0})
    file.root |= changes
    return file


def read(
    data: bytes | GltfFile, suffix: str = ".glb", folder: Path | None = None, limits: FileLimits | None = None
) -> Scene:
    plain = data.glb() if isinstance(data, GltfFile) else data
    return read_source(Source("a" + suffix, suffix, plain, folder), limits or FileLimits())


def read_mesh(data: bytes | GltfFile, suffix: str = ".glb", folder: Path | None = None) -> Mesh:
    return mesh_of(read(data, suffix, folder)).mesh


def refusal_peak(data: bytes, message: str, limits: FileLimits | None = None) -> int:
    """The bytes that reading takes at most before the file is refused."""
    tracemalloc.start()
    try:
        with pytest.raises(MeshFileError, match=message):
            read(data, limits=limits)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def area(mesh: Mesh) -> float:
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(np.linalg.norm(across, axis=1).sum() / 2)


def volume(mesh: Mesh) -> float:
    """Above zero for a closed mesh whose faces look outward."""
    corners = mesh.vertices[mesh.faces]
    return float(np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6)
