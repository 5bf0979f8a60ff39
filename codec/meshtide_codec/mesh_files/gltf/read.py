"""From the bytes of a glTF file to a scene: what it claims is counted and held against the limits, then it is made.

Format: Khronos, "glTF 2.0 Specification".
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf import deformation, looks, nodes
from meshtide_codec.mesh_files.gltf.accessors import Accessors
from meshtide_codec.mesh_files.gltf.buffers import Buffers
from meshtide_codec.mesh_files.gltf.document import numbers, parsed, text
from meshtide_codec.mesh_files.gltf.extensions import INSTANCING, check_required
from meshtide_codec.mesh_files.gltf.geometry import Geometries
from meshtide_codec.mesh_files.gltf.glb import MAGIC, unpack
from meshtide_codec.mesh_files.gltf.primitives import PlannedMeshes, planned
from meshtide_codec.scene import Node, Scene

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh import Mesh
    from meshtide_codec.mesh_files.gltf.document import Document, Row
    from meshtide_codec.mesh_files.gltf.nodes import NodeGraph, Place
    from meshtide_codec.mesh_files.source import Source


_OF_MESHES = frozenset({"name", "primitives", "weights"})


def read_gltf(source: Source, limits: FileLimits) -> Scene:
    """The scene of a GLB or glTF file.

    A mesh that nodes show with other morph weights, or in a skin, becomes a geometry for each way; a skinned one stands
    in a node of its own at the root of the scene.

    Raises:
        MeshFileError: it is none, is damaged, needs what is not known, or claims too much.
    """
    if source.suffix == ".glb" or source.view[:4] == MAGIC:
        frame = unpack(source.view)
        plain, binary = frame.text, frame.binary
        if frame.rest:
            source.note(f"{frame.rest} bytes follow the end of the file: not read")
    else:
        plain, binary = source.data, None
    document = parsed(plain, limits)
    check_required(document)
    buffers = Buffers(document, binary, source, limits)
    accessors = Accessors(document, buffers)
    plan = planned(document, accessors, limits)
    graph = nodes.graph(document, accessors, source)
    _tell(plan, document, source)
    geometries = Geometries(accessors, plan.meshes)
    _check_claims(geometries, plan, graph, limits)
    made = _Made(document, accessors, geometries, graph)
    made.place_all()
    for line in made.notes:
        source.note(line)
    rest = looks.remaining(document)
    if any(made.rests):
        rest["meshes"] = made.rests
    return Scene(
        tuple(made.meshes),
        tuple(made.nodes),
        tuple(made.roots),
        looks.materials(document),
        looks.images(document, buffers, source, limits),
        tuple(made.names),
        rest,
    )


def _tell(plan: PlannedMeshes, document: Document, source: Source) -> None:
    left = [(plan.lines, "lines"), (plan.points, "points")]
    others = ", ".join(
        f"{name} ({count} {'primitive' if count == 1 else 'primitives'})" for count, name in left if count
    )
    if not any(plan.meshes):
        raise MeshFileError(f"there are no triangles in it, only {others}" if others else "there are no meshes in it")
    if others:
        source.note(f"{others}: left out")
    if plan.extensions:
        source.note(f"extensions of primitives ({', '.join(ascii(name)[1:-1] for name in plan.extensions)}): left out")
    animations = len(document.rows("animations"))
    if animations:
        source.note(f"animations ({animations}): left out")


def _check_claims(geometries: Geometries, plan: PlannedMeshes, graph: NodeGraph, limits: FileLimits) -> None:
    """Hold all meshes, and then all that is shown of them, against the limits."""
    sizes = [geometries.claimed(mesh) for mesh in range(len(plan.meshes))]
    limits.check_counts(sum(size[0] for size in sizes), sum(size[1] for size in sizes))
    vertices = faces = times = 0
    for index in graph.shown:
        place = graph.places[index]
        if place.mesh is not None:
            times += place.times
            vertices += place.times * sizes[place.mesh][0]
            faces += place.times * sizes[place.mesh][1]
    limits.check_counts(max(vertices, times), faces)
    if faces == 0:
        raise MeshFileError("the scene shows no triangles")


@dataclass(slots=True)
class _Made:
    """The parts of the scene as they grow."""

    document: Document
    accessors: Accessors
    geometries: Geometries
    graph: NodeGraph
    meshes: list[Mesh] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    rests: list[Row] = field(default_factory=list)
    nodes: list[Node] = field(default_factory=list)
    roots: list[int] = field(default_factory=list)
    notes: dict[str, None] = field(default_factory=dict)
    _known: dict[tuple[int, tuple[float, ...], tuple[int, int] | None], int] = field(default_factory=dict)
    _instances: dict[object, NDArray[np.float64]] = field(default_factory=dict)

    def place_all(self) -> None:
        """Make each node, and each geometry that one shows; then those that none shows."""
        worlds = self.graph.world_matrices()
        shown = set(self.graph.shown)
        skins = deformation.bind_poses(self.document, self.accessors, self._skins(shown), worlds)
        skinned: list[Node] = []
        for index, place in enumerate(self.graph.places):
            geometry = instances = None
            name = text(place.row, "name")
            if place.mesh is not None and self.geometries.meshes[place.mesh]:
                if index not in shown:
                    geometry = self._geometry(place.mesh, self._weights(place.mesh), None, None)
                elif place.skin is not None:
                    pose = deformation.Pose(*skins[place.skin], worlds[index])
                    weights = self._weights(place.mesh, place, f"nodes[{index}]")
                    baked = self._geometry(place.mesh, weights, (place.skin, index), pose)
                    skinned.append(Node(baked, name=name))
                    self.notes["skin: in its bind pose"] = None
                    if place.is_instanced:
                        self.notes["instances of a mesh in a skin: taken once"] = None
                else:
                    weights = self._weights(place.mesh, place, f"nodes[{index}]")
                    geometry = self._geometry(place.mesh, weights, None, None)
                    instances = self._instances_of(place, worlds[index], f"nodes[{index}]")
            properties = looks.node_properties(place.row, INSTANCING)
            self.nodes.append(Node(geometry, place.matrix, place.children, instances, name, properties))
        made = {key[0] for key in self._known}
        for mesh, primitives in enumerate(self.geometries.meshes):
            if primitives and mesh not in made:
                self._geometry(mesh, self._weights(mesh), None, None)
        self.roots = [*self.graph.roots, *range(len(self.nodes), len(self.nodes) + len(skinned))]
        self.nodes += skinned

    def _skins(self, shown: set[int]) -> dict[int, int]:
        """The skins that are needed, and of each the first node that names it."""
        users: dict[int, int] = {}
        for index, place in enumerate(self.graph.places):
            if (
                index in shown
                and place.skin is not None
                and place.mesh is not None
                and self.geometries.meshes[place.mesh]
            ):
                users.setdefault(place.skin, index)
        return users

    def _weights(self, mesh: int, place: Place | None = None, where: str = "") -> tuple[float, ...]:
        """The weights of morph targets: those of the node that shows the mesh, or else the mesh's own."""
        targets = max((len(one.targets) for one in self.geometries.meshes[mesh]), default=0)
        if targets == 0:
            return ()
        row = self.document.rows("meshes")[mesh]
        weights = numbers(row, "weights", f"meshes[{mesh}]")
        if place is not None and "weights" in place.row:
            weights = numbers(place.row, "weights", where)
        weights = weights[:targets]
        self.notes["morph targets: taken at their default weights"] = None
        return tuple(weights) if any(weights) else ()

    def _geometry(
        self, mesh: int, weights: tuple[float, ...], skin: tuple[int, int] | None, pose: deformation.Pose | None
    ) -> int:
        key = (mesh, weights, skin)
        if key not in self._known:
            self._known[key] = len(self.meshes)
            self.meshes.append(self.geometries.made(mesh, weights, pose))
            row = self.document.rows("meshes")[mesh]
            self.names.append(text(row, "name"))
            self.rests.append({key: value for key, value in row.items() if key not in _OF_MESHES})
        return self._known[key]

    def _instances_of(self, place: Place, world: NDArray[np.float64], where: str) -> NDArray[np.float64] | None:
        if not place.is_instanced:
            return None
        key = place.instances, place.times
        if key not in self._instances:
            self._instances[key] = nodes.instances(place, self.accessors, where)
        matrices = self._instances[key]
        with np.errstate(all="ignore"):
            if not np.isfinite(world @ matrices).all():
                raise MeshFileError(f"the instances of {where} lie beyond all numbers: their matrices overflow")
        return matrices
