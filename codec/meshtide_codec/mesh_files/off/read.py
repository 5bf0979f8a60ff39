"""OFF files: a header keyword, three counts, vertices, polygons; in text or in binary form.

Format: Geomview manual, "OFF Files" and "Binary format": ``[ST][C][N][4][n]OFF``, the dimension if there is an n,
the numbers of vertices, faces and edges; of each vertex its position (four components with a 4, the last one
divides), normal, colour, texture coordinates; of each face the number of its corners, these, and a colour: nothing, one
number (a row of a colour map), or three or four, integers of 0..255 or floats of 0..1. What the values are called in
memory: COLOR_0, NORMAL, TEXCOORD_0; COLOR_INDEX for rows of a colour map.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.attributes import NONE, Attribute, Domain, Kind
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.encodings import plain_text, wide_encoding
from meshtide_codec.mesh_files.off.binary import read_binary_rows
from meshtide_codec.mesh_files.off.rows import COLOR_INDEX, OffKeyword
from meshtide_codec.mesh_files.off.text import read_text_rows
from meshtide_codec.mesh_files.polygons import triangulated
from meshtide_codec.mesh_files.words import without_comments
from meshtide_codec.scene import Scene

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.off.rows import OffRows
    from meshtide_codec.mesh_files.source import Source

_KEYWORD = re.compile(rb"\s*([STCN4n]*)(OFF)(?=[\s\d]|$|BINARY)([^\S\n]*BINARY[^\n]*\n)?", re.IGNORECASE)
_COMMENTS = re.compile(rb"(?:\s|#[^\n]*\n)*")
_PARTS = re.compile(r"(?:ST|C|N|4|n)*")
_FULL = 255


def read_off(source: Source, limits: FileLimits) -> Scene:
    r"""A scene of one mesh, with its polygons, from an OFF file of any kind.

    Raises:
        MeshFileError: it holds less than it declares, is of other dimensions than three, names vertices that are not
            there, or claims too much.

    >>> from meshtide_codec.limits import FileLimits
    >>> from meshtide_codec.mesh_files.source import Source
    >>> data = b"OFF 4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
    >>> read_off(Source("square.off", ".off", data), FileLimits()).mesh().polygons_as_lists()
    [[0, 1, 2, 3]]
    """
    wide = wide_encoding(source.view) != ""
    keyword, offset, binary = (OffKeyword(), 0, False) if wide else _keyword(source.view)
    if binary:
        rows = read_binary_rows(source.view, offset, keyword, limits)
    else:
        text = without_comments(plain_text(source.data))
        keyword, offset, _ = _keyword(text)
        rows = read_text_rows(text, offset, keyword, limits)
    for note in rows.notes:
        source.note(note)
    mesh, notes = _mesh(rows, keyword)
    for note in notes:
        source.note(note)
    return Scene.of(mesh)


def _keyword(data: bytes | memoryview) -> tuple[OffKeyword, int, bool]:
    """What the keyword announces, where it ends, and whether binary rows follow it.

    In a keyword of lower case every letter is read as upper case, so none announces a dimension.
    """
    start = 3 if data[:3] == b"\xef\xbb\xbf" else 0
    comments = _COMMENTS.match(data, start)
    start = comments.end() if comments else start
    found = _KEYWORD.match(data, start)
    if found is None:
        if bytes(data[start : start + 1]).isdigit():
            return OffKeyword(), start, False
        raise MeshFileError("the file does not begin with OFF")
    prefix = found[1].decode() if found[2] == b"OFF" else found[1].decode().upper()
    parts = [part for part in ("ST", "C", "N", "4", "n") if part in prefix]
    if _PARTS.fullmatch(prefix) is None or len("".join(parts)) != len(prefix):
        raise MeshFileError(f"the keyword {prefix}OFF is not understood: [ST][C][N][4][n]OFF is")
    keyword = OffKeyword("ST" in parts, "C" in parts, "N" in parts, "4" in parts, "n" in parts)
    return keyword, found.end(), found[3] is not None


def _mesh(rows: OffRows, keyword: OffKeyword) -> tuple[Mesh, list[str]]:
    notes: list[str] = []
    table = rows.vertices
    points = table[:, :3]
    place = 3
    if keyword.homogeneous:
        with np.errstate(all="ignore"):  # what becomes infinite is refused by name where the mesh is checked
            points = points / table[:, 3:4]
        place = 4
    points = np.ascontiguousarray(points)
    attributes = []
    if keyword.normal:
        normals = np.ascontiguousarray(table[:, place : place + 3])
        attributes.append(Attribute("NORMAL", Kind.NORMAL, Domain.VERTEX, normals))
        place += 3
    if rows.colors:
        values = _color_values(table[:, place : place + rows.colors], "vertices", notes)
        if values is not None:
            normalized = values.dtype.kind == "u"
            attributes.append(Attribute("COLOR_0", Kind.COLOR, Domain.VERTEX, values, normalized=normalized))
        place += rows.colors
    if keyword.texture:
        texture = np.ascontiguousarray(table[:, place : place + 2])
        attributes.append(Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.VERTEX, texture))
    cut = triangulated(points, rows.counts, rows.corners)
    notes += cut.notes()
    attributes += _face_colors(rows, cut.polygon, notes)
    return Mesh(points, rows.corners[cut.corners], tuple(attributes), polygons=cut.inner), notes


def _color_values(values: NDArray[np.float64], owners: str, notes: list[str]) -> NDArray[Any] | None:
    """Colours (k, c) as bytes where they are whole numbers up to 255, else as floats of 0..1; None if they are neither.

    Numbers of which none is above 1 are floats, as Geomview has it.
    """
    least, most = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    if not (least >= 0 and most <= _FULL):  # also where one is not a number
        notes.append(f"colours of {owners} are outside of 0 to 255: left out")
        return None
    if most <= 1:
        return np.ascontiguousarray(values)
    if (values % 1 == 0).all():
        return values.astype(np.uint8)
    return values / _FULL


def _face_colors(rows: OffRows, polygon: NDArray[np.int64], notes: list[str]) -> list[Attribute]:
    """The colours of polygons, three or four values each, and their rows in a colour map, where there are such."""
    attributes = []
    starts = np.cumsum(rows.color_counts) - rows.color_counts
    colored = np.flatnonzero(rows.color_counts >= 3)
    if len(colored):
        width = int(rows.color_counts.max())
        flat = rows.color_values[starts[colored, None] + np.arange(3)]
        values = _color_values(flat, "faces", notes)
        if values is not None and width == 4:
            opaque = rows.color_counts[colored] == 3
            alpha = rows.color_values[np.where(opaque, starts[colored], starts[colored] + 3)]
            full: float = _FULL if values.dtype.kind == "u" else 1.0
            alpha = np.where(opaque, full, alpha)
            values = _color_values(np.column_stack([flat, alpha]), "faces", notes)
        if values is not None:
            attributes.append(_of_faces("COLOR_0", Kind.COLOR, values, colored, len(rows.counts), polygon))
    indexed = np.flatnonzero(rows.color_counts == 1)
    if len(indexed):
        values = rows.color_values[starts[indexed], None]
        if (np.abs(values) < 1 << 31).all() and (values % 1 == 0).all():
            values = values.astype(np.int32)
            attributes.append(_of_faces(COLOR_INDEX, Kind.LABEL, values, indexed, len(rows.counts), polygon))
        else:
            notes.append("rows of a colour map are not whole numbers: left out")
    return attributes


def _of_faces(
    name: str, kind: Kind, values: NDArray[Any], owners: NDArray[np.int64], count: int, polygon: NDArray[np.int64]
) -> Attribute:
    """An attribute of the triangles of polygons, of which some, `owners`, have a value each."""
    indices = np.full(count, NONE, np.int64)
    indices[owners] = np.arange(len(owners))
    indices = indices[polygon]
    plain = len(indices) == len(values) and bool((indices == np.arange(len(indices))).all())
    normalized = kind is Kind.COLOR and values.dtype.kind == "u"
    return Attribute(name, kind, Domain.FACE, values, None if plain else indices, normalized)
