"""What a mesh file holds: geometries, the nodes that place them, materials, images; and all of it as one mesh.

The shape is glTF's, the richest of the formats: other files become a scene of one node. What meshtide has no use for is
kept unchanged, in `document` and in the `properties` of nodes and materials, so that it can be written again.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.attributes import NONE, Attribute, Domain, Kind, origin_of, with_origin
from meshtide_codec.mesh import Mesh

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

IDENTITY = np.eye(4)
IDENTITY.flags.writeable = False
TANGENT = "TANGENT"
"""The name of tangents in glTF: x y z, and on which side the bitangent is."""
_TANGENT_WIDTH = 4


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A place in a scene.

    Args:
        geometry: index into the scene's geometries, or None.
        matrix: (4, 4) float64, from the node's coordinates to those of its parent; points are columns.
        children: indices into the scene's nodes.
        instances: (k, 4, 4) float64, where the node's geometry stands k times in the node's coordinates, or None for
            once (EXT_mesh_gpu_instancing).
        name: as the file has it.
        properties: what else the file says of it, such as a camera, extras, extensions.
    """

    geometry: int | None = None
    matrix: NDArray[np.float64] = field(default_factory=lambda: IDENTITY)
    children: tuple[int, ...] = ()
    instances: NDArray[np.float64] | None = None
    name: str = ""
    properties: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Material:
    """How faces look.

    Args:
        name: as the file has it.
        properties: in the words of glTF's materials, other formats' translated; `mtl` holds the lines of an MTL file.
    """

    name: str = ""
    properties: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Image:
    """A picture file, as it came.

    Args:
        name: of the file, or what a glTF file calls it.
        data: its bytes; empty where the file that is named was not there.
        mime_type: such as image/png; empty where the file does not say.
        properties: what else a glTF file says of it.
    """

    name: str
    data: bytes
    mime_type: str = ""
    properties: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """All that a mesh file holds.

    Args:
        geometries: a mesh for each mesh of the file; the `materials` of a mesh are indices into those of the scene.
        nodes: which place them.
        roots: the nodes that are shown, from which all others hang.
        materials: of all geometries.
        images: which the materials name by index (`textures` in `document`, as in glTF).
        names: of the geometries.
        document: what else a glTF file holds, its JSON without accessors, buffers and what stands above.
        notes: what a person should know of the reading, a line each: what was left out, and how much of it.
    """

    geometries: tuple[Mesh, ...]
    nodes: tuple[Node, ...] = ()
    roots: tuple[int, ...] = ()
    materials: tuple[Material, ...] = ()
    images: tuple[Image, ...] = ()
    names: tuple[str, ...] = ()
    document: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, mesh: Mesh, materials: Sequence[Material] = (), notes: Sequence[str] = ()) -> Scene:
        """The scene of a file that knows one mesh and no nodes.

        >>> Scene.of(Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])).mesh()
        Mesh(3 vertices, 1 faces)
        """
        return cls((mesh,), (Node(0),), (0,), tuple(materials), notes=tuple(notes))

    def placements(self) -> Iterator[tuple[int, NDArray[np.float64]]]:
        """Each geometry that is shown with its matrix (4, 4), depth first; one shown k times comes k times.

        The nodes must form trees, which the readers see to. Cost: linear in the nodes.
        """
        waiting = [(root, IDENTITY) for root in reversed(self.roots)]
        while waiting:
            index, above = waiting.pop()
            node = self.nodes[index]
            matrix = node.matrix if above is IDENTITY else above @ node.matrix
            if node.geometry is not None:
                for instance in (IDENTITY,) if node.instances is None else node.instances:
                    yield node.geometry, matrix if instance is IDENTITY else matrix @ instance
            waiting += [(child, matrix) for child in reversed(node.children)]

    def counts(self) -> tuple[int, int]:
        """Vertices and faces of all that is shown, before any of it is made."""
        shown: dict[int, int] = {}
        waiting = list(self.roots)
        while waiting:
            node = self.nodes[waiting.pop()]
            waiting += node.children
            if node.geometry is not None:
                times = 1 if node.instances is None else len(node.instances)
                shown[node.geometry] = shown.get(node.geometry, 0) + times
        vertices = sum(times * len(self.geometries[index].vertices) for index, times in shown.items())
        return vertices, sum(times * len(self.geometries[index].faces) for index, times in shown.items())

    def mesh(self) -> Mesh:
        """All that is shown as one mesh, in the coordinates of the scene; faces that a matrix mirrors stay outward."""
        return joined([placed(self.geometries[index], matrix) for index, matrix in self.placements()])


def placed(mesh: Mesh, matrix: NDArray[np.float64]) -> Mesh:
    """The mesh moved by a matrix (4, 4); where it mirrors, the corners of each face are turned round.

    >>> mesh = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> placed(mesh, np.diag([-1.0, 1, 1, 1])).faces.tolist()
    [[0, 2, 1]]
    """
    if np.array_equal(matrix, IDENTITY):
        return mesh
    linear = matrix[:3, :3]
    with np.errstate(all="ignore"):  # what overflows is refused by name where the mesh is checked
        vertices = mesh.vertices @ linear.T + matrix[:3, 3]
        determinant = float(np.linalg.det(linear))
        attributes = tuple(_placed_attribute(one, linear, mirrors=determinant < 0) for one in mesh.attributes)
    moved = replace(mesh, vertices=vertices, attributes=attributes)
    return moved.reversed() if determinant < 0 else moved


