"""Primitives of a glTF mesh: what they are made of, how much they claim, and their triangles.

Format: Khronos, "glTF 2.0 Specification", sections 3.7.2 (meshes) and 3.7.2.1 (topology).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf import draco
from meshtide_codec.mesh_files.gltf.document import extension, integer, mapping, optional, rows, whole
from meshtide_codec.mesh_files.gltf.extensions import DRACO, is_required

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.gltf.accessors import Accessors
    from meshtide_codec.mesh_files.gltf.document import Document, Row

POSITION = "POSITION"
_POINTS, _TRIANGLES, _STRIP, _FAN = 0, 4, 5, 6
_NAMED = 5
"""Names that a message lists at most."""
_POSITION_TYPES = frozenset({"VEC3"})


@dataclass(frozen=True, slots=True)
class DracoStream:
    """A primitive's Draco stream: its buffer view, and of its attributes the numbers by name."""

    view: int
    ids: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class Primitive:
    """Triangles of a mesh that share a material.

    Args:
        where: its name in messages.
        mode: 4, 5 or 6: triangles, a strip, a fan.
        attributes: accessors by name, POSITION among them.
        indices: accessor, or None where vertices stand in order.
        material: index, or -1.
        targets: accessors of each morph target by name.
        packed: its Draco stream, where that is what is read.
        vertices: how many it claims.
        corners: how many it claims.
        key: the same for primitives that stand on the same vertices.
    """

    where: str
    mode: int
    attributes: Mapping[str, int]
    indices: int | None
    material: int
    targets: tuple[Mapping[str, int], ...]
    packed: DracoStream | None
    vertices: int
    corners: int
    key: object

    @property
    def claimed_faces(self) -> int:
        """Triangles at most."""
        return self.corners // 3 if self.mode == _TRIANGLES else max(0, self.corners - 2)


@dataclass(slots=True)
class PlannedMeshes:
    """The meshes of a file before any of them is made.

    Args:
        meshes: of each its primitives of triangles.
        points: primitives of points that are left out.
        lines: of lines.
        extensions: names of those that primitives have and that are not read, a few of them.
    """

    meshes: list[list[Primitive]] = field(default_factory=list)
    points: int = 0
    lines: int = 0
    extensions: dict[str, None] = field(default_factory=dict)


def planned(document: Document, accessors: Accessors, limits: FileLimits) -> PlannedMeshes:
    """The primitives of all meshes, each checked for what stands behind it.

    Raises:
        MeshFileError: a primitive is not one, or claims what the file does not hold.
    """
    plan = PlannedMeshes()
    materials = len(document.rows("materials"))
    for number, mesh in enumerate(document.rows("meshes")):
        found = []
        for place, row in enumerate(rows(mesh, "primitives", f"meshes[{number}]")):
            where = f"meshes[{number}].primitives[{place}]"
            mode = integer(row, "mode", where, _TRIANGLES)
            if mode > _FAN:
                raise MeshFileError(f"{where} is of an unknown mode: {mode}")
            if mode == _POINTS:
                plan.points += 1
            elif mode < _TRIANGLES:
                plan.lines += 1
            else:
                found.append(_primitive(row, mode, where, accessors, limits))
                unread = [name[:80] for name in mapping(row, "extensions", where) if name != DRACO]
                plan.extensions |= dict.fromkeys(unread[: _NAMED - len(plan.extensions)])
                if found[-1].material >= materials:
                    raise MeshFileError(f"{where} has material {found[-1].material}; the file has {materials}")
        plan.meshes.append(found)
    return plan


