"""PLY: a mesh from a file of any kind that the format knows, with all its attributes; and back (`write`).

Format: G. Turk, "The PLY Polygon File Format" (1994). A file is a header (`header`) and rows, as text (`text`)
or in binary form (`rows`): of vertices, whose properties `attributes` names, and of faces (`faces`). Values
have the type that the header declares, in text as well. Cost: linear in the file.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.attributes import NONE, Domain, Kind
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.encodings import decoded, wide_encoding
from meshtide_codec.mesh_files.ply.attributes import CORNER_TEXCOORDS, POSITION, TEXTURE_NUMBER, attributes_of, table
from meshtide_codec.mesh_files.ply.faces import PlyFaces, faces_of, triangles_of_strips
from meshtide_codec.mesh_files.ply.header import read_header
from meshtide_codec.mesh_files.ply.rows import Columns, RowReader, Stored
from meshtide_codec.mesh_files.ply.text import PlyText
from meshtide_codec.scene import Image, Material, Scene

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from meshtide_codec.attributes import Attribute
    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.ply.header import PlyElement, PlyHeader
    from meshtide_codec.mesh_files.source import Source

_READ = ("vertex", "face", "tristrips")
_SPLATS = ({"f_dc_0", "opacity", "scale_0", "rot_0"}, {"packed_position", "packed_rotation", "packed_scale"})
"""Properties of points of Gaussian splats, plain and packed."""
_TEXTURE_FILE = re.compile(r"texturefile\s+(.+)", re.IGNORECASE)
_IMAGE_TYPES = ((b"\x89PNG", "image/png"), (b"\xff\xd8\xff", "image/jpeg"))


def read_ply(source: Source, limits: FileLimits) -> Scene:
    """The scene of a PLY file: one mesh, and a material for each texture that its comments name.

    Raises:
        MeshFileError: the header is not understood, declares more than the file holds or the limits allow, or no
            mesh: points without faces are none.
    """
    if wide_encoding(source.view):
        source = replace(source, content=decoded(source.data))
    header = read_header(source.view)
    for note in header.notes:
        source.note(note)
    vertex, face, strips = (header.element(name) for name in _READ)
    limits.check_counts(vertex.count if vertex else 0, face.count if face else 0)
    _refuse_what_is_no_mesh(header)
    _check_size(header, len(source.content))
    body = _Body(source, header)
    columns = {element.name.lower(): body.read(element) for element in header.elements}
    body.finish()
    vertices = _positions(columns["vertex"])
    others = {name: values for name, values in columns["vertex"].scalars.items() if name.lower() not in POSITION}
    taken = ["TEXCOORD_0"] if CORNER_TEXCOORDS in columns.get("face", Columns({}, {})).lists else []
    attributes = attributes_of(others, Domain.VERTEX, taken)
    for name in columns["vertex"].lists:
        source.note(f"the list {name} of vertices: not read")
    faces = PlyFaces(np.zeros((0, 3), np.int64))
    if face is not None and face.count:
        names = [one.name for one in attributes]
        faces = faces_of(columns["face"], vertices, names, limits, body.place_in(face, columns["face"]))
    if strips is not None and strips.count:
        place = body.place_in(strips, columns["tristrips"])
        faces = faces.followed_by(triangles_of_strips(columns["tristrips"], len(vertices), limits, place))
    for note in faces.notes:
        source.note(note)
    if len(faces.triangles) == 0:
        raise MeshFileError("none of its faces has three different corners: there is no mesh in it")
    return _scene(source, header, limits, vertices, [*attributes, *faces.attributes], faces)


def _refuse_what_is_no_mesh(header: PlyHeader) -> None:
    vertex = header.element("vertex")
    if vertex is None or vertex.count == 0:
        raise MeshFileError("it declares no vertices: there is no mesh in it")
    names = {one.name.lower() for one in vertex.properties if one.length is None}
    faces = any(one is not None and one.count for one in (header.element("face"), header.element("tristrips")))
    others = "".join(f"; {_unread(one)}" for one in header.elements if one.count and one.name.lower() not in _READ)
    if not faces and any(names >= each for each in _SPLATS):
        raise MeshFileError(f"this is a Gaussian splat, not a mesh: {vertex.count} points without faces{others}")
    missing = [name for name in POSITION if name not in names]
    if missing:
        raise MeshFileError(f"its vertices have no property {missing[0]}")
    if not faces:
        raise MeshFileError(f"there are {vertex.count} points without faces in it: not a mesh{others}")


def _unread(element: PlyElement) -> str:
    return f"{element.name}: {element.count} rows, not read"


def _check_size(header: PlyHeader, size: int) -> None:
    """Hold the declared rows against the bytes that follow the header, before memory is taken."""
    left = size - header.body
    if not header.is_text:
        needed = sum(element.count * element.smallest for element in header.elements)
        if needed > left:
            raise MeshFileError(f"the header declares at least {needed} bytes of rows, but {left} follow it")
        return
    words = sum(element.count * len(element.properties) for element in header.elements)
    if 2 * words - 1 > left:
        raise MeshFileError(f"the header declares at least {words} numbers, which the {left} bytes after it cannot be")


class _Body:
    """What follows the header, element by element.

    Args:
        source: the file.
        header: of it.
    """

    def __init__(self, source: Source, header: PlyHeader) -> None:
        self._source = source
        self._header = header
        self._bytes = np.frombuffer(source.view, np.uint8)
        self._at = header.body
        self._text = PlyText(source.data, header.body) if header.is_text else None
        self._words = {element.name: 0 for element in header.elements}
        self._word = 0

    def read(self, element: PlyElement) -> Columns:
        """The rows of the next element."""
        if not element.properties:
            return Columns({}, {})
        if self._text is not None:
            self._words[element.name] = self._word
            reader = self._text.read(element)
            columns = reader.columns()
            lists = sum(int(each.counts.sum()) for each in columns.lists.values())
            self._word += element.count * len(element.properties) + lists
        else:
            order = self._header.order
            kinds = [(one.item, one.length) for one in element.properties]
            stored = [Stored(i.newbyteorder(order), None if n is None else n.newbyteorder(order)) for i, n in kinds]
            reader = RowReader(element, stored)
            self._at += reader.take(self._bytes[self._at :], last=True)
            columns = reader.columns()
        if element.count and element.name.lower() not in _READ:
            self._source.note(_unread(element))
        for name in sorted(reader.inexact):
            self._source.note(f"{name} of {element.name} has values that its type does not hold: kept as doubles")
        return columns

    def finish(self) -> None:
        """Report what stands after the last row."""
        rest = len(self._source.content) - self._at if self._text is None else self._text.rest()
        if rest:
            self._source.note(f"{rest} bytes after the last row: not read")
        elif self._text is not None and not self._text.ends_with_a_line():
            self._source.note("the last line does not end: its last number may be cut short")

    def place_in(self, element: PlyElement, columns: Columns) -> Callable[[int], str]:
        """What names a row of an element, with its line where the file is text."""

        def place(row: int) -> str:
            name = f"row {row} of {element.name}"
            if self._text is None:
                return name
            before = sum(int(each.counts[:row].sum()) for each in columns.lists.values())
            word = self._words[element.name] + row * len(element.properties) + before
            return f"{name} (line {self._text.line(word)})"

        return place


def _positions(columns: Columns) -> NDArray[np.float64]:
    """Positions (n, 3)."""
    spelled = {name.lower(): name for name in columns.scalars}
    found = [columns.scalars[spelled[name]] for name in POSITION]
    with np.errstate(invalid="ignore"):
        return table(found, np.float64)


def _scene(
    source: Source,
    header: PlyHeader,
    limits: FileLimits,
    vertices: NDArray[np.float64],
    attributes: list[Attribute],
    faces: PlyFaces,
) -> Scene:
    """The mesh with a material for each texture; the label of textures becomes the materials where it fits them."""
    found = [_TEXTURE_FILE.fullmatch(comment) for comment in header.comments]
    images = [_image(source, match.group(1).strip(), limits) for match in found if match is not None]
    materials = None
    if images:
        numbers = faces.textures
        if numbers is None:
            materials = np.zeros(len(faces.triangles), np.int64)
        elif numbers.min() >= NONE and numbers.max() < len(images):
            materials = numbers
            attributes = [one for one in attributes if not (one.name == TEXTURE_NUMBER and one.kind is Kind.LABEL)]
        else:
            source.note(f"{TEXTURE_NUMBER} names textures that no comment names: kept as a label")
    mesh = Mesh(vertices, faces.triangles, tuple(attributes), materials, faces.inner)
    texture = "pbrMetallicRoughness"
    scene = Scene.of(
        mesh,
        [Material(image.name, {texture: {"baseColorTexture": {"index": at}}}) for at, image in enumerate(images)],
    )
    comments = [text for text, match in zip(header.comments, found, strict=True) if match is None and text]
    document: dict[str, object] = {"comments": comments} if comments else {}
    if images:
        document["textures"] = [{"source": at} for at in range(len(images))]
    return replace(scene, images=tuple(images), document=document)


def _image(source: Source, name: str, limits: FileLimits) -> Image:
    """The texture of that name; without bytes where there is no such file beside this one."""
    shown = repr(name[:80])
    try:
        data = source.beside(name, limits)
    except MeshFileError as error:
        source.note(f"the texture {shown} is not read: {error}")
        return Image(name, b"")
    if data is None:
        source.note(f"the texture {shown} is not there")
        return Image(name, b"")
    return Image(name, data, next((kind for magic, kind in _IMAGE_TYPES if data.startswith(magic)), ""))
