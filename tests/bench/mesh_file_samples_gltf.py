"""GLB files that benches read: grids, as they are or compressed by meshopt, textures of one colour, chains of nodes.

Textures are small as files and large as pictures: who decodes them takes time and memory.
"""

from __future__ import annotations

import struct
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from gltf_files import GltfFile
from meshopt_streams import encoded_indices


def picture(side: int) -> bytes:
    """A PNG file of one colour."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    rows = zlib.compress((b"\0" + bytes(3 * side)) * side, 9)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def textured(count: int, side: int) -> GltfFile:
    """Triangles, each with a picture of its own."""
    file = GltfFile()
    position = file.accessor([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    coordinates = file.accessor([[0, 0], [1, 0], [0, 1]], "<f4")
    for index in range(count):
        file.add("images", {"bufferView": file.view(picture(side)), "mimeType": "image/png"})
        file.add("textures", {"source": index})
        file.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": index}}})
        file.mesh({"attributes": {"POSITION": position, "TEXCOORD_0": coordinates}, "material": index})
    return file.shown(*({"mesh": index} for index in range(count)))


def grid_faces(side: int) -> Any:
    """Triangles over side x side vertices."""
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1)
    lower = np.stack([corner, corner + side, corner + 1], axis=1)
    return np.concatenate([lower, np.stack([corner + 1, corner + side, corner + side + 1], axis=1)])


def grid(side: int, *, packed: bool) -> GltfFile:
    """A patch with normals; its indices compressed by meshopt, or as they are."""
    file = GltfFile()
    points = np.random.default_rng(0).random((side * side, 3))
    attributes = {"POSITION": file.accessor(points, "<f4"), "NORMAL": file.accessor(points, "<f4")}
    corners = grid_faces(side).reshape(-1)
    if packed:
        stream = encoded_indices(corners.tolist(), [0] * len(corners))
        row: dict[str, int | str] = {"buffer": 0, "byteOffset": len(file.binary), "byteLength": len(stream)}
        row |= {"byteStride": 4, "count": len(corners), "mode": "INDICES"}
        file.binary += stream + bytes(-len(stream) % 4)
        extensions = {"EXT_meshopt_compression": row}
        view = file.add("bufferViews", {"buffer": 1, "byteLength": 4 * len(corners), "extensions": extensions})
        indices = {"bufferView": view, "componentType": 5125, "count": len(corners), "type": "SCALAR"}
        file.mesh({"attributes": attributes, "indices": file.add("accessors", indices)})
        file.root["buffers"] = [{"byteLength": len(file.binary)}, {"byteLength": 4 * len(corners)}]
        file.root["extensionsRequired"] = file.root["extensionsUsed"] = list(extensions)
    else:
        file.mesh({"attributes": attributes, "indices": file.accessor(corners, "<u4")})
    return file.shown({"mesh": 0})


def chain(depth: int) -> GltfFile:
    """Nodes below one another, a triangle at the end."""
    file = GltfFile()
    file.mesh({"attributes": {"POSITION": file.accessor([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")}})
    nodes = [{"children": [index + 1], "translation": [0, 0, 1]} for index in range(depth)]
    file.root |= {"nodes": [*nodes, {"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}
    return file
