"""The nodes of a glTF file: trees, what each shows, where, and what the default scene shows of them.

Format: Khronos, "glTF 2.0 Specification", sections 3.5 (scenes, nodes, transformations), and "EXT_mesh_gpu_instancing".
Nodes that have two parents or are their own ancestors are refused. Cost: linear in the nodes, however deep.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf.document import extension, integers, mapping, numbers, optional, whole
from meshtide_codec.mesh_files.gltf.extensions import INSTANCING
from meshtide_codec.scene import IDENTITY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_codec.mesh_files.gltf.accessors import Accessors
    from meshtide_codec.mesh_files.gltf.document import Document, Row
    from meshtide_codec.mesh_files.source import Source

    Matrix = NDArray[np.float64]

_INSTANCE_BYTES = 128
_PARTS = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}


class Place(NamedTuple):
    """A node before its mesh is made.

    Args:
        row: its JSON.
        matrix: (4, 4), to its parent.
        children: indices of nodes.
        mesh: index, or None.
        skin: index, or None.
        instances: accessors of the parts of its instances by name; empty where it stands once.
        times: how often its mesh stands there.
        is_instanced: whether it has instances, be it none or one.
    """

    row: Row
    matrix: Matrix
    children: tuple[int, ...]
    mesh: int | None
    skin: int | None
    instances: tuple[tuple[str, int], ...]
    times: int
    is_instanced: bool


@dataclass(frozen=True, slots=True)
class NodeGraph:
    """All nodes of a file.

    Args:
        places: the nodes.
        parents: of each node, or -1.
        roots: of the scene that is shown.
        shown: the nodes that hang from them, each after its parent.
    """

    places: list[Place]
    parents: list[int]
    roots: list[int]
    shown: list[int]

    def world_matrices(self) -> Matrix:
        """The matrices (k, 4, 4) of the nodes, from the coordinates of each to those of its tree.

        Raises:
            MeshFileError: numbers grow beyond all bounds on the way.
        """
        worlds: list[Matrix] = [IDENTITY] * len(self.places)
        waiting = [index for index, parent in enumerate(self.parents) if parent < 0]
        with np.errstate(all="ignore"):
            while waiting:
                index = waiting.pop()
                place, parent = self.places[index], self.parents[index]
                above = IDENTITY if parent < 0 else worlds[parent]
                worlds[index] = place.matrix if above is IDENTITY else above @ place.matrix
                waiting += place.children
        result = np.array(worlds).reshape(-1, 4, 4)
        if not np.isfinite(result).all():
            beyond = np.flatnonzero(~np.isfinite(result).all(axis=(1, 2)))
            raise MeshFileError(f"nodes[{beyond[0]}] lies beyond all numbers: its matrix overflows")
        return result


def graph(document: Document, accessors: Accessors, source: Source) -> NodeGraph:
    """The nodes of a file and what is shown of them.

    Raises:
        MeshFileError: a node is not one, or the nodes form no trees.
    """
    rows = document.rows("nodes")
    if not rows and document.rows("meshes"):
        source.note("the file has no nodes: each mesh is taken once")
        rows = [{"mesh": index} for index in range(len(document.rows("meshes")))]
    matrices = _matrices(rows)
    places = [
        _place(row, matrix, f"nodes[{index}]", document, accessors)
        for index, (row, matrix) in enumerate(zip(rows, matrices, strict=True))
    ]
    parents = _parents(places)
    downward = _reached(places, [index for index, parent in enumerate(parents) if parent < 0])
    if len(downward) < len(places):
        circle = min(set(range(len(places))) - set(downward))
        raise MeshFileError(f"nodes[{circle}] is its own ancestor; nodes must form trees")
    roots = _roots(document, parents, downward, source)
    shown = _reached(places, roots)
    hidden = sum(_is_hidden(places[index]) for index in shown)
    if hidden:
        source.note(f"nodes that the file hides ({hidden}): taken like the others")
    return NodeGraph(places, parents, roots, shown)


def _is_hidden(place: Place) -> bool:
    return (extension(place.row, "KHR_node_visibility", "a node") or {}).get("visible") is False


def _place(row: Row, matrix: Matrix, where: str, document: Document, accessors: Accessors) -> Place:
    mesh, skin = optional(row, "mesh", where), optional(row, "skin", where)
    if mesh is not None:
        document.row("meshes", mesh, where)
    parts: tuple[tuple[str, int], ...] = ()
    times = 1
    instancing = extension(row, INSTANCING, where)
    if instancing is not None and mesh is not None:
        place = f"{INSTANCING} of {where}"
        given = mapping(instancing, "attributes", place)
        parts = tuple((name, whole(given[name], name, place)) for name in _PARTS if name in given)
        used = [whole(index, name, place) for name, index in given.items()]
        sizes = {accessors.form(index, place).count for index in used}
        if len(sizes) != 1:
            raise MeshFileError(f"{place} has attributes of {len(sizes) or 'no'} lengths")
        times = sizes.pop()
    children = tuple(integers(row, "children", where))
    return Place(row, matrix, children, mesh, skin, parts, times, instancing is not None and mesh is not None)


def _matrices(rows: Sequence[Row]) -> list[Matrix]:
    """Of each node its matrix (4, 4), all of them made at once."""
    result = [IDENTITY] * len(rows)
    moved: list[int] = []
    parts: tuple[list[list[float]], list[list[float]], list[list[float]]] = ([], [], [])
    for index, row in enumerate(rows):
        where = f"nodes[{index}]"
        if "matrix" in row:
            values = numbers(row, "matrix", where, [0.0] * 16)
            if values[3::4] != [0, 0, 0, 1]:
                raise MeshFileError(f"matrix of {where} is of no place: its last row is not 0 0 0 1")
            result[index] = np.array(values).reshape(4, 4).T
        elif row.keys() & {"translation", "rotation", "scale"}:
            moved.append(index)
            parts[0].append(numbers(row, "translation", where, (0.0, 0.0, 0.0)))
            parts[1].append(numbers(row, "rotation", where, (0.0, 0.0, 0.0, 1.0)))
            parts[2].append(numbers(row, "scale", where, (1.0, 1.0, 1.0)))
    if moved:
        made = transforms(*(np.array(part) for part in parts))
        for place, index in enumerate(moved):
            result[index] = made[place]
    return result


def transforms(translations: Matrix, rotations: Matrix, scales: Matrix) -> Matrix:
    """Matrices (k, 4, 4) of translations (k, 3), quaternions x y z w (k, 4) and scales (k, 3).

    Quaternions are taken at length one; one of length zero turns nothing.

    >>> transforms(np.zeros((1, 3)), np.array([[0.0, 0, 1, 0]]), np.ones((1, 3)))[0][:2, :2].tolist()
    [[-1.0, 0.0], [0.0, -1.0]]
    """
    result = np.zeros((len(translations), 4, 4))
    with np.errstate(all="ignore"):  # what overflows is refused where matrices are multiplied
        largest = np.abs(rotations).max(axis=1, keepdims=True, initial=0)  # so that no square vanishes or overflows
        rotations = rotations / np.where(largest > 0, largest, 1)
        lengths = np.linalg.norm(rotations, axis=1, keepdims=True)
        x, y, z, w = (rotations / np.where(lengths > 0, lengths, 1)).T
        w = np.where(lengths[:, 0] > 0, w, 1.0)
        turned = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        for i in range(3):
            for j in range(3):
                result[:, i, j] = turned[i][j] * scales[:, j]
    result[:, :3, 3] = translations
    result[:, 3, 3] = 1
    return result


def instances(place: Place, accessors: Accessors, where: str) -> Matrix:
    """The matrices (k, 4, 4) of a node's instances.

    Raises:
        MeshFileError: an attribute is of another type, or holds what is not finite.
    """
    accessors.buffers.take(_INSTANCE_BYTES * place.times, f"{INSTANCING} of {where}")
    tables: dict[str, Any] = {
        "TRANSLATION": np.zeros((place.times, 3)),
        "ROTATION": np.tile([0.0, 0, 0, 1], (place.times, 1)),
        "SCALE": np.ones((place.times, 3)),
    }
    for name, index in place.instances:
        form = accessors.form(index, where)
        if form.shape != _PARTS[name]:
            raise MeshFileError(f"accessors[{index}], {name} of {INSTANCING} of {where}, is of type {form.shape}")
        with np.errstate(all="ignore"):
            tables[name] = accessors.real(index, where)
        if not np.isfinite(tables[name]).all():
            raise MeshFileError(f"accessors[{index}], {name} of {INSTANCING} of {where}, holds what is not finite")
    return transforms(tables["TRANSLATION"], tables["ROTATION"], tables["SCALE"])


def _parents(places: Sequence[Place]) -> list[int]:
    parents = [-1] * len(places)
    for index, place in enumerate(places):
        for child in place.children:
            if child >= len(places):
                raise MeshFileError(f"nodes[{index}] has the child {child}; the file has {len(places)} nodes")
            if parents[child] >= 0:
                raise MeshFileError(
                    f"nodes[{child}] has two parents, nodes[{parents[child]}] and nodes[{index}]; nodes must form trees"
                )
            parents[child] = index
    return parents


def _roots(document: Document, parents: Sequence[int], downward: Sequence[int], source: Source) -> list[int]:
    scenes = document.rows("scenes")
    if not scenes:
        source.note("the file has no scenes: all of its nodes are taken")
        return [index for index, parent in enumerate(parents) if parent < 0]
    default = optional(document.root, "scene", "the file")
    chosen = default or 0
    row = document.row("scenes", chosen, "scene of the file")
    if len(scenes) > 1:
        why = "the first" if default is None else "its default"
        source.note(f"the file has {len(scenes)} scenes: scene {chosen}, {why}, is taken")
    named = integers(row, "nodes", f"scenes[{chosen}]")
    for index in named:
        if index >= len(parents):
            raise MeshFileError(f"scenes[{chosen}] shows nodes[{index}]; the file has {len(parents)} nodes")
    return _without_repeats(named, parents, downward, source)


def _without_repeats(
    named: Sequence[int], parents: Sequence[int], downward: Sequence[int], source: Source
) -> list[int]:
    """The roots that are named, each once, without those that hang from another one."""
    roots = dict.fromkeys(named)
    beneath = [False] * len(parents)
    for index in downward:
        parent = parents[index]
        beneath[index] = parent >= 0 and (beneath[parent] or parent in roots)
    kept = [root for root in roots if not beneath[root]]
    if len(kept) < len(named):
        source.note("the scene names nodes twice, or that hang from others of it: each is taken once")
    return kept


def _reached(places: Sequence[Place], roots: Sequence[int]) -> list[int]:
    reached: list[int] = []
    waiting = list(reversed(roots))
    while waiting:
        index = waiting.pop()
        reached.append(index)
        waiting += reversed(places[index].children)
    return reached
