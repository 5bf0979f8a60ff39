"""OBJ, written: shared positions, texture coordinates and normals, polygons, groups, materials; MTL and images beside.

Numbers are written with as many digits as give the same float64 back. The same scene gives the same bytes.
"""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.attributes import LOWER_LEFT, NONE, Attribute, Domain, Kind, with_origin
from meshtide_codec.mesh_files.formats import Written
from meshtide_codec.mesh_files.not_kept import not_kept
from meshtide_codec.mesh_files.obj.write_materials import image_files, mtl_text, unique_names, written_name

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from numpy.typing import NDArray

    from meshtide_codec.mesh import Mesh
    from meshtide_codec.scene import Scene

_LABELS = {"object": "o", "group": "g", "smoothing": "s"}
_GZIP = ".gz"


def write_obj(scene: Scene, name: str) -> Written:
    """The files of a scene: OBJ, and where it has materials MTL and images.

    >>> from meshtide_codec.scene import Scene
    >>> from meshtide_codec.mesh import Mesh
    >>> mesh = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> print(write_obj(Scene.of(mesh), "a.obj").data.decode())
    # written by meshtide
    v 0.0 0.0 0.0
    v 1.0 0.0 0.0
    v 0.0 1.0 0.0
    f 1 2 3
    """
    mesh = scene.mesh()
    color = _first(mesh, Kind.COLOR, {3, 4}, {Domain.VERTEX})
    texcoord = _first(mesh, Kind.TEXCOORD, {1, 2, 3}, set(Domain))
    normal = _first(mesh, Kind.NORMAL, {3}, set(Domain))
    labels = [one for one in mesh.attributes if _is_label(one)]
    kept = [one for one in (color, texcoord, normal, *labels) if one is not None]
    others = [one for one in mesh.attributes if one not in kept]
    shown = ["materials", "images"] if scene.materials else []
    notes = not_kept(scene, others, kept=["polygons", *shown])
    parts = ["# written by meshtide\n"]
    companions: dict[str, bytes] = {}
    materials = unique_names([material.name for material in scene.materials], "material")
    if scene.materials:
        library = f"{written_name(PurePath(name.removesuffix(_GZIP)).stem) or 'materials'}.mtl"
        files = image_files(scene.images, [name, library])
        text, poorer = mtl_text(scene, materials, files)
        companions[library] = text.encode()
        companions |= {file: image.data for file, image in zip(files, scene.images, strict=True) if image.data}
        parts.append(f"mtllib {library}\n")
        if poorer:
            notes.append(f"materials with properties that MTL has no words for: {poorer}")
    title = written_name(scene.names[0]) if len(scene.names) == 1 else ""
    if title and not any(one.name == "object" for one in labels):
        parts.append(f"o {title}\n")
    parts += _vertices(mesh, color)
    parts += [] if texcoord is None else _table("vt", with_origin(texcoord, LOWER_LEFT))
    parts += [] if normal is None else _table("vn", normal)
    parts += _faces(mesh, texcoord, normal, labels, materials)
    return Written("".join(parts).encode(), companions, tuple(notes))


def _first(mesh: Mesh, kind: Kind, widths: set[int], domains: set[Domain]) -> Attribute | None:
    """The first attribute of a kind that OBJ can hold."""
    fitting = (
        one for one in mesh.attributes if one.kind is kind and one.values.shape[1] in widths and one.domain in domains
    )
    return next(fitting, None)


def _is_label(attribute: Attribute) -> bool:
    return (
        attribute.kind is Kind.LABEL
        and attribute.domain is Domain.FACE
        and attribute.name in _LABELS
        and attribute.values.shape[1] == 1
    )


def _vertices(mesh: Mesh, color: Attribute | None) -> list[str]:
    positions: list[list[float]] = mesh.vertices.tolist()
    if color is None:
        return [f"v {x!r} {y!r} {z!r}\n" for x, y, z in positions]
    values = _floats(color).tolist()
    return [
        f"v {x!r} {y!r} {z!r}{''.join(f' {one!r}' for one in values[row]) if row != NONE else ''}\n"
        for (x, y, z), row in zip(positions, color.rows().tolist(), strict=True)
    ]


