"""The faces of a PLY file: polygons, triangles, and strips of triangles, with what each of them carries."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.attributes import NONE, Attribute, Domain, Kind
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.ply.attributes import (
    CORNER_TEXCOORDS,
    TEXTURE_NUMBER,
    attributes_of,
    corner_texcoords,
)
from meshtide_codec.mesh_files.polygons import triangulated

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.ply.rows import Columns, ListColumn

_INDEX_LISTS = (
    "vertex_indices",
    "vertex_index",
    "vertex_indexes",
    "vertexindices",
    "vertexindex",
    "vertices",
    "indices",
)
_BLOCK = 1 << 14
"""Rows that are converted at a time, so that they are still in the processor's cache when they are looked at."""
_NO_VERTEX = -1
"""What ends a strip of triangles, so that another begins."""


@dataclass(frozen=True, slots=True)
class PlyFaces:
    """Triangles and what they carry.

    Args:
        triangles: (m, 3) int64 vertices.
        attributes: of faces and corners.
        textures: (m,) int64, the number of each face's texture, or None.
        inner: (m, 3) bool, which edges are inside of a polygon, or None.
        notes: what a person should know.
    """

    triangles: NDArray[np.int64]
    attributes: tuple[Attribute, ...] = ()
    textures: NDArray[np.int64] | None = None
    inner: NDArray[np.bool_] | None = None
    notes: tuple[str, ...] = ()

    def followed_by(self, strips: NDArray[np.int64]) -> PlyFaces:
        """These faces and then those of strips, which carry nothing."""
        count = len(strips)
        if count == 0:
            return self
        attributes = []
        for one in self.attributes:
            shape = (count, 3) if one.domain is Domain.CORNER else (count,)
            rows = one.rows().reshape(-1, *shape[1:])
            attributes.append(replace(one, indices=np.concatenate([rows, np.full(shape, NONE)])))
        textures = None if self.textures is None else np.concatenate([self.textures, np.full(count, NONE)])
        inner = None if self.inner is None else np.concatenate([self.inner, np.zeros((count, 3), bool)])
        return PlyFaces(np.concatenate([self.triangles, strips]), tuple(attributes), textures, inner, self.notes)


def faces_of(
    columns: Columns,
    vertices: NDArray[np.float64],
    taken: Iterable[str],
    limits: FileLimits,
    place: Callable[[int], str],
) -> PlyFaces:
    """The faces of the element face.

    Args:
        columns: its values.
        vertices: (n, 3) positions, by which polygons are cut.
        taken: names of attributes that the vertices have.
        limits: how many triangles there may be.
        place: of a row, for messages.

    Raises:
        MeshFileError: no list names the vertices, an index is out of range, or there are too many.
    """
    name = index_list(columns, "face")
    counts = columns.lists[name].counts
    corners = indices_of(columns.lists[name], len(vertices), place)
    notes = [f"the list {each} of faces: not read" for each in columns.lists if each not in (name, CORNER_TEXCOORDS)]
    del columns.lists[name]  # the indices are there twice otherwise
    triangles, places, polygon, inner = corners, None, None, None
    if corners.ndim == 1 and (counts == 3).all():
        triangles = corners.astype(np.int64, copy=False).reshape(-1, 3)
    elif corners.ndim == 1 or corners.shape[1] != 3:
        limits.check("faces", int(np.maximum(counts - 2, 0).sum()))
        flat = corners.reshape(-1)
        cut = triangulated(vertices, counts, flat)
        places, polygon, inner = cut.corners, cut.polygon, cut.inner
        triangles = places.copy() if CORNER_TEXCOORDS in columns.lists else places
        for begin in range(0, len(triangles), _BLOCK):
            triangles[begin : begin + _BLOCK] = flat[triangles[begin : begin + _BLOCK]]
        notes += cut.notes()
    attributes = []
    if CORNER_TEXCOORDS in columns.lists:
        attribute, odd = corner_texcoords(columns.lists[CORNER_TEXCOORDS], counts, places, polygon)
        attributes.append(attribute)
        if odd:
            notes.append(f"faces with texture coordinates for another number of corners: {odd}, of these none are read")
    names = {*taken, *(one.name for one in attributes)}
    for one in attributes_of(columns.scalars, Domain.FACE, names):
        kind = Kind.LABEL if one.name == TEXTURE_NUMBER and one.values.dtype.kind in "iu" else one.kind
        attributes.append(replace(one, kind=kind, indices=polygon))
    return PlyFaces(triangles, tuple(attributes), _textures(attributes), inner, tuple(notes))


