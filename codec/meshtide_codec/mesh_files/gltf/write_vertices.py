"""A mesh as glTF holds one: a vertex for each wedge, faces by their material, attributes by glTF's names and types.

Format: Khronos, "glTF 2.0 Specification", section 3.7.2.1 and "KHR_mesh_quantization" for what integers may stand for.
Values of corners and faces split vertices where they differ. Faces that lack an attribute stand on vertices of their
own, as a primitive has an attribute for all of its vertices or not at all. A mesh without such things keeps its
vertices, in their order.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.attributes import NONE, UPPER_LEFT, Attribute, Domain, Kind, with_origin
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf.accessors import real

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_codec.mesh import Mesh

_OWN_NAME = re.compile(r"NORMAL|TANGENT|(TEXCOORD|COLOR|JOINTS|WEIGHTS)_[0-9]+")
_WIDTHS = {"NORMAL": (3,), "TANGENT": (4,), "TEXCOORD": (2,), "COLOR": (3, 4), "JOINTS": (4,), "WEIGHTS": (4,)}
_FAMILIES = {Kind.NORMAL: "NORMAL", Kind.TEXCOORD: "TEXCOORD", Kind.COLOR: "COLOR"}
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


@dataclass(frozen=True, slots=True)
class Part:
    """Vertices and the primitives that stand on them.

    Args:
        positions: (n, 3) float32.
        attributes: with a value for each vertex.
        primitives: material, or -1, and faces (m, 3) of each.
    """

    positions: NDArray[np.float32]
    attributes: tuple[Attribute, ...]
    primitives: tuple[tuple[int, NDArray[np.int64]], ...]


@dataclass(slots=True)
class Losses:
    """What glTF cannot hold of the meshes that are written, reported once for all of them.

    Args:
        attributes: that are left out.
        lines: what else is left out or changed.
        rounding: of each attribute that was rounded the largest error.
    """

    attributes: list[Attribute] = field(default_factory=list)
    lines: dict[str, None] = field(default_factory=dict)
    rounding: dict[str, float] = field(default_factory=dict)

    def rounded(self, name: str, before: NDArray[Any], after: NDArray[Any]) -> None:
        """Note how far values were moved by their type."""
        with np.errstate(all="ignore"):
            lost = np.abs(after.astype(np.float64) - before)
        error = float(lost[np.isfinite(lost)].max(initial=0))
        if error:
            self.rounding[name] = max(error, self.rounding.get(name, 0))

    def notes(self) -> tuple[str, ...]:
        """A line each."""
        rounded = (f"{name}: rounded to 32-bit floats, by {error:.3g} at most" for name, error in self.rounding.items())
        return (*self.lines, *rounded)


def parts(mesh: Mesh, where: str, losses: Losses) -> list[Part]:
    """The parts of a mesh; what is rounded or left out is added to the losses.

    Raises:
        MeshFileError: a position is not finite.
    """
    positions = _positions(mesh, where, losses)
    attributes = _legal(mesh.attributes, losses)
    rows = [_corner_rows(mesh, one) for one in attributes]
    lacking = np.array([(row == NONE).all(axis=1) for row in rows]).reshape(len(rows), len(mesh.faces))
    for one, row, lacks in zip(attributes, rows, lacking, strict=True):
        if ((row == NONE).any(axis=1) & ~lacks).any():
            losses.lines[f"{one.name}: some faces have it at some corners only; zeros stand at the others"] = None
    if not lacking.any():
        return [_part(mesh, positions, attributes, rows, np.arange(len(mesh.faces)), whole=True)]
    patterns, pattern = np.unique(lacking, axis=1, return_inverse=True)
    result = []
    for number in range(patterns.shape[1]):
        present = np.flatnonzero(~patterns[:, number])
        faces = np.flatnonzero(pattern.reshape(-1) == number)
        kept = [attributes[i] for i in present]
        result.append(_part(mesh, positions, kept, [rows[i] for i in present], faces, whole=False))
    return result


def _positions(mesh: Mesh, where: str, losses: Losses) -> NDArray[np.float32]:
    with np.errstate(all="ignore"):
        positions = mesh.vertices.astype(np.float32)
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if len(bad):
        raise MeshFileError(f"vertex {bad[0]} of {where} is not a number of 32 bits: {mesh.vertices[bad[0]].tolist()}")
    losses.rounded("positions", mesh.vertices, positions)
    return positions


def _legal(attributes: Sequence[Attribute], losses: Losses) -> list[Attribute]:
    """The attributes by names and types that glTF allows."""
    taken = {one.name for one in attributes if _OWN_NAME.fullmatch(one.name)}
    result: list[Attribute] = []
    for attribute in attributes:
        one = with_origin(attribute, UPPER_LEFT) if attribute.kind is Kind.TEXCOORD else attribute
        width = one.values.shape[1]
        if width not in _SHAPES:
            losses.attributes.append(one)
            continue
        name = _name(one, taken, {other.name for other in result})
        values, normalized = _typed(one, name.partition("_")[0])
        if values.dtype.kind == "f" and not one.normalized:
            losses.rounded(one.name, one.values, values)
        result.append(replace(one, name=name, values=values, normalized=normalized))
    return result


def _name(attribute: Attribute, taken: set[str], used: set[str]) -> str:
    family = attribute.name.partition("_")[0]
    width = attribute.values.shape[1]
    if _OWN_NAME.fullmatch(attribute.name) and width in _WIDTHS[family] and attribute.name not in used:
        return attribute.name
    family = _FAMILIES.get(attribute.kind, "")
    colors = attribute.values.dtype.kind == "f" or attribute.normalized
    if family and width in _WIDTHS[family] and (family != "COLOR" or colors):
        names = ["NORMAL"] if family == "NORMAL" else [f"{family}_{i}" for i in range(len(taken) + len(used) + 1)]
        free = [name for name in names if name not in taken and name not in used]
        if free:
            return free[0]
    plain = attribute.name if attribute.name.startswith("_") else f"_{attribute.name}"
    return next(name for name in (plain, *(f"{plain}_{i}" for i in range(1, len(used) + 2))) if name not in used)


def _typed(attribute: Attribute, family: str) -> tuple[NDArray[Any], bool]:
    """The values in a type that glTF has for attributes of that name."""
    values = attribute.values
    small = values.dtype.kind in "iu" and values.dtype.itemsize <= 2
    match family:
        case "JOINTS":
            keep = small and values.dtype.kind == "u"
        case "COLOR" | "WEIGHTS":
            keep = small and values.dtype.kind == "u" and attribute.normalized
        case "NORMAL" | "TANGENT":
            keep = small and values.dtype.kind == "i" and attribute.normalized
        case _:
            keep = small
    if keep:
        return values.astype(values.dtype.newbyteorder("<")), attribute.normalized
    with np.errstate(all="ignore"):
        return real(values, normalized=attribute.normalized).astype("<f4"), False


def _corner_rows(mesh: Mesh, attribute: Attribute) -> NDArray[np.int64]:
    """The row of each corner (m, 3) of an attribute of any domain."""
    rows = attribute.rows()
    if attribute.domain is Domain.VERTEX:
        taken: NDArray[np.int64] = rows[mesh.faces]
        return taken
    return np.repeat(rows, 3).reshape(-1, 3) if attribute.domain is Domain.FACE else rows.reshape(-1, 3)


def _part(
    mesh: Mesh,
    positions: NDArray[np.float32],
    attributes: Sequence[Attribute],
    rows: Sequence[NDArray[np.int64]],
    chosen: NDArray[np.int64],
    *,
    whole: bool,
) -> Part:
    """The part of the chosen faces; a vertex for each combination of rows that its corners have."""
    corners = mesh.faces[chosen]
    splitting = [row[chosen] for one, row in zip(attributes, rows, strict=True) if one.domain is not Domain.VERTEX]
    if whole and not splitting:
        vertices, faces = np.arange(len(positions)), corners
        tables = [one.per_element() for one in attributes]
    else:
        key = corners.reshape(-1)
        for row in splitting:
            key = np.unique(key, return_inverse=True)[1].reshape(-1)
            key = key * (int(row.max(initial=0)) + 2) + row.reshape(-1) + 1
        _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
        vertices, faces = corners.reshape(-1)[first], inverse.reshape(corners.shape)
        tables = [_taken(one, row[chosen].reshape(-1)[first]) for one, row in zip(attributes, rows, strict=True)]
    kept = tuple(
        Attribute(one.name, one.kind, Domain.VERTEX, table, normalized=one.normalized)
        for one, table in zip(attributes, tables, strict=True)
    )
    if mesh.materials is None:
        return Part(positions[vertices], kept, ((NONE, faces),))
    materials = mesh.materials[chosen]
    return Part(
        positions[vertices],
        kept,
        tuple((int(material), faces[materials == material]) for material in np.unique(materials)),
    )


def _taken(attribute: Attribute, rows: NDArray[np.int64]) -> NDArray[Any]:
    if len(attribute.values) == 0:
        return np.zeros((len(rows), attribute.values.shape[1]), attribute.values.dtype)
    taken: NDArray[Any] = attribute.values[np.maximum(rows, 0)]
    taken[rows == NONE] = 0
    return taken
