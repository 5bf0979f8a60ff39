"""Materials and images of a glTF file: kept as they are, never decoded; and the rest of its JSON.

Format: Khronos, "glTF 2.0 Specification", sections 3.8 (textures, images) and 3.9 (materials). An image that cannot be
had costs the mesh nothing: it is reported, and stays empty.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf.buffers import opened
from meshtide_codec.mesh_files.gltf.document import optional, text
from meshtide_codec.scene import Image, Material

if TYPE_CHECKING:
    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.gltf.buffers import Buffers
    from meshtide_codec.mesh_files.gltf.document import Document, Row
    from meshtide_codec.mesh_files.source import Source

_TAKEN_APART = frozenset(
    {
        "accessors",
        "animations",
        "bufferViews",
        "buffers",
        "extensionsRequired",
        "images",
        "materials",
        "meshes",
        "nodes",
        "scene",
        "scenes",
        "skins",
    }
)
_OF_IMAGES = frozenset({"name", "uri", "bufferView", "mimeType"})
_OF_NODES = frozenset({"name", "mesh", "skin", "weights", "children", "matrix", "translation", "rotation", "scale"})


def materials(document: Document) -> tuple[Material, ...]:
    """The materials of a file, their properties as they are."""
    rows = document.rows("materials")
    return tuple(Material(text(row, "name"), {key: row[key] for key in row if key != "name"}) for row in rows)


def images(document: Document, buffers: Buffers, source: Source, limits: FileLimits) -> tuple[Image, ...]:
    """The images of a file; what cannot be had is reported and stays empty.

    Views of images do not lie over one another, so all of them take no more than the buffers.

    Raises:
        MeshFileError: they claim more bytes than the file holds.
    """
    found: dict[object, bytes] = {}
    result, missing = [], 0
    of_views = of_files = 0
    for index, row in enumerate(document.rows("images")):
        where = f"images[{index}]"
        uri, view = row.get("uri"), optional(row, "bufferView", where)
        key: object = view if view is not None else uri if isinstance(uri, str) else None
        if key not in found:
            found[key] = _of_view(view, where, buffers) if view is not None else _beside(uri, where, source, limits)
            of_views += len(found[key]) if view is not None else 0
            of_files += len(found[key]) if view is None else 0
            if of_views > buffers.held() or of_files > limits.file_bytes:
                raise MeshFileError(
                    f"the images up to {where} claim {of_views + of_files} bytes, more than the file holds"
                )
        missing += not found[key]
        result.append(_image(row, found[key], uri))
    if missing:
        source.note(f"{missing} of {len(result)} images could not be had: left empty")
    return tuple(result)


def _of_view(view: int, where: str, buffers: Buffers) -> bytes:
    return buffers.view(view, where).tobytes()


def _beside(uri: object, where: str, source: Source, limits: FileLimits) -> bytes:
    if not isinstance(uri, str):
        return b""
    try:
        return opened(uri, source, limits, where) or b""
    except MeshFileError:  # elsewhere, or no name of a file
        return b""


def _image(row: Row, data: bytes, uri: object) -> Image:
    named = isinstance(uri, str) and uri[:5].lower() != "data:"
    kept: dict[str, Any] = {key: row[key] for key in row if key not in _OF_IMAGES}
    if named:
        kept["uri"] = uri
    name = text(row, "name") or (unquote(str(uri)) if named else "")
    return Image(name, data, text(row, "mimeType") or _mime_type(uri, data), kept)


def _mime_type(uri: object, data: bytes) -> str:
    if isinstance(uri, str) and uri[:5].lower() == "data:":
        return uri[5:].partition(",")[0].partition(";")[0]
    magics = {
        b"\x89PNG": "image/png",
        b"\xff\xd8\xff": "image/jpeg",
        b"RIFF": "image/webp",
        b"\xabKTX 20": "image/ktx2",
    }
    return next((kind for magic, kind in magics.items() if data.startswith(magic)), "")


def node_properties(row: Row, without: str) -> dict[str, Any]:
    """What a node says beside its place: all but the extension that was read."""
    kept = {key: row[key] for key in row if key not in _OF_NODES}
    extensions = {key: value for key, value in kept.pop("extensions", {}).items() if key != without}
    return kept | ({"extensions": extensions} if extensions else {})


def remaining(document: Document) -> dict[str, Any]:
    """The rest of the JSON: textures, samplers, cameras, extensions, extras."""
    return {key: value for key, value in document.root.items() if key not in _TAKEN_APART}
