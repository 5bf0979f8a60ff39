"""GLB: its frame, its JSON and what that would have a reader allocate, all before a mesh is made.

Format: Khronos, "glTF 2.0 Specification", sections 3.6 (buffers, views, accessors) and 4.4 (GLB). Refused are files
that name other files, JSON that is huge or endlessly nested, accessors that claim more than their buffers hold, node
graphs that are no trees (each level showing the next one twice makes 2^n copies), and more copies than the limits take.
"""

from __future__ import annotations

import json
import os
import struct
from typing import TYPE_CHECKING, Any, BinaryIO

from meshtide_codec.errors import MeshFileError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from meshtide_server.upload_checks.limits import UploadLimits

LARGEST_JSON = 1 << 23
"""Bytes; a megabyte describes thousands of parts."""
LARGEST_LIST = 1 << 20
_HEADER = struct.Struct("<4sII")
_CHUNK = struct.Struct("<I4s")
_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_CORNERS = 3
_COMPRESSIONS = frozenset({"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"})
"""They claim counts that no buffer has to hold."""


def check_glb(file: BinaryIO, size: int, limits: UploadLimits) -> None:
    """Check an uploaded GLB file of `size` bytes.

    Raises:
        MeshFileError: it is none, is cut off, names other files, or claims too much.
    """
    document, binary_bytes = _chunks(file, size)
    _refuse_compression(_strings(document, "extensionsUsed"))
    _check_uris(document)
    buffers = [_count(buffer, "byteLength") for buffer in _list(document, "buffers")]
    if sum(buffers) > binary_bytes + LARGEST_JSON:  # small ones may stand in the JSON, as data: URIs
        raise MeshFileError(f"the GLB file claims {sum(buffers)} bytes of buffers, but holds {binary_bytes}")
    counts = _accessor_counts(document, buffers)
    sizes = [_mesh_counts(mesh, counts) for mesh in _list(document, "meshes")]
    vertices, faces = (sum(column) for column in zip((0, 0), *sizes, strict=True))
    limits.check_counts(vertices, faces)
    shown = list(_shown_meshes(document))
    for mesh in shown:
        if mesh >= len(sizes):
            raise MeshFileError(f"a node shows mesh {mesh}; the GLB file has {len(sizes)}")
    limits.check_counts(sum(sizes[mesh][0] for mesh in shown), sum(sizes[mesh][1] for mesh in shown))


def _chunks(file: BinaryIO, size: int) -> tuple[dict[str, Any], int]:
    """The JSON, and how many bytes of other chunks there are."""
    head = file.read(_HEADER.size + _CHUNK.size)
    if len(head) < _HEADER.size + _CHUNK.size:
        raise MeshFileError("the GLB file ends within its header")
    magic, version, length = _HEADER.unpack_from(head)
    json_bytes, kind = _CHUNK.unpack_from(head, _HEADER.size)
    if magic != b"glTF" or version != 2 or kind != b"JSON":
        raise MeshFileError("the file is not a GLB file of version 2")
    if length != size or json_bytes > size - len(head):
        raise MeshFileError(f"the GLB file claims {length} bytes, {json_bytes} of them JSON, but has {size}")
    if json_bytes > LARGEST_JSON:
        raise MeshFileError(f"the GLB file has {json_bytes} bytes of JSON; {LARGEST_JSON} are the most that is read")
    try:
        document = json.loads(file.read(json_bytes))
    except (ValueError, RecursionError) as error:
        raise MeshFileError(f"the JSON of the GLB file cannot be read: {str(error)[:100]}") from error
    if not isinstance(document, dict):
        raise MeshFileError("the JSON of the GLB file is not an object")
    return document, _chunk_bytes(file, size)


def _chunk_bytes(file: BinaryIO, size: int) -> int:
    """How many bytes the chunks hold that follow; the reader would ask for as much memory as each one claims."""
    total = 0
    while len(head := file.read(_CHUNK.size)) == _CHUNK.size:
        length, _ = _CHUNK.unpack(head)
        if length > size - file.tell():
            raise MeshFileError(f"a chunk of the GLB file claims {length} bytes, but {size - file.tell()} follow it")
        file.seek(length, os.SEEK_CUR)
        total += length
    return total


def _refuse_compression(extensions: object) -> None:
    """Refuse the names of compressions in a list or an object, which may stand where nothing announces them."""
    for extension in extensions if isinstance(extensions, list | dict) else ():
        if isinstance(extension, str) and extension in _COMPRESSIONS:
            raise MeshFileError(f"the GLB file is compressed by {extension}, which is not read here; save it without")


def _check_uris(document: dict[str, Any]) -> None:
    for name in ("buffers", "images"):
        for index, row in enumerate(_list(document, name)):
            uri = row.get("uri", "data:")
            if not isinstance(uri, str) or not uri.startswith("data:"):
                raise MeshFileError(f"{name}[{index}] of the GLB file names another file; put everything into one file")