def _textures(attributes: list[Attribute]) -> NDArray[np.int64] | None:
    label = next((one for one in attributes if one.name == TEXTURE_NUMBER and one.kind is Kind.LABEL), None)
    return None if label is None else label.per_element()[:, 0].astype(np.int64)


def index_list(columns: Columns, element: str) -> str:
    """The name of the list that holds the vertices of a face or a strip.

    Raises:
        MeshFileError: there is none.
    """
    spelled = {name.lower(): name for name in columns.lists}
    named = [spelled[name] for name in _INDEX_LISTS if name in spelled]
    named += [name for name in columns.lists if name.lower().startswith("vert") or "ind" in name.lower()]
    if not named:
        raise MeshFileError(f"the element {element} has no list of vertices, such as vertex_indices")
    return named[0]


def indices_of(column: ListColumn, count: int, place: Callable[[int], str], restart: int | None = None) -> NDArray[Any]:
    """The lists in the shape of their items, each item an index into `count` vertices.

    Args:
        column: the lists, of any numeric type.
        count: of the vertices.
        place: of a row, for messages.
        restart: what may stand in place of an index.

    Returns:
        Signed integers: int64, but of lists of several lengths int32 where that is enough.

    Raises:
        MeshFileError: an item is not an index of a vertex.
    """
    items = column.items
    few = items.ndim == 1 and items.dtype.kind in "iu" and items.dtype.itemsize <= 4
    indices = np.empty(items.shape, np.int32 if few else np.int64)
    unsigned = indices.view(np.uint32 if few else np.uint64)  # there what is negative is large
    largest = 0
    for begin in range(0, len(items), _BLOCK):
        block = slice(begin, begin + _BLOCK)
        with np.errstate(invalid="ignore"):
            for part in range(items.shape[1]) if items.ndim == 2 else (...,):
                indices[block, part] = items[block, part]
        largest = max(largest, int(unsigned[block].max(initial=0)))
    if restart is not None and items.dtype.kind == "u":
        indices[items == np.iinfo(items.dtype).max] = restart
    if largest < count and items.dtype.kind != "f":
        return indices
    wrong: NDArray[np.bool_] = (indices < 0) | (indices >= count)
    if items.dtype.kind == "f":
        wrong |= indices != items
    if restart is not None:
        wrong &= indices != restart
    if wrong.any():
        first = int(wrong.reshape(-1).argmax())
        row = int(np.searchsorted(np.cumsum(column.counts), first, side="right"))
        raise MeshFileError(f"{place(row)} names vertex {items.reshape(-1)[first]}; there are {count}")
    return indices


def triangles_of_strips(
    columns: Columns, vertices: int, limits: FileLimits, place: Callable[[int], str]
) -> NDArray[np.int64]:
    """The triangles (m, 3) of the element tristrips: each vertex makes one with the two before it.

    Every second triangle of a strip is turned round, as all of them look the same way. -1 begins a new strip. What has
    a vertex twice is left out: such triangles lead from one strip to the next.

    Args:
        columns: the element's values.
        vertices: how many there are.
        limits: how many triangles there may be.
        place: of a row, for messages.

    Raises:
        MeshFileError: no list names the vertices, an index is out of range, or there are too many.
    """
    column = columns.lists[index_list(columns, "tristrips")]
    items = indices_of(column, vertices, place, _NO_VERTEX).reshape(-1)
    limits.check("faces", len(items))
    strips = np.insert(items, np.cumsum(column.counts)[:-1], _NO_VERTEX)
    ended = strips == _NO_VERTEX
    positions = np.arange(len(strips))
    begin = np.maximum.accumulate(np.where(ended, positions + 1, 0))
    first = positions[:-2][~(ended[:-2] | ended[1:-1] | ended[2:])]
    odd = (first - begin[first]) % 2
    triangles = np.stack([strips[first], strips[first + 1 + odd], strips[first + 2 - odd]], axis=1)
    a, b, c = triangles.T
    kept: NDArray[np.int64] = triangles[(a != b) & (b != c) & (c != a)]
    return kept
