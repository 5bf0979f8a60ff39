"""What the properties of a PLY file mean: colours, normals, texture coordinates by the names that programs use.

The format has no names of its own but for positions: these are those of the Stanford scans, of MeshLab, Blender and
Open3D. All other properties with one value are scalars.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from meshtide_codec.attributes import NONE, Attribute, Domain, Kind

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import DTypeLike, NDArray

    from meshtide_codec.mesh_files.ply.rows import ListColumn

POSITION = ("x", "y", "z")
CORNER_TEXCOORDS = "texcoord"
TEXTURE_NUMBER = "texnumber"


class Meaning(NamedTuple):
    """A set of properties that are one attribute.

    Args:
        kind: what they mean.
        names: of its components.
        optional: the name of one more, such as alpha; None if there is none.
    """

    kind: Kind
    names: tuple[str, ...]
    optional: str | None = None


COLORS = (
    Meaning(Kind.COLOR, ("red", "green", "blue"), "alpha"),
    Meaning(Kind.COLOR, ("diffuse_red", "diffuse_green", "diffuse_blue"), "diffuse_alpha"),
    Meaning(Kind.COLOR, ("r", "g", "b"), "a"),
)
NORMALS = (Meaning(Kind.NORMAL, ("nx", "ny", "nz")),)
TEXCOORDS = (
    Meaning(Kind.TEXCOORD, ("s", "t")),
    Meaning(Kind.TEXCOORD, ("u", "v")),
    Meaning(Kind.TEXCOORD, ("texture_u", "texture_v")),
)
_BLOCK = 1 << 14
"""Rows that are copied at a time: columns of a binary file lie within each other, and stay in the cache so."""
_NAMES = {Kind.COLOR: "COLOR_{}", Kind.NORMAL: "NORMAL", Kind.TEXCOORD: "TEXCOORD_{}"}


def attributes_of(scalars: Mapping[str, NDArray[Any]], domain: Domain, taken: Iterable[str] = ()) -> list[Attribute]:
    """The attributes that an element's properties with one value are.

    Args:
        scalars: the values (rows,) of each property by its name.
        domain: of the rows, vertices or faces.
        taken: names of attributes that the mesh has already.

    >>> nx, red = np.zeros(2, "f4"), np.zeros(2, "u1")
    >>> columns = {"nx": nx, "ny": nx, "nz": nx, "Red": red, "Green": red, "Blue": red, "quality": nx}
    >>> [(one.name, one.values.shape) for one in attributes_of(columns, Domain.VERTEX)]
    [('NORMAL', (2, 3)), ('COLOR_0', (2, 3)), ('quality', (2, 1))]
    """
    left = dict(scalars)
    names = set(taken)
    attributes = []
    meanings = (*NORMALS, *COLORS, *(TEXCOORDS if domain is Domain.VERTEX else ()))
    numbers = dict.fromkeys(_NAMES, 0)
    for meaning in meanings:
        spelled = {name.lower(): name for name in left}
        columns = [left[spelled[name]] for name in meaning.names if name in spelled]
        if len(columns) < len(meaning.names) or any(each.dtype != columns[0].dtype for each in columns):
            continue
        used = [spelled[name] for name in meaning.names]
        extra = spelled.get(meaning.optional or "")
        if extra is not None and left[extra].dtype == columns[0].dtype:
            used.append(extra)
        values = table([left.pop(name) for name in used])
        while (name := _NAMES[meaning.kind].format(numbers[meaning.kind])) in names and domain is Domain.VERTEX:
            numbers[meaning.kind] += 1
        numbers[meaning.kind] += 1
        normalized = meaning.kind is Kind.COLOR and values.dtype.kind in "iu"
        attributes.append(_named(name, meaning.kind, domain, values, names, normalized=normalized))
    for name, column in left.items():
        attributes.append(_named(name, Kind.SCALAR, domain, table([column]), names))
    return attributes


def _named(
    name: str, kind: Kind, domain: Domain, values: NDArray[Any], names: set[str], *, normalized: bool = False
) -> Attribute:
    """The attribute under that name, or that of a face where one of vertices has it."""
    own = name
    if own in names and domain is Domain.FACE:
        own = f"face_{name}" if kind is Kind.SCALAR else f"FACE_{name.removesuffix('_0')}"
    while own in names:
        own += "_"
    names.add(own)
    extra = {} if own == name else {"property": name}
    return Attribute(own, kind, domain, values, normalized=normalized, extra=extra)


def table(columns: list[NDArray[Any]], kind: DTypeLike | None = None) -> NDArray[Any]:
    """Columns (rows,) side by side (rows, c), of another type or in native byte order."""
    values = np.empty((len(columns[0]), len(columns)), kind or columns[0].dtype.newbyteorder("="))
    for begin in range(0, len(values), _BLOCK):
        block = slice(begin, begin + _BLOCK)
        for place, column in enumerate(columns):
            values[block, place] = column[block]
    return values


def corner_texcoords(
    column: ListColumn,
    counts: NDArray[np.int64],
    corners: NDArray[np.int64] | None,
    polygon: NDArray[np.int64] | None,
) -> tuple[Attribute, int]:
    """The texture coordinates of corners, of which each face has a list, u and v of each of its corners.

    Args:
        column: the lists.
        counts: (p,) corners of each face.
        corners: (m, 3) where the corners of each triangle stand among those of all faces; None where these are the
            triangles.
        polygon: (m,) the face that each triangle is of; None in the same case.

    Returns:
        The attribute, and how many faces had a list of another length than it should be: these have no values.
    """
    fitting = column.counts == 2 * counts
    items = column.items.reshape(-1)
    items = items.astype(items.dtype.newbyteorder("="), copy=False)
    if fitting.all():
        values = np.ascontiguousarray(items).reshape(-1, 2)
        return Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, values, corners), 0
    values = items[np.repeat(fitting, column.counts)].reshape(-1, 2)
    if corners is None or polygon is None:
        corners, polygon = np.arange(3 * len(counts)).reshape(-1, 3), np.arange(len(counts))
    kept = np.where(fitting, counts, 0)
    moved = (np.cumsum(kept) - kept) - (np.cumsum(counts) - counts)
    rows = np.where(fitting[polygon, None], corners + moved[polygon, None], NONE)
    attribute = Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, values, rows)
    return attribute, int((~fitting & (column.counts > 0)).sum())
