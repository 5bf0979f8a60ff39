"""A scene as a PLY file: binary, little endian, positions in double precision, attributes in their own types.

Values of vertices and faces become properties under the names that other programs know (`attributes`), texture
coordinates of corners a list of each face as MeshLab writes them, textures comments. Values of corners that are the
same all around a vertex become those of the vertex. The same scene gives the same bytes. Cost: linear in the mesh.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.attributes import LOWER_LEFT, NONE, Attribute, Domain, Kind, with_origin
from meshtide_codec.mesh_files.formats import Written
from meshtide_codec.mesh_files.not_kept import not_kept
from meshtide_codec.mesh_files.ply.attributes import (
    COLORS,
    CORNER_TEXCOORDS,
    NORMALS,
    POSITION,
    TEXCOORDS,
    TEXTURE_NUMBER,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_codec.mesh import Mesh
    from meshtide_codec.mesh_files.ply.attributes import Meaning
    from meshtide_codec.scene import Image, Scene

_INDICES = "vertex_indices"
_LISTS = (_INDICES, CORNER_TEXCOORDS)
_AUTHOR = "written by meshtide"
_TYPES = {
    "i1": "char",
    "u1": "uchar",
    "i2": "short",
    "u2": "ushort",
    "i4": "int",
    "u4": "uint",
    "i8": "int64",
    "u8": "uint64",
    "f4": "float",
    "f8": "double",
}
_LARGEST_SHORT_LIST = 255
_SUFFIXES = {"image/png": ".png", "image/jpeg": ".jpg", "image/webp": ".webp", "image/ktx2": ".ktx2"}
_UNFIT = re.compile(r"[^\x21-\x7e]+")
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]+")


@dataclass(frozen=True, slots=True)
class _Rows:
    """The properties of an element that is being written.

    Args:
        domain: of its rows.
        columns: values (rows,) by the names of their properties.
    """

    domain: Domain
    columns: dict[str, NDArray[Any]] = field(default_factory=dict)

    def add(self, name: str, values: NDArray[Any]) -> None:
        """Add a property under its name, or one like it where that is taken or is not a word."""
        own = _UNFIT.sub("_", name) or "value"
        while own in self.columns or own.lower() in (*POSITION, *_LISTS):
            own += "_"
        kind = values.dtype.newbyteorder("<") if values.dtype.itemsize > 2 or values.dtype.kind != "f" else "<f4"
        self.columns[own] = values.astype(kind)

    def header(self) -> list[str]:
        """The lines that declare them."""
        return [f"property {_TYPES[values.dtype.str[1:]]} {name}" for name, values in self.columns.items()]


def write_ply(scene: Scene, name: str) -> Written:
    """A binary PLY file, and the images that it names.

    >>> from meshtide_codec.mesh import Mesh
    >>> from meshtide_codec.scene import Scene
    >>> triangle = Scene.of(Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    >>> len(write_ply(triangle, "a.ply").data)
    285
    """
    mesh = scene.mesh()
    notes: list[str] = []
    outlines = _Outlines.of(mesh)
    vertices, faces = _Rows(Domain.VERTEX), _Rows(Domain.FACE)
    texcoords: Attribute | None = None
    lost: list[Attribute] = []
    for attribute in mesh.attributes:
        one = with_origin(attribute, LOWER_LEFT) if attribute.kind is Kind.TEXCOORD else attribute
        if one.domain is Domain.CORNER:
            if one.kind is Kind.TEXCOORD and one.values.shape[1] == 2 and texcoords is None:
                texcoords = one
            elif (around := _around_vertices(mesh, one)) is not None:
                _add(vertices, around, notes)
            else:
                lost.append(one)  # it differs between the corners of a vertex
        elif one.domain is Domain.VERTEX:
            _add(vertices, one, notes)
        else:
            _add(faces, outlines.of_faces(one, notes), notes)
    images, numbers = _textures(scene, mesh, notes)
    files = _files(images, name)
    comments = [_AUTHOR, *(f"TextureFile {each}" for each in files)]
    companions = {each: image.data for each, image in files.items() if image.data}
    if numbers is not None:
        label = Attribute(TEXTURE_NUMBER, Kind.LABEL, Domain.FACE, numbers.astype(np.int32)[:, None])
        _add(faces, outlines.of_faces(label, notes), notes)
    lists = [_Lists(_INDICES, outlines.counts, mesh.faces.reshape(-1)[outlines.corners].astype("<i4"))]
    if texcoords is not None:
        lists.append(_texcoord_lists(texcoords, outlines, notes))
    declared, rows = _face_rows(lists, faces)
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *_comment_lines(comments, scene),
        f"element vertex {len(mesh.vertices)}",
        *(f"property double {axis}" for axis in POSITION),
        *vertices.header(),
        f"element face {len(outlines.counts)}",
        *declared,
        "end_header\n",
    ]
    data = "\n".join(header).encode() + _vertex_rows(mesh, vertices) + rows
    shown = ["materials", "images"] if images else []
    return Written(data, companions, (*not_kept(scene, lost, kept=["polygons", *shown]), *notes))


def _comment_lines(comments: Sequence[str], scene: Scene) -> list[str]:
    """Comments of the writer and those that the scene came with, each on one line."""
    kept = [str(each) for each in scene.document.get("comments", ()) if each != _AUTHOR]
    lines = [_CONTROL.sub(" ", each) for each in (*comments, *kept)]
    return [line if line.startswith("obj_info ") else f"comment {line}" for line in lines]


@dataclass(frozen=True, slots=True)
class _Outlines:
    """The polygons of a mesh.

    Args:
        counts: (p,) corners of each.
        corners: (sum of counts,) which corners of triangles they are, 3 face + place.
        triangles: (p,) the first triangle of each.
        whole: whether a polygon's triangles are those that follow its first one.
    """

    counts: NDArray[np.int64]
    corners: NDArray[np.int64]
    triangles: NDArray[np.int64]
    whole: bool

    @classmethod
    def of(cls, mesh: Mesh) -> _Outlines:
        """Those of a mesh; its triangles, where it holds no others."""
        count = len(mesh.faces)
        if mesh.polygons is None or not mesh.polygons.any():
            return cls(np.full(count, 3), np.arange(3 * count), np.arange(count), whole=True)
        corners, counts = mesh.outlines()
        triangles = corners[np.cumsum(counts) - counts] // 3
        follow = np.cumsum(counts - 2) - (counts - 2)
        within = np.repeat(follow, counts) <= corners // 3
        within &= corners // 3 < np.repeat(follow + counts - 2, counts)
        return cls(counts, corners, triangles, whole=bool(within.all()) and int((counts - 2).sum()) == count)

    def of_faces(self, one: Attribute, notes: list[str]) -> Attribute:
        """An attribute of triangles as one of polygons."""
        if len(self.triangles) == len(one.rows()):
            return one
        rows = one.rows()[self.triangles]
        if self.whole:
            own, spread = one.rows(), np.repeat(rows, self.counts - 2)
            if not _same(one.values[own], one.values[spread]):
                notes.append(f"{one.name}: differs between the triangles of a polygon, that of the first is kept")
        return replace(one, indices=rows)


def _same(first: NDArray[Any], second: NDArray[Any]) -> bool:
    """Whether two tables are equal bit for bit."""
    return first.tobytes() == second.tobytes()


def _around_vertices(mesh: Mesh, one: Attribute) -> Attribute | None:
    """A corner attribute as one of vertices; None where a vertex has two values, or a corner has none."""
    corners = mesh.faces.reshape(-1)
    rows = one.rows()
    if len(rows) == 0 or rows.min() == NONE:
        return None
    chosen = np.full(len(mesh.vertices), NONE)
    chosen[corners] = rows
    if not _same(one.values[rows], one.values[chosen[corners]]):
        return None
    return replace(one, domain=Domain.VERTEX, indices=chosen)


def _add(rows: _Rows, one: Attribute, notes: list[str]) -> None:
    """Add an attribute of an element's rows, whatever it means."""
    values = one.per_element()
    if one.indices is not None and (one.indices == NONE).any():
        missing = int((one.indices == NONE).sum())
        notes.append(f"{one.name}: {rows.domain} values that are missing are written as 0 ({missing})")
    width = values.shape[1]
    meanings: Sequence[Meaning] = {Kind.COLOR: COLORS, Kind.NORMAL: NORMALS, Kind.TEXCOORD: TEXCOORDS}.get(one.kind, ())
    if one.kind is Kind.TEXCOORD and rows.domain is Domain.FACE:
        meanings = ()
    for meaning in meanings:
        names = [*meaning.names, *([meaning.optional] if meaning.optional and width > len(meaning.names) else [])]
        if len(names) == width and not set(names) & set(rows.columns):
            for at, name in enumerate(names):
                rows.add(name, values[:, at])
            return
    own = str(one.extra.get("property", one.name))
    if width == 1:
        rows.add(own, values[:, 0])
        return
    notes.append(f"{one.name}: written as {width} numbers without a meaning")
    for at in range(width):
        rows.add(f"{own}_{at}", values[:, at])


def _textures(scene: Scene, mesh: Mesh, notes: list[str]) -> tuple[list[Image], NDArray[np.int64] | None]:
    """The images that the materials of faces name, and of each face the number of its image, where that is not 0."""
    if mesh.materials is None or not scene.materials:
        return [], None
    shown = [_image_of(scene, dict(each.properties)) for each in scene.materials]
    used = sorted({each for each in shown if each is not None})
    plain = all(set(each.properties) <= {"pbrMetallicRoughness"} for each in scene.materials)
    if used and (not plain or None in shown):
        notes.append(f"materials ({len(scene.materials)}): of these only textures are kept")
    numbers = np.array([NONE if each is None else used.index(each) for each in shown] + [NONE])
    of_faces = numbers[np.minimum(mesh.materials, len(shown))]
    return [scene.images[each] for each in used], of_faces if used and of_faces.any() else None


def _image_of(scene: Scene, properties: dict[str, Any]) -> int | None:
    """The number of the image that a material shows as its colour, or None."""
    try:
        texture = properties["pbrMetallicRoughness"]["baseColorTexture"]["index"]
        image = scene.document["textures"][texture]["source"]
    except (KeyError, IndexError, TypeError):  # a material without one, or JSON that a stranger wrote
        return None
    return image if isinstance(image, int) and 0 <= image < len(scene.images) else None


def _files(images: Sequence[Image], own: str) -> dict[str, Image]:
    """The images by names of files, each another one: without folders, on one line."""
    files: dict[str, Image] = {}
    taken = {own.lower()}
    for at, image in enumerate(images):
        path = PurePosixPath(_CONTROL.sub("_", image.name).replace("\\", "/").strip() or "..")
        suffix = path.suffix or _SUFFIXES.get(image.mime_type, "")
        stem = f"texture_{at}" if path.name in {"", ".."} else path.stem
        name = stem + suffix
        while name.lower() in taken:
            stem += "_"
            name = stem + suffix
        taken.add(name.lower())
        files[name] = image
    return files


@dataclass(frozen=True, slots=True)
class _Lists:
    """A property with a list of values for each face.

    Args:
        name: of the property.
        counts: (p,) length of each list.
        items: (sum of counts,) values, little endian.
    """

    name: str
    counts: NDArray[np.int64]
    items: NDArray[Any]

    @property
    def length_type(self) -> str:
        """The type of the lengths, in numpy's words."""
        return "u1" if self.counts.max(initial=0) <= _LARGEST_SHORT_LIST else "<i4"


def _texcoord_lists(one: Attribute, outlines: _Outlines, notes: list[str]) -> _Lists:
    """Texture coordinates of corners; an empty list where no corner of a face has any."""
    rows = one.rows()[outlines.corners]
    starts = np.cumsum(outlines.counts) - outlines.counts
    present = np.maximum.reduceat(rows, starts) != NONE if len(starts) else np.zeros(0, bool)
    kept = np.repeat(present, outlines.counts)
    lacking = int((rows[kept] == NONE).sum())
    if lacking:
        notes.append(f"{one.name}: corner values that are missing are written as 0 ({lacking})")
    values = replace(one, domain=Domain.FACE, indices=rows[kept]).per_element()
    kind = values.dtype.newbyteorder("<")
    return _Lists(CORNER_TEXCOORDS, np.where(present, 2 * outlines.counts, 0), values.reshape(-1).astype(kind))


def _face_rows(lists: Sequence[_Lists], faces: _Rows) -> tuple[list[str], bytes]:
    """The lines that declare the properties of faces, and their rows."""
    declared = [
        f"property list {_TYPES[np.dtype(each.length_type).str[1:]]} {_TYPES[each.items.dtype.str[1:]]} {each.name}"
        for each in lists
    ]
    declared += faces.header()
    counts = [each.counts for each in lists]
    size = sum(np.dtype(each.length_type).itemsize + each.items.dtype.itemsize * each.counts for each in lists)
    sizes = np.asarray(size) + sum(each.dtype.itemsize for each in faces.columns.values())
    at = np.cumsum(sizes) - sizes
    rows = bytearray(int(sizes.sum()))
    for each, count in zip(lists, counts, strict=True):
        at = at + _place(rows, at, count.astype(each.length_type))
        step = each.items.dtype.itemsize
        before = np.cumsum(count) - count
        _place(rows, np.repeat(at - step * before, count) + step * np.arange(len(each.items)), each.items)
        at = at + step * count
    for values in faces.columns.values():
        at = at + _place(rows, at, values)
    return declared, bytes(rows)


def _place(rows: bytearray, at: NDArray[np.int64], values: NDArray[Any]) -> int:
    """Put values at these places; returns the bytes of one."""
    size = values.dtype.itemsize
    if len(values):
        np.ndarray(len(rows) - size + 1, values.dtype, rows, strides=(1,))[at] = values
    return size


def _vertex_rows(mesh: Mesh, vertices: _Rows) -> bytes:
    fields: list[Any] = [("position", "<f8", 3)]
    fields += [(f"item{place}", values.dtype) for place, values in enumerate(vertices.columns.values())]
    rows = np.empty(len(mesh.vertices), fields)
    rows["position"] = mesh.vertices
    for place, values in enumerate(vertices.columns.values()):
        rows[f"item{place}"] = values
    return rows.tobytes()