def _placed_attribute(one: Attribute, linear: NDArray[np.float64], *, mirrors: bool) -> Attribute:
    """An attribute under a linear map: normals and tangents turn with the surface, others stay."""
    if one.kind is Kind.NORMAL:
        return replace(one, values=_turned(one.values, linear), normalized=False)
    if one.name == TANGENT and one.values.shape[1] == _TANGENT_WIDTH:
        return replace(one, values=_turned_tangents(one.values, linear, mirrors=mirrors), normalized=False)
    return one


def _turned_tangents(tangents: NDArray[Any], linear: NDArray[np.float64], *, mirrors: bool) -> NDArray[np.floating]:
    """Tangents x y z w (k, 4) under a linear map, of length one again.

    w, 1 or -1, is the side of the bitangent; a map that mirrors changes it (glTF 2.0 specification, 3.7.2.1).
    """
    turned = np.empty(tangents.shape)
    turned[:, :3] = tangents[:, :3] @ linear.T
    lengths = np.linalg.norm(turned[:, :3], axis=1, keepdims=True)
    turned[:, :3] /= np.where(lengths > 0, lengths, 1.0)
    side = tangents[:, 3] if tangents.dtype.kind == "f" else np.sign(tangents[:, 3])
    turned[:, 3] = side * (-1.0 if mirrors else 1.0)
    return turned.astype(tangents.dtype if tangents.dtype.kind == "f" else np.float32)


def _turned(normals: NDArray[Any], linear: NDArray[np.float64]) -> NDArray[np.floating]:
    """Normals (k, 3) under a linear map, by the matrix of its cofactors, and of length one again.

    Floats keep their type, so that meshes that were placed and others share one attribute; integers become float32.
    """
    cofactors = np.stack([np.cross(linear[i - 2], linear[i - 1]) for i in range(3)])
    turned: NDArray[np.float64] = normals @ cofactors.T * (-1.0 if np.linalg.det(linear) < 0 else 1.0)
    lengths = np.linalg.norm(turned, axis=1, keepdims=True)
    turned /= np.where(lengths > 0, lengths, 1.0)
    return turned.astype(normals.dtype if normals.dtype.kind == "f" else np.float32)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one, vertices and faces one after the other; nothing is welded.

    Attributes of one name, kind, type and width become one; what a mesh lacks is `NONE` there. An attribute that is
    of vertices in one mesh and of corners in another becomes one of corners. Texture coordinates count from the corner
    of the picture that the first of them count from.
    """
    if len(meshes) == 1:
        return meshes[0]
    if not meshes:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    materials = polygons = None
    if any(mesh.materials is not None for mesh in meshes):
        materials = np.concatenate([_or_full(mesh.materials, len(mesh.faces), NONE) for mesh in meshes])
    if any(mesh.polygons is not None for mesh in meshes):
        polygons = np.concatenate([_or_full(mesh.polygons, (len(mesh.faces), 3), fill=False) for mesh in meshes])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
        _joined_attributes(meshes),
        materials,
        polygons,
    )


def _or_full(array: NDArray[Any] | None, shape: int | tuple[int, int], fill: int) -> NDArray[Any]:
    if array is not None:
        return array
    return np.full(shape, fill, np.int64 if isinstance(shape, int) else np.bool_)


def _joined_attributes(meshes: Sequence[Mesh]) -> tuple[Attribute, ...]:
    found: dict[tuple[Any, ...], dict[int, Attribute]] = {}
    origins: dict[str, str] = {}
    for place, mesh in enumerate(meshes):
        for attribute in mesh.attributes:
            one = attribute
            if one.kind is Kind.TEXCOORD and origin_of(one) != origins.setdefault(one.name, origin_of(one)):
                one = with_origin(one, origins[one.name])
                if attribute.values.dtype.kind == "f":  # so that it stays one attribute
                    one = replace(one, values=one.values.astype(attribute.values.dtype))
            key: tuple[Any, ...] = (one.name, one.kind, one.values.shape[1], one.values.dtype.str, one.normalized)
            while place in found.get(key, ()):  # two of one name stay two
                key = (*key, None)
            found.setdefault(key, {})[place] = one
    return tuple(_joined_attribute(meshes, parts) for parts in found.values())


def _joined_attribute(meshes: Sequence[Mesh], parts: Mapping[int, Attribute]) -> Attribute:
    """One attribute of all meshes, of which some have a part; where domains differ all become those of corners."""
    domains = {part.domain for part in parts.values()}
    domain = domains.pop() if len(domains) == 1 else Domain.CORNER
    first = next(iter(parts.values()))
    rows, values, start = [], [], 0
    for place, mesh in enumerate(meshes):
        part = parts.get(place)
        if part is None:
            rows.append(np.full(_elements(mesh, domain), NONE, np.int64))
            continue
        own = part.rows() if part.domain is domain else _corner_rows(mesh, part)
        rows.append(np.where(own == NONE, NONE, own + start))
        values.append(part.values)
        start += len(part.values)
    table = np.concatenate(values)
    flat = np.concatenate(rows)
    plain = len(flat) == len(table) and bool((flat == np.arange(len(flat))).all())
    shape = (-1, 3) if domain is Domain.CORNER else (-1,)
    return replace(first, domain=domain, values=table, indices=None if plain else flat.reshape(shape))


def _elements(mesh: Mesh, domain: Domain) -> int:
    return {Domain.VERTEX: len(mesh.vertices), Domain.CORNER: 3 * len(mesh.faces), Domain.FACE: len(mesh.faces)}[domain]


def _corner_rows(mesh: Mesh, part: Attribute) -> NDArray[np.int64]:
    """The row of each corner (3 m,) of an attribute of any domain."""
    match part.domain:
        case Domain.VERTEX:
            return part.rows()[mesh.faces.reshape(-1)]
        case Domain.FACE:
            return np.repeat(part.rows(), 3)
        case Domain.CORNER:
            return part.rows()