def _accessor_counts(document: dict[str, Any], buffers: list[int]) -> list[int]:
    """How many elements each accessor has; each lies within its buffer view, and each view within its buffer."""
    views = []
    for index, view in enumerate(_list(document, "bufferViews")):
        _refuse_compression(view.get("extensions", ()))
        buffer, end = _count(view, "buffer"), _count(view, "byteOffset") + _count(view, "byteLength")
        if buffer >= len(buffers) or end > buffers[buffer]:
            raise MeshFileError(f"bufferViews[{index}] of the GLB file lies outside of its buffer")
        views.append((_count(view, "byteLength"), _count(view, "byteStride")))
    counts = []
    for index, accessor in enumerate(_list(document, "accessors")):
        count, place = _count(accessor, "count"), _count(accessor, "bufferView", len(views))
        component, shape = _count(accessor, "componentType"), str(accessor.get("type"))
        if component not in _COMPONENT_BYTES or shape not in _COMPONENTS:
            raise MeshFileError(f"accessors[{index}] of the GLB file is of an unknown type")
        if place >= len(views):
            raise MeshFileError(f"accessors[{index}] of the GLB file has no buffer view, so no bytes stand behind it")
        element = _COMPONENT_BYTES[component] * _COMPONENTS[shape]
        length, stride = views[place]
        needed = (count - 1) * max(stride, element) + element if count else 0
        if _count(accessor, "byteOffset") + needed > length:
            raise MeshFileError(f"accessors[{index}] of the GLB file claims {count} elements, more than its view holds")
        counts.append(count)
    return counts


def _mesh_counts(mesh: dict[str, Any], counts: list[int]) -> tuple[int, int]:
    """Vertices and faces of one mesh; primitives that share vertices are given a copy each, as the reader does."""
    vertices = faces = 0
    for primitive in _list(mesh, "primitives"):
        _refuse_compression(primitive.get("extensions", ()))
        attributes = primitive.get("attributes")
        if not isinstance(attributes, dict):
            raise MeshFileError("a primitive of the GLB file has no attributes")
        positions = _element_count(counts, _count(attributes, "POSITION", len(counts)))
        corners = _element_count(counts, _count(primitive, "indices")) if "indices" in primitive else positions
        vertices += positions
        strip = _count(primitive, "mode", 4) in {5, 6}
        faces += max(0, corners - 2) if strip else corners // _CORNERS
    return vertices, faces


def _element_count(counts: list[int], index: int) -> int:
    if index >= len(counts):
        raise MeshFileError(f"the GLB file uses accessor {index}, but has {len(counts)}")
    return counts[index]


def _shown_meshes(document: dict[str, Any]) -> Iterator[int]:
    """The mesh of each node that has one; a node has at most one parent, so each is shown once for each scene."""
    nodes = _list(document, "nodes")
    parents: dict[int, int] = {}
    for index, node in enumerate(nodes):
        children = node.get("children", [])
        if not isinstance(children, list):
            raise MeshFileError(f"nodes[{index}] of the GLB file has children that are no list")
        for child in children:
            if not isinstance(child, int) or not 0 <= child < len(nodes):
                raise MeshFileError(f"nodes[{index}] of the GLB file has a child that is no node")
            if child in parents:
                raise MeshFileError(f"nodes[{child}] of the GLB file has two parents; nodes must form trees")
            parents[child] = index
        if "mesh" in node:
            yield _count(node, "mesh")
    _check_no_circle(parents, len(nodes))


def _check_no_circle(parents: dict[int, int], count: int) -> None:
    """With one parent each at most, going up from every node ends, or there is a circle; each is passed once."""
    ends = [False] * count
    for start in range(count):
        path: set[int] = set()
        node: int | None = start
        while node is not None and not ends[node]:
            if node in path:
                raise MeshFileError(f"nodes[{node}] of the GLB file is its own ancestor; nodes must form trees")
            path.add(node)
            node = parents.get(node)
        for passed in path:
            ends[passed] = True


def _list(row: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """A list of objects."""
    value = row.get(name, [])
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        raise MeshFileError(f"{name} of the GLB file is not a list of objects")
    if len(value) > LARGEST_LIST:
        raise MeshFileError(f"the GLB file has {len(value)} {name}; {LARGEST_LIST} are the most that is read")
    return value


def _strings(row: dict[str, Any], name: str) -> list[str]:
    value = row.get(name, [])
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise MeshFileError(f"{name} of the GLB file is not a list of names")
    return value


def _count(row: dict[str, Any], name: str, default: int = 0) -> int:
    """A number from 0 on."""
    value = row.get(name, default)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 1 << 53:
        raise MeshFileError(f"{name} of the GLB file is not a number from 0 on: {str(value)[:50]}")
    return value