def _table(word: str, attribute: Attribute) -> list[str]:
    return [f"{word} {' '.join(map(repr, row))}\n" for row in _floats(attribute).tolist()]


def _floats(attribute: Attribute) -> NDArray[np.float64]:
    """Its values as floats; integers that stand for 0..1 or -1..1 become that."""
    values: NDArray[Any] = attribute.values.astype(np.float64)
    if attribute.normalized and attribute.values.dtype.kind in "iu":
        return np.maximum(values / np.iinfo(attribute.values.dtype).max, -1.0)
    return values


def _corner_rows(mesh: Mesh, attribute: Attribute) -> NDArray[np.int64]:
    """The row of each corner (3 m,), from 1; 0 where it has none."""
    rows = attribute.rows()
    match attribute.domain:
        case Domain.VERTEX:
            return rows[mesh.faces.reshape(-1)] + 1
        case Domain.FACE:
            return np.repeat(rows, 3) + 1
        case Domain.CORNER:
            return rows + 1


def _corner_words(mesh: Mesh, texcoord: Attribute | None, normal: Attribute | None) -> list[str]:
    """What stands for each corner (3 m,)."""
    vertices = (mesh.faces.reshape(-1) + 1).tolist()
    if texcoord is None and normal is None:
        return list(map(str, vertices))
    nothing = [0] * len(vertices)
    first = nothing if texcoord is None else _corner_rows(mesh, texcoord).tolist()
    second = nothing if normal is None else _corner_rows(mesh, normal).tolist()
    return [
        (f"{v}/{t}/{n}" if n else f"{v}/{t}") if t else (f"{v}//{n}" if n else f"{v}")
        for v, t, n in zip(vertices, first, second, strict=True)
    ]


def _faces(
    mesh: Mesh,
    texcoord: Attribute | None,
    normal: Attribute | None,
    labels: Sequence[Attribute],
    materials: Sequence[str],
) -> list[str]:
    words = _corner_words(mesh, texcoord, normal)
    if mesh.polygons is None:
        lines = [f"f {a} {b} {c}\n" for a, b, c in zip(words[0::3], words[1::3], words[2::3], strict=True)]
        triangles = np.arange(len(lines))
    else:
        corners, counts = mesh.outlines()
        around = [words[corner] for corner in corners.tolist()]
        ends = np.cumsum(counts)
        spans = zip((ends - counts).tolist(), ends.tolist(), strict=True)
        lines = [f"f {' '.join(around[start:end])}\n" for start, end in spans]
        triangles = corners[ends - counts] // 3
    for attribute in reversed(labels):
        rows, names = _labelled(attribute)
        _put_before(lines, _LABELS[attribute.name], rows[triangles], names)
    if mesh.materials is not None:
        _put_before(lines, "usemtl", mesh.materials[triangles], materials)
    return lines


def _labelled(attribute: Attribute) -> tuple[NDArray[np.int64], list[str]]:
    """The label of each face (m,), NONE where it has none, and the labels' names; those without one are numbers."""
    distinct, places = np.unique(attribute.values[:, 0], return_inverse=True)
    given = list(attribute.extra.get("names", ()))
    names = [str(given[one] if 0 <= one < len(given) else one) for one in map(int, distinct.tolist())]
    rows = attribute.rows()
    return np.append(places, NONE)[rows], unique_names(names, attribute.name)


def _put_before(lines: list[str], word: str, rows: NDArray[np.int64], names: Sequence[str]) -> None:
    """Put a statement before each face where the row changes; the row NONE is a statement without a name."""
    changes = np.flatnonzero(np.diff(rows, prepend=NONE))
    for place, row in zip(changes.tolist(), rows[changes].tolist(), strict=True):
        statement = word if row == NONE else f"{word} {names[row]}"
        lines[place] = f"{statement}\n{lines[place]}"
