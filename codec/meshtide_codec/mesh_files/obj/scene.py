"""From the tables and corners of an OBJ file to a scene: polygons cut, wedges kept, labels of faces."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.attributes import NONE, Attribute, Domain, Kind
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.obj.statements import shown_name
from meshtide_codec.mesh_files.polygons import triangulated
from meshtide_codec.scene import Node, Scene

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.mesh_files.obj.materials import Materials
    from meshtide_codec.mesh_files.obj.statements import Statements
    from meshtide_codec.mesh_files.source import Source

_LABELS = ("object", "group", "smoothing")


@dataclass(slots=True)
class Parts:
    """What the blocks of a file hold, a list of each; taken apart as it is used.

    Args:
        tables: rows of v, vt and vn, each (k, 3), those of vt (k, 2) where a block has no third coordinate.
        colors: of vertices from a first one on, (k, 4), NaN where there is none.
        counts: of faces, and the corners of each (k,); None where all are triangles.
        corners: of v, vt and vn: how many corners there are, and the row of each (k,) int32, -1 for none; None where
            none has one.
    """

    tables: tuple[list[NDArray[np.float64]], ...] = field(default_factory=lambda: ([], [], []))
    colors: list[tuple[int, NDArray[np.float64]]] = field(default_factory=list)
    counts: list[tuple[int, NDArray[np.int64] | None]] = field(default_factory=list)
    corners: tuple[list[tuple[int, NDArray[np.int32] | None]], ...] = field(default_factory=lambda: ([], [], []))


@dataclass(frozen=True, slots=True)
class _Cut:
    """Polygons as triangles: of each corner its place among those of the file, of each triangle its polygon."""

    places: NDArray[np.int64] | None
    polygon: NDArray[np.int64] | None
    inner: NDArray[np.bool_] | None
    polygons: int

    def of_corners(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Values of the file's corners for the corners (m, 3) of the triangles."""
        return rows.reshape(-1, 3) if self.places is None else rows[self.places]

    def of_faces(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Values of the polygons for the triangles (m,)."""
        return rows if self.polygon is None else rows[self.polygon]


def obj_scene(source: Source, parts: Parts, statements: Statements, materials: Materials) -> Scene:
    """The scene of a file whose lines have been read and whose indices are in range.

    Raises:
        MeshFileError: no face is left.
    """
    vertices = _table(parts.tables[0])
    corners = _rows(parts.corners[0])
    cut = _cut(source, parts, vertices, corners)
    faces = cut.of_corners(corners)
    del corners
    attributes = []
    for place, name, kind in ((1, "TEXCOORD_0", Kind.TEXCOORD), (2, "NORMAL", Kind.NORMAL)):
        attribute = _of_corners(source, name, kind, parts, place, cut=cut, faces=faces, vertices=len(vertices))
        if attribute is not None:
            attributes.append(attribute)
    color = _colors(parts, len(vertices))
    if color is not None:
        attributes.append(color)
    for name in _LABELS:
        label = _label(name, statements, cut)
        if label is not None:
            attributes.append(label)
    used, rows = statements.labels("material", cut.polygons)
    of_faces = cut.of_faces(np.append(materials.places(used), NONE)[rows]) if used else None
    mesh = Mesh(vertices, faces, tuple(attributes), of_faces, cut.inner)
    return Scene(
        (mesh,),
        (Node(0),),
        (0,),
        materials.materials,
        materials.images,
        (statements.first_object(),),
        {"textures": list(materials.textures)} if materials.textures else {},
    )


def _table(blocks: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    width = max(block.shape[1] for block in blocks)
    table = np.zeros((sum(map(len, blocks)), width))
    start = 0
    for block in blocks:
        table[start : start + len(block), : block.shape[1]] = block
        start += len(block)
    blocks.clear()
    return table


def _rows(blocks: list[tuple[int, NDArray[np.int32] | None]]) -> NDArray[np.int64]:
    rows = np.full(sum(count for count, _ in blocks), NONE, np.int64)
    start = 0
    for count, block in blocks:
        if block is not None:
            rows[start : start + count] = block
        start += count
    blocks.clear()
    return rows


def _cut(source: Source, parts: Parts, vertices: NDArray[np.float64], corners: NDArray[np.int64]) -> _Cut:
    polygons = sum(count for count, _ in parts.counts)
    if all(block is None for _, block in parts.counts):
        return _Cut(None, None, None, polygons)
    counts = np.concatenate([np.full(count, 3) if block is None else block for count, block in parts.counts])
    parts.counts.clear()
    cut = triangulated(vertices, counts, corners)
    for note in cut.notes("vertices"):
        source.note(note)
    if len(cut.corners) == 0:
        raise MeshFileError(f"none of its faces has three different vertices ({polygons} faces)")
    return _Cut(cut.corners, cut.polygon, cut.inner, polygons)


def _of_corners(
    source: Source,
    name: str,
    kind: Kind,
    parts: Parts,
    place: int,
    *,
    cut: _Cut,
    faces: NDArray[np.int64],
    vertices: int,
) -> Attribute | None:
    """Texture coordinates or normals; None if no corner names any."""
    if not parts.tables[place]:
        return None
    values = _table(parts.tables[place])
    if all(block is None for _, block in parts.corners[place]):
        what = "texture coordinates" if kind is Kind.TEXCOORD else "normals"
        source.note(f"{what} that no face names, left out: {len(values)}")
        return None
    rows = cut.of_corners(_rows(parts.corners[place]))
    if len(values) == vertices and np.array_equal(rows, faces):
        return Attribute(name, kind, Domain.VERTEX, values)
    return Attribute(name, kind, Domain.CORNER, values, rows)


def _colors(parts: Parts, vertices: int) -> Attribute | None:
    if not parts.colors:
        return None
    table = np.full((vertices, 4), np.nan)
    for start, block in parts.colors:
        table[start : start + len(block)] = block
    given = ~np.isnan(table[:, :3]).all(axis=1)
    alpha = ~np.isnan(table[:, 3])
    if alpha.any():
        table[~alpha, 3] = 1.0
    else:
        table = np.ascontiguousarray(table[:, :3])
    if given.all():
        return Attribute("COLOR_0", Kind.COLOR, Domain.VERTEX, table)
    rows = np.where(given, np.cumsum(given) - 1, NONE)
    return Attribute("COLOR_0", Kind.COLOR, Domain.VERTEX, table[given], rows)


def _label(name: str, statements: Statements, cut: _Cut) -> Attribute | None:
    """A label of each face, where faces have more than one."""
    names, rows = statements.labels(name, cut.polygons)
    if len(rows) == 0 or (rows == rows[0]).all():
        return None
    values = np.arange(len(names), dtype=np.int32)[:, None]
    shown = [shown_name(one) for one in names]
    return Attribute(name, Kind.LABEL, Domain.FACE, values, cut.of_faces(rows), extra={"names": shown})
