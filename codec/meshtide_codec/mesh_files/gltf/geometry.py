"""From the primitives of a glTF mesh to one mesh: vertices that primitives share are there once, faces in their order.

Format: Khronos, "glTF 2.0 Specification", section 3.7.2. Each attribute keeps its name, type and normalization; one
that some primitives lack has no value there. A mesh that shares its positions with other meshes takes only those that
its faces use, as the rest belongs to the others.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.attributes import NONE, UPPER_LEFT, Attribute, Domain, Kind
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.gltf import deformation, draco
from meshtide_codec.mesh_files.gltf.accessors import Table
from meshtide_codec.mesh_files.gltf.extensions import DRACO
from meshtide_codec.mesh_files.gltf.primitives import POSITION, triangles
from meshtide_codec.scene import joined

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_codec.mesh_files.gltf.accessors import Accessors
    from meshtide_codec.mesh_files.gltf.deformation import Pose
    from meshtide_codec.mesh_files.gltf.primitives import DracoStream, Primitive

_KINDS = {"NORMAL": Kind.NORMAL, "TEXCOORD": Kind.TEXCOORD, "COLOR": Kind.COLOR}
_ROW_BYTES = 24
"""About what an attribute of a vertex takes where primitives are joined: its values, and its row."""
_DIRECTIONS = frozenset({"NORMAL", "TANGENT"})


@dataclass(slots=True)
class Geometries:
    """Makes the meshes of a file.

    Args:
        accessors: of the file.
        meshes: the primitives of each.
    """

    accessors: Accessors
    meshes: Sequence[Sequence[Primitive]]
    _users: Counter[int] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        for mesh in self.meshes:
            self._users.update({one.attributes[POSITION] for one in mesh if one.packed is None})

    def claimed(self, mesh: int) -> tuple[int, int]:
        """Vertices and faces that a mesh becomes at most, before it is made."""
        groups: dict[object, tuple[int, int]] = {}
        for one in self.meshes[mesh]:
            vertices, corners = groups.get(one.key, (one.vertices, 0))
            groups[one.key] = vertices, corners + (3 * one.claimed_faces if self._is_shared(one) else vertices)
        vertices = sum(min(pair) for pair in groups.values())
        return vertices, sum(one.claimed_faces for one in self.meshes[mesh])

    def _is_shared(self, primitive: Primitive) -> bool:
        """Whether other meshes stand on the same positions."""
        return primitive.packed is None and self._users[primitive.attributes[POSITION]] > 1

    def made(self, mesh: int, weights: Sequence[float], pose: Pose | None) -> Mesh:
        """One mesh of the file, deformed.

        Args:
            mesh: index.
            weights: of its morph targets.
            pose: of its skin, or None.

        Raises:
            MeshFileError: an accessor does not hold what a primitive asks for.
        """
        groups: dict[object, list[int]] = {}
        primitives = self.meshes[mesh]
        for place, one in enumerate(primitives):
            groups.setdefault(one.key, []).append(place)
        parts = [self._group([primitives[place] for place in places], weights, pose) for places in groups.values()]
        if len(parts) > 1:
            names = {name for one in primitives for name in one.attributes}
            count = len(names) * sum(len(part.vertices) for part, _ in parts)
            self.accessors.buffers.take(_ROW_BYTES * count, f"meshes[{mesh}]")
        result = joined([part for part, _ in parts])
        order = [place for places in groups.values() for place in places]
        if order != sorted(order):
            sizes = [size for _, one in parts for size in one]
            starts = np.cumsum([0, *sizes])
            ranges = {place: np.arange(starts[i], starts[i + 1]) for i, place in enumerate(order)}
            rows = np.concatenate([ranges[place] for place in sorted(order)])
            materials = None if result.materials is None else result.materials[rows]
            result = replace(result, faces=result.faces[rows], materials=materials)
        return result.reversed() if pose is not None and pose.mirrors else result

    def _group(
        self, primitives: Sequence[Primitive], weights: Sequence[float], pose: Pose | None
    ) -> tuple[Mesh, list[int]]:
        """The mesh of primitives that share their vertices, and the faces of each."""
        first = primitives[0]
        if first.packed is not None:
            faces, tables = self._unpacked(first, first.packed)
            sizes = [len(faces)]
        else:
            parts = [triangles(one, self.accessors) for one in primitives]
            tables = self._tables(first)
            faces = parts[0] if len(parts) == 1 else np.concatenate(parts)
            sizes = [len(part) for part in parts]
        count = len(tables[POSITION].values)
        chosen = self._chosen(first, faces)
        if chosen is not None:
            faces = np.searchsorted(chosen, faces)
            tables = {name: Table(table.values[chosen], table.normalized) for name, table in tables.items()}
        positions = tables.pop(POSITION).real()

        def morphed(values: NDArray[np.float64], name: str) -> NDArray[np.float64]:
            return deformation.morphed(
                values, name, first.targets, weights, self.accessors, where=first.where, count=count, chosen=chosen
            )

        vertices = morphed(positions, POSITION)
        for name, table in tables.items():
            if any(weight and name in target for target, weight in zip(first.targets, weights, strict=False)):
                with np.errstate(all="ignore"):
                    tables[name] = Table(morphed(table.real(), name).astype(np.float32), normalized=False)
        if pose is not None:
            vertices, tables = _posed(vertices, tables, pose, first.where)
        attributes = tuple(_attribute(name, table) for name, table in tables.items())
        materials = None
        if any(size and one.material != NONE for one, size in zip(primitives, sizes, strict=True)):
            materials = np.repeat(np.array([one.material for one in primitives], np.int64), sizes)
        return Mesh(vertices, faces, attributes, materials), sizes

    def _chosen(self, primitive: Primitive, faces: NDArray[np.int64]) -> NDArray[np.int64] | None:
        """The vertices that faces use, where others may belong to other meshes; None for all."""
        if not self._is_shared(primitive):
            return None
        used = np.unique(faces)
        return None if len(used) == primitive.vertices else used

    def _tables(self, primitive: Primitive) -> dict[str, Table]:
        tables = {}
        for name, index in primitive.attributes.items():
            form = self.accessors.form(index, primitive.where)
            if form.count != primitive.vertices:
                raise MeshFileError(
                    f"accessors[{index}], {name} of {primitive.where}, has {form.count} elements for "
                    f"{primitive.vertices} vertices"
                )
            tables[name] = Table(self.accessors.array(index, primitive.where), form.normalized)
        return tables

    def _unpacked(self, primitive: Primitive, packed: DracoStream) -> tuple[NDArray[np.int64], dict[str, Table]]:
        """Faces and attributes of a Draco stream, types as their accessors say; other attributes as accessors."""
        place = f"{DRACO} of {primitive.where}"
        stream = draco.decode(self.accessors.buffers.view(packed.view, place).tobytes())
        tables = {}
        for name, number in packed.ids.items():
            values = stream.attributes.get(number)
            if values is None:
                raise MeshFileError(f"{place} holds no attribute {number}, its {name}")
            normalized = False
            if name in primitive.attributes:
                form = self.accessors.form(primitive.attributes[name], primitive.where)
                normalized = form.normalized
                values = values.astype(form.dtype) if _fits(values, form.dtype) else values
            tables[name] = Table(values, normalized)
        for name, index in primitive.attributes.items():
            if name not in tables:
                form = self.accessors.form(index, primitive.where)
                tables[name] = Table(self.accessors.array(index, primitive.where), form.normalized)
        count, faces = len(tables[POSITION].values), stream.faces
        sound = all(len(table.values) == count for table in tables.values()) and tables[POSITION].values.shape[1] == 3
        if not sound or (faces.size and not 0 <= faces.min() <= faces.max() < count):
            raise MeshFileError(f"{place} is damaged: its attributes and faces do not fit together")
        self.accessors.buffers.limits.check_counts(count, len(faces))
        return faces, tables


def _attribute(name: str, table: Table) -> Attribute:
    kind = _kind(name, table)
    extra = {"origin": UPPER_LEFT} if kind is Kind.TEXCOORD else {}
    return Attribute(name, kind, Domain.VERTEX, table.values, normalized=table.normalized, extra=extra)


def _kind(name: str, table: Table) -> Kind:
    kind = _KINDS.get(name.partition("_")[0], Kind.SCALAR)
    return Kind.SCALAR if kind is Kind.NORMAL and table.values.shape[1] != 3 else kind


def _fits(values: NDArray[Any], dtype: np.dtype[Any]) -> bool:
    """Whether all values are of a type, whatever the library gave."""
    if values.dtype == dtype or dtype.kind == "f":
        return values.dtype.kind in "iuf"
    bounds = np.iinfo(dtype)
    return values.dtype.kind in "iu" and (
        not values.size or bool(bounds.min <= values.min() and values.max() <= bounds.max)
    )


def _posed(
    vertices: NDArray[np.float64], tables: dict[str, Table], pose: Pose, where: str
) -> tuple[NDArray[np.float64], dict[str, Table]]:
    """Vertices and attributes where the joints put them."""
    sets = []
    for number in range(len(tables)):
        joints, weights = tables.get(f"JOINTS_{number}"), tables.get(f"WEIGHTS_{number}")
        if joints is None or weights is None:
            break
        if joints.values.dtype.kind != "u" or joints.values.shape != weights.values.shape:
            raise MeshFileError(f"JOINTS_{number} and WEIGHTS_{number} of {where} do not fit together")
        sets.append((joints, weights))
    names = [name for name in tables if name in _DIRECTIONS and tables[name].values.shape[1] >= 3]
    moved, turned = deformation.posed(vertices, [tables[name].real() for name in names], sets, pose, where)
    return moved, tables | {name: Table(one, normalized=False) for name, one in zip(names, turned, strict=True)}
