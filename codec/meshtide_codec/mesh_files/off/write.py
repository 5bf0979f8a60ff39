"""Writes OFF files in text form, with polygons, and with colours, normals, texture coordinates where there are such.

The keyword announces what the vertices have. Floats are written so that they read back to the same bits.
"""

from __future__ import annotations

from itertools import repeat
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.attributes import LOWER_LEFT, NONE, Attribute, Domain, Kind, with_origin
from meshtide_codec.mesh_files.formats import Written
from meshtide_codec.mesh_files.not_kept import not_kept
from meshtide_codec.mesh_files.off.rows import COLOR_INDEX

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from meshtide_codec.mesh import Mesh
    from meshtide_codec.scene import Scene

_WIDTHS = {Kind.NORMAL: (3,), Kind.COLOR: (3, 4), Kind.TEXCOORD: (2,)}
_PREFIXES = {Kind.TEXCOORD: "ST", Kind.COLOR: "C", Kind.NORMAL: "N"}


def write_off(scene: Scene, name: str) -> Written:  # noqa: ARG001 - nothing is written beside it
    """The scene's mesh as an OFF file.

    >>> from meshtide_codec.mesh import Mesh
    >>> from meshtide_codec.scene import Scene
    >>> triangle = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> write_off(Scene.of(triangle), "a.off").data.decode().split(chr(10))[:3]
    ['OFF', '3 1 0', '0.0 0.0 0.0']
    """
    mesh = scene.mesh()
    of_vertices = {kind: _first(mesh, kind, Domain.VERTEX, widths) for kind, widths in _WIDTHS.items()}
    face_color = _first(mesh, Kind.COLOR, Domain.FACE, (3, 4)) or _first(mesh, Kind.LABEL, Domain.FACE, (1,))
    kept = [one for one in (*of_vertices.values(), face_color) if one is not None]
    columns: list[list[Any]] = [column.tolist() for column in mesh.vertices.T]
    for kind in _WIDTHS:  # the order of the format
        attribute = of_vertices[kind]
        columns += [] if attribute is None else [column.tolist() for column in _numbers(attribute).T]
    keyword = "".join(prefix for kind, prefix in _PREFIXES.items() if of_vertices[kind] is not None)
    rows = list(_face_rows(mesh, face_color))
    parts = [f"{keyword}OFF\n{len(mesh.vertices)} {len(rows)} 0\n"]
    row = " ".join(["%r"] * len(columns)) + "\n"
    parts += [row % values for values in zip(*columns, strict=True)]
    parts += rows
    left = [one for one in mesh.attributes if not any(one is other for other in kept)]
    return Written("".join(parts).encode(), notes=tuple(not_kept(scene, left, kept=["polygons"])))


def _first(mesh: Mesh, kind: Kind, domain: Domain, widths: tuple[int, ...]) -> Attribute | None:
    """The first attribute that the format has a place for."""
    for one in mesh.attributes:
        if one.kind is not kind or one.domain is not domain or one.values.shape[1] not in widths:
            continue
        rows = one.rows()
        if kind is Kind.LABEL and (one.name != COLOR_INDEX or one.values.dtype.kind not in "iu"):
            continue
        if domain is Domain.VERTEX and (rows == NONE).any():
            continue  # each vertex has one, or none has
        if kind is Kind.COLOR and not _in_range(one):
            continue
        return one
    return None


def _in_range(color: Attribute) -> bool:
    """Whether a colour is of 0..1; others would be read as bytes."""
    if color.normalized:
        return color.values.dtype.kind == "u"
    return bool(((color.values >= 0) & (color.values <= 1)).all())


def _numbers(attribute: Attribute) -> NDArray[Any]:
    """The values (elements, c) as they are written: bytes as bytes, unless all are 0 or 1 and look like floats."""
    if attribute.kind is Kind.TEXCOORD:
        attribute = with_origin(attribute, LOWER_LEFT)
    values = attribute.per_element()
    if attribute.kind is Kind.LABEL:
        return values
    is_bytes = attribute.kind is Kind.COLOR and attribute.normalized and values.dtype == np.uint8
    if is_bytes and values.size and values.max() > 1:
        return values
    if not attribute.normalized:
        return values.astype(np.float64)
    return np.maximum(values / np.iinfo(values.dtype).max, -1.0)


def _face_rows(mesh: Mesh, color: Attribute | None) -> Iterator[str]:
    """A line for each polygon."""
    corners, counts = mesh.outlines()
    names = mesh.faces.reshape(-1)[corners].tolist()
    ends = np.cumsum(counts)
    first_faces = corners[ends - counts] // 3
    behind = repeat("") if color is None else _colors(color, first_faces)
    for end, count, last in zip(ends.tolist(), counts.tolist(), behind, strict=False):
        yield f"{count} {' '.join(map(str, names[end - count : end]))}{last}\n"


def _colors(color: Attribute, faces: NDArray[np.int64]) -> list[str]:
    """What stands behind the corners of polygons with these faces."""
    valued = (color.rows()[faces] != NONE).tolist()
    numbers = _numbers(color)[faces].tolist()
    return ["".join(f" {x!r}" for x in row) if has else "" for row, has in zip(numbers, valued, strict=True)]
