"""From a scene to a GLB file, or to a glTF file with its buffer and images beside it.

Format: Khronos, "glTF 2.0 Specification". The same scene gives the same bytes. Instances are written as nodes, which
every reader knows.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.formats import Written
from meshtide_codec.mesh_files.gltf.extensions import GEOMETRIC, QUANTIZATION
from meshtide_codec.mesh_files.gltf.glb import pack
from meshtide_codec.mesh_files.gltf.write_buffer import Buffer
from meshtide_codec.mesh_files.gltf.write_vertices import Losses, Part, parts
from meshtide_codec.mesh_files.not_kept import not_kept
from meshtide_codec.mesh_files.source import format_suffix

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_codec.attributes import Attribute
    from meshtide_codec.scene import Image, Material, Node, Scene

_OF_MATERIALS = frozenset(
    {
        "alphaCutoff",
        "alphaMode",
        "doubleSided",
        "emissiveFactor",
        "emissiveTexture",
        "extensions",
        "extras",
        "normalTexture",
        "occlusionTexture",
        "pbrMetallicRoughness",
    }
)
_POINTING = frozenset({"accessor", "accessors", "bufferView", "bufferViews", "node", "nodes", "propertyTables"})
"""Keys of extensions that point to what is numbered anew."""
_KEPT = ("asset", "textures", "samplers", "cameras", "extensions", "extras", "extensionsUsed")
_PICTURES = {"image/png": ".png", "image/jpeg": ".jpg", "image/webp": ".webp", "image/ktx2": ".ktx2"}


def write_gltf(scene: Scene, name: str) -> Written:
    """A scene as GLB or glTF, by the suffix of its name.

    Wedges become vertices, polygons triangles, positions 32-bit floats; what that loses is reported.

    Raises:
        MeshFileError: there is nothing in it, or something that glTF cannot hold.
    """
    is_glb = format_suffix(name) != ".gltf"
    writing = _Writing(scene, PurePosixPath(name).stem, is_glb=is_glb)
    root = writing.document()
    data = writing.buffer.data()
    if data:
        root["buffers"] = [{"byteLength": len(data)}]
    if data and not is_glb:
        root["buffers"][0]["uri"] = quote(f"{writing.stem}.bin")
        writing.companions[f"{writing.stem}.bin"] = data
    try:
        text = json.dumps(root, separators=(",", ":"), allow_nan=False).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise MeshFileError("what the scene keeps beside its geometry cannot be written as JSON") from error
    lost = not_kept(scene, writing.losses.attributes, kept=["materials", "images", "nodes", "cameras"])
    return Written(pack(text, data) if is_glb else text, writing.companions, (*lost, *writing.losses.notes()))


@dataclass(slots=True)
class _Writing:
    """The parts of the file as they grow."""

    scene: Scene
    stem: str
    is_glb: bool
    buffer: Buffer = field(default_factory=Buffer)
    companions: dict[str, bytes] = field(default_factory=dict)
    losses: Losses = field(default_factory=Losses)
    quantized: bool = False

    def document(self) -> dict[str, Any]:
        """The JSON without its buffers."""
        scene = self.scene
        root = {key: scene.document[key] for key in _KEPT if key in scene.document}
        asset = root.get("asset", {})
        root["asset"] = {**(asset if isinstance(asset, dict) else {}), "version": "2.0", "generator": "meshtide"}
        root["asset"].pop("minVersion", None)
        meshes: list[dict[str, Any]] = []
        numbers: list[int | None] = []
        for index in range(len(scene.geometries)):
            mesh = self._mesh(index)
            numbers.append(None if mesh is None else len(meshes))
            meshes += [] if mesh is None else [mesh]
        if not meshes:
            raise MeshFileError("there are no vertices in it, so there is nothing to write")
        nodes = self._nodes(numbers)
        lists = {
            "scenes": [{"nodes": list(scene.roots)}] if scene.roots else [],
            "nodes": nodes,
            "meshes": meshes,
            "materials": [_material(one) for one in scene.materials],
            "images": [self._image(index, one) for index, one in enumerate(scene.images)],
            "accessors": self.buffer.accessors,
            "bufferViews": self.buffer.views,
        }
        root |= {key: value for key, value in lists.items() if value}
        if scene.roots:
            root["scene"] = 0
        self._write_extensions(root)
        return root

    def _write_extensions(self, root: dict[str, Any]) -> None:
        """Drop extensions that point to what is numbered anew, and say which ones are used."""
        extensions = root.pop("extensions", {})
        extensions = extensions if isinstance(extensions, dict) else {}
        lost = sorted(name for name, value in extensions.items() if _points(value))
        if lost:
            self.losses.lines[f"{', '.join(lost)}: left out, as it points into the file that was read"] = None
        kept = {name: value for name, value in extensions.items() if name not in lost}
        named = root.pop("extensionsUsed", [])
        gone = {*GEOMETRIC, *lost}
        used = [name for name in named if isinstance(name, str) and name not in gone] if isinstance(named, list) else []
        if self.quantized:
            used.append(QUANTIZATION)
            root["extensionsRequired"] = [QUANTIZATION]
        if kept:
            root["extensions"] = kept
        if used:
            root["extensionsUsed"] = list(dict.fromkeys(used))

    def _mesh(self, index: int) -> dict[str, Any] | None:
        mesh = self.scene.geometries[index]
        if len(mesh.vertices) == 0:
            return None
        name = self.scene.names[index] if index < len(self.scene.names) else ""
        found = parts(mesh, f"geometry {index}", self.losses)
        primitives = [primitive for part in found for primitive in self._primitives(part)]
        return {**self._rest_of_mesh(index), **({"name": name} if name else {}), "primitives": primitives}

    def _rest_of_mesh(self, index: int) -> dict[str, Any]:
        """The extras of the mesh of a geometry, and its extensions but for those that point elsewhere."""
        rests = self.scene.document.get("meshes", ())
        rest = rests[index] if isinstance(rests, list) and index < len(rests) else {}
        return {key: value for key, value in rest.items() if not _points(value)} if isinstance(rest, dict) else {}

    def _primitives(self, part: Part) -> list[dict[str, Any]]:
        """The primitives on the vertices of a part: they share its accessors."""
        attributes = {"POSITION": self.buffer.vertices(part.positions, bounds=True)}
        for one in part.attributes:
            attributes[one.name] = self.buffer.vertices(one.values, normalized=one.normalized)
            self.quantized |= _needs_quantization(one)
        result: list[dict[str, Any]] = []
        for material, faces in part.primitives:
            primitive: dict[str, Any] = {"attributes": attributes}
            primitive |= {"indices": self.buffer.indices(faces)} if len(faces) else {"mode": 0}
            if 0 <= material < len(self.scene.materials):
                primitive["material"] = material
            result.append(primitive)
        return result

    def _nodes(self, numbers: Sequence[int | None]) -> list[dict[str, Any]]:
        nodes = [_node(node) for node in self.scene.nodes]
        for row, node in zip(list(nodes), self.scene.nodes, strict=True):
            mesh = None if node.geometry is None else numbers[node.geometry]
            if mesh is None:
                continue
            if node.instances is None:
                row["mesh"] = mesh
                continue
            copies = [{"mesh": mesh, **_placed(matrix)} for matrix in node.instances]
            if copies:
                row["children"] = [*node.children, *range(len(nodes), len(nodes) + len(copies))]
                nodes += copies
        return nodes

    def _image(self, index: int, image: Image) -> dict[str, Any]:
        row = {key: value for key, value in image.properties.items() if key not in {"uri", "bufferView"}}
        if image.name:
            row["name"] = image.name
        if not image.data:
            missing = image.properties.get("uri")
            return {**row, "uri": missing if isinstance(missing, str) else quote(image.name or f"image{index}")}
        kind = image.mime_type or "image/png"
        if self.is_glb:
            return {**row, "bufferView": self.buffer.view(image.data), "mimeType": kind}
        file = f"{self.stem}.image{index}{_PICTURES.get(kind, '.image')}"
        self.companions[file] = image.data
        return {**row, "uri": quote(file), "mimeType": kind}


def _needs_quantization(attribute: Attribute) -> bool:
    """Whether integers stand where glTF alone has floats."""
    if attribute.values.dtype.kind == "f":
        return False
    family = attribute.name.partition("_")[0]
    unsigned = attribute.values.dtype.kind == "u" and attribute.normalized
    return family in {"NORMAL", "TANGENT"} or (family == "TEXCOORD" and not unsigned)


def _node(node: Node) -> dict[str, Any]:
    row = dict(node.properties)
    if node.name:
        row["name"] = node.name
    row |= _placed(node.matrix)
    if node.children:
        row["children"] = list(node.children)
    return row


def _placed(matrix: NDArray[np.float64]) -> dict[str, Any]:
    """The matrix of a node as its JSON has it, by columns; nothing for the identity."""
    return {} if np.array_equal(matrix, np.eye(4)) else {"matrix": matrix.T.reshape(-1).tolist()}


def _material(material: Material) -> dict[str, Any]:
    row = {key: value for key, value in material.properties.items() if key in _OF_MATERIALS}
    others = {key: value for key, value in material.properties.items() if key not in _OF_MATERIALS}
    if others:
        extras = row.get("extras", {})
        row["extras"] = {**(extras if isinstance(extras, dict) else {"extras": extras}), **others}
    return {**({"name": material.name} if material.name else {}), **row}


def _points(value: object) -> bool:
    """Whether JSON has a key, however deep, that points to what is numbered anew."""
    waiting: list[Any] = [value]
    while waiting:
        item = waiting.pop()
        if isinstance(item, dict):
            if item.keys() & _POINTING:
                return True
            waiting += item.values()
        elif isinstance(item, list):
            waiting += item
    return False