def _primitive(row: Row, mode: int, where: str, accessors: Accessors, limits: FileLimits) -> Primitive:
    attributes = {name: whole(index, name, where) for name, index in _named(row, "attributes", where)}
    if POSITION not in attributes:
        raise MeshFileError(f"{where} has no POSITION")
    targets = tuple(
        {name: whole(index, name, f"a target of {where}") for name, index in one.items()}
        for one in rows(row, "targets", where)
    )
    indices = optional(row, "indices", where)
    material = optional(row, "material", where)
    packed = _packed(row, where)
    if packed is not None and _falls_back(accessors, attributes, indices, where):
        packed = None
    if packed is not None:
        data = accessors.buffers.view(packed.view, f"{DRACO} of {where}")
        vertices, faces = draco.counts(data[:65536].tobytes())
        limits.check_counts(vertices, faces)
        accessors.buffers.take(12 * (vertices + faces), f"{DRACO} of {where}")
        mode, corners = _TRIANGLES, 3 * faces
    else:
        form = accessors.form(attributes[POSITION], where)
        if not form.backed or form.shape not in _POSITION_TYPES:
            why = "has no buffer view, so no bytes stand behind it" if not form.backed else f"is of type {form.shape}"
            raise MeshFileError(f"accessors[{attributes[POSITION]}], the positions of {where}, {why}")
        if form.span is None:  # so many zeros must be allowed before faces are made of them
            accessors.array(attributes[POSITION], where)
        vertices = corners = form.count
        if indices is not None:
            corners = _index_count(accessors, indices, where)
    key: object = where
    if packed is None:
        key = tuple(sorted(attributes.items())), tuple(tuple(sorted(one.items())) for one in targets)
    material = -1 if material is None else material
    return Primitive(where, mode, attributes, indices, material, targets, packed, vertices, corners, key)


def _named(row: Row, key: str, where: str) -> list[tuple[str, object]]:
    return list(mapping(row, key, where).items())


def _packed(row: Row, where: str) -> DracoStream | None:
    found = extension(row, DRACO, where)
    if found is None:
        return None
    place = f"{DRACO} of {where}"
    ids = {name: whole(value, name, place) for name, value in _named(found, "attributes", place)}
    if POSITION not in ids:
        raise MeshFileError(f"{place} has no POSITION")
    return DracoStream(integer(found, "bufferView", place), ids)


def _falls_back(accessors: Accessors, attributes: Mapping[str, int], indices: int | None, where: str) -> bool:
    """Whether the primitive also stands uncompressed, and must be read so as the library is missing."""
    if draco.is_available() or is_required(accessors.document, DRACO):
        return False
    used = [*attributes.values(), *(() if indices is None else (indices,))]
    return all(accessors.form(index, where).backed for index in used)


def _index_count(accessors: Accessors, indices: int, where: str) -> int:
    form = accessors.form(indices, where)
    if form.shape != "SCALAR" or form.dtype.kind != "u":
        raise MeshFileError(f"accessors[{indices}], the indices of {where}, are not unsigned integers")
    if not form.backed:
        raise MeshFileError(f"accessors[{indices}], the indices of {where}, has no bytes behind it")
    return form.count


def triangles(primitive: Primitive, accessors: Accessors) -> NDArray[np.int64]:
    """The triangles (m, 3) of a primitive, in the order of its corners; of strips and fans without flat ones.

    Raises:
        MeshFileError: an index is out of range; the message names its accessor.
    """
    if primitive.indices is None:
        corners = np.arange(primitive.corners, dtype=np.int64)
    else:
        stored = accessors.array(primitive.indices, primitive.where).reshape(-1)
        largest = int(stored.max()) if len(stored) else -1
        if largest >= primitive.vertices:
            restart = largest == np.iinfo(stored.dtype).max
            why = f"; {largest} would restart a strip, which glTF does not allow" if restart else ""
            raise MeshFileError(
                f"accessors[{primitive.indices}] holds index {largest}, but {primitive.where} has "
                f"{primitive.vertices} vertices{why}"
            )
        corners = stored.astype(np.int64)
    if primitive.mode == _TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    first = np.arange(max(0, len(corners) - 2))
    if primitive.mode == _STRIP:
        odd = first & 1
        places = np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)
    else:
        places = np.stack([first + 1, first + 2, np.zeros_like(first)], axis=1)
    faces: NDArray[np.int64] = corners[places]
    flat = (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 2] == faces[:, 0])
    whole_faces: NDArray[np.int64] = faces[~flat]
    return whole_faces
