"""Kernels of mesh simplification: edges are collapsed in the order of what they cost in quadric error.

Source: Garland, Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997, with a weak pull
towards the collapsed ends that keeps flat regions well shaped.
Faces may meet in any way. Collapses that turn a face over are put off, and those that glue sheets together are made
only when no others are left, so that meshes of many parts get as coarse as any. The queue is a heap whose outdated
entries are skipped. O((n + m) log m); ties are broken by the vertices' numbers: a mesh always simplifies the same way.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from meshtide_codec.compact.quadric_kernels import LEAST_PULL, QUADRIC_SIZE, face_normal, minimum, trace
from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer

    Points = NDArray[np.float64]
    Integers = NDArray[np.int32]

NONE = -1
PULL = 1e-3  # weight of the squared distances to the collapsed ends, against that of the planes
TURNED = 0.2  # cosine between a face's normals before and after, below which it counts as turned over

WORK_PER_FACE = 500  # corners looked at; surfaces take about 60, hubs with thousands of faces any number

HEAP_SIZE = 0
LIVE_VERTICES = 1
MARK = 2
GLUING = 3
WORK = 4
PROGRESS_SIZE = 5


class Simplification(NamedTuple):
    """A mesh while it is simplified.

    Attributes:
        positions: (n, 3) float64, moved as vertices merge.
        faces: (m, 3) int32, current corners.
        alive: (m,) bool, faces that are left.
        quadrics: (n, 10) float64 of each vertex.
        first: (n,) int32, each vertex' list of corners (3 face + corner), NONE at the end.
        last: (n,) int32, the end of that list.
        following: (3 m,) int32, the next corner in the list.
        versions: (n,) int32, how often each vertex was moved; NONE once it was merged into another.
        marks: (n,) int64, scratch.
        costs: (h,) float64 of the heap's entries.
        entries: (h, 4) int32: two vertices, and their versions when the cost was found.
        sum_of_two: (10,) float64, scratch.
        progress: (5,) int64, see HEAP_SIZE, LIVE_VERTICES, MARK, GLUING and WORK.
    """

    positions: Points
    faces: Integers
    alive: NDArray[np.bool_]
    quadrics: Points
    first: Integers
    last: Integers
    following: Integers
    versions: Integers
    marks: NDArray[np.int64]
    costs: Points
    entries: Integers
    sum_of_two: Points
    progress: NDArray[np.int64]


@kernel
def prepare(mesh: Simplification, edges: Integers) -> None:
    """Make corner lists, count the vertices in use, and queue the edges (e, 2), each given once.

    The faces have indices in range and three different corners each.
    """
    mesh.first[:] = NONE
    mesh.versions[:] = NONE
    for face in range(len(mesh.faces)):
        for corner in range(3):
            vertex = mesh.faces[face, corner]
            slot = 3 * face + corner
            mesh.following[slot] = NONE
            if mesh.first[vertex] == NONE:
                mesh.first[vertex] = slot
                mesh.versions[vertex] = 0
                mesh.progress[LIVE_VERTICES] += 1
            else:
                mesh.following[mesh.last[vertex]] = slot
            mesh.last[vertex] = slot
    for edge in range(len(edges)):
        _push(mesh, edges[edge, 0], edges[edge, 1])


@kernel
def simplify(mesh: Simplification, target: Integer) -> None:
    """Collapse edges until no more than `target` vertices are in use, or no edge is left that may collapse.

    It also ends when WORK_PER_FACE is used up.
    """
    limit = WORK_PER_FACE * (len(mesh.faces) + 1)
    while mesh.progress[LIVE_VERTICES] > target and mesh.progress[WORK] < limit:
        if mesh.progress[HEAP_SIZE] == 0:
            if mesh.progress[GLUING] == 1:
                break
            mesh.progress[GLUING] = 1
            for vertex in range(len(mesh.positions)):
                _queue_around(mesh, vertex, vertex)
            continue
        u, v = mesh.entries[0, 0], mesh.entries[0, 1]
        current = _is_current(mesh, 0)
        _pop(mesh)
        if not current:
            continue
        _, x, y, z = _collapsed(mesh, u, v)
        if (
            (mesh.progress[GLUING] == 0 and _glues(mesh, u, v))
            or _turns(mesh, u, v, x, y, z)
            or _turns(mesh, v, u, x, y, z)
        ):
            continue
        _merge(mesh, u, v, x, y, z)
        _queue_around(mesh, u, NONE)


@kernel
def _collapsed(mesh: Simplification, u: Integer, v: Integer) -> tuple[float, float, float, float]:
    """What it costs to collapse the edge, and where the merged vertex goes: there is a pull to both ends."""
    x = 0.5 * (mesh.positions[u, 0] + mesh.positions[v, 0])
    y = 0.5 * (mesh.positions[u, 1] + mesh.positions[v, 1])
    z = 0.5 * (mesh.positions[u, 2] + mesh.positions[v, 2])
    dx, dy, dz = mesh.positions[u, 0] - x, mesh.positions[u, 1] - y, mesh.positions[u, 2] - z
    for index in range(QUADRIC_SIZE):
        mesh.sum_of_two[index] = mesh.quadrics[u, index] + mesh.quadrics[v, index]
    pull = PULL * trace(mesh.sum_of_two) + LEAST_PULL
    cost, x, y, z = minimum(mesh.sum_of_two, x, y, z, pull)
    return cost + pull * (dx * dx + dy * dy + dz * dz), x, y, z


@kernel
def _glues(mesh: Simplification, u: Integer, v: Integer) -> bool:
    """Whether the ends share more neighbours than faces: the collapse would glue other edges together."""
    mesh.progress[MARK] += 1
    mark = mesh.progress[MARK]
    shared_faces = 0
    slot = mesh.first[u]
    while slot != NONE:
        mesh.progress[WORK] += 1
        face = slot // 3
        if mesh.alive[face]:
            for corner in range(3):
                mesh.marks[mesh.faces[face, corner]] = mark
                if mesh.faces[face, corner] == v:
                    shared_faces += 1
        slot = mesh.following[slot]
    mesh.marks[u] = mesh.marks[v] = 0
    shared_vertices = 0
    slot = mesh.first[v]
    while slot != NONE:
        mesh.progress[WORK] += 1
        face = slot // 3
        if mesh.alive[face]:
            for corner in range(3):
                other = mesh.faces[face, corner]
                if mesh.marks[other] == mark:
                    mesh.marks[other] = 0
                    shared_vertices += 1
        slot = mesh.following[slot]
    return shared_vertices > shared_faces


@kernel
def _turns(mesh: Simplification, moved: Integer, merged: Integer, x: float, y: float, z: float) -> bool:
    """Whether a face of `moved` that survives its merging with `merged` would be turned over by the move."""
    slot = mesh.first[moved]
    while slot != NONE:
        mesh.progress[WORK] += 1
        face = slot // 3
        corner = slot - 3 * face
        slot = mesh.following[slot]
        if not mesh.alive[face]:
            continue
        b, c = mesh.faces[face, (corner + 1) % 3], mesh.faces[face, (corner + 2) % 3]
        if merged in (b, c):
            continue
        old_x, old_y, old_z = face_normal(mesh.positions, mesh.faces, face)
        bx, by, bz = mesh.positions[b, 0] - x, mesh.positions[b, 1] - y, mesh.positions[b, 2] - z
        cx, cy, cz = mesh.positions[c, 0] - x, mesh.positions[c, 1] - y, mesh.positions[c, 2] - z
        new_x, new_y, new_z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        product = old_x * new_x + old_y * new_y + old_z * new_z
        old = old_x * old_x + old_y * old_y + old_z * old_z
        new = new_x * new_x + new_y * new_y + new_z * new_z
        if product < 0.0 or product * product < TURNED * TURNED * old * new:
            return True
    return False


@kernel
def _merge(mesh: Simplification, u: Integer, v: Integer, x: float, y: float, z: float) -> None:
    """Merge v into u at the given place; faces of both die, and so do faces that have become the same."""
    slot = mesh.first[v]
    while slot != NONE:
        mesh.progress[WORK] += 1
        face = slot // 3
        if mesh.alive[face]:
            mesh.faces[face, slot - 3 * face] = u
            a, b, c = mesh.faces[face, 0], mesh.faces[face, 1], mesh.faces[face, 2]
            if b in (a, c) or c == a:
                mesh.alive[face] = False
        slot = mesh.following[slot]
    mesh.following[mesh.last[u]] = mesh.first[v]
    mesh.last[u] = mesh.last[v]
    mesh.positions[u, 0] = x
    mesh.positions[u, 1] = y
    mesh.positions[u, 2] = z
    mesh.quadrics[u] += mesh.quadrics[v]
    mesh.versions[v] = NONE
    mesh.versions[u] += 1
    mesh.progress[LIVE_VERTICES] -= 1
    _drop_dead(mesh, u)


@kernel
def _drop_dead(mesh: Simplification, vertex: Integer) -> None:
    """Take dead faces out of the vertex' list; vertices that are left without faces go out of use."""
    slot = mesh.first[vertex]
    kept: Integer = NONE
    while slot != NONE:
        mesh.progress[WORK] += 1
        following = mesh.following[slot]
        face = slot // 3
        if mesh.alive[face]:
            if kept == NONE:
                mesh.first[vertex] = slot
            else:
                mesh.following[kept] = slot
            kept = slot
        else:
            for corner in range(3):
                other = mesh.faces[face, corner]
                if other != vertex and mesh.versions[other] != NONE and not _has_faces(mesh, other):
                    mesh.versions[other] = NONE
                    mesh.progress[LIVE_VERTICES] -= 1
        slot = following
    if kept == NONE:
        mesh.versions[vertex] = NONE
        mesh.progress[LIVE_VERTICES] -= 1
    else:
        mesh.following[kept] = NONE
        mesh.last[vertex] = kept


@kernel
def _has_faces(mesh: Simplification, vertex: Integer) -> bool:
    slot = mesh.first[vertex]
    while slot != NONE:
        if mesh.alive[slot // 3]:
            return True
        slot = mesh.following[slot]
    return False


@kernel
def _queue_around(mesh: Simplification, vertex: Integer, above: Integer) -> None:
    """Queue the edges from a vertex, if it is in use, to its neighbours of greater number than `above`."""
    if mesh.versions[vertex] == NONE:
        return
    mesh.progress[MARK] += 1
    mark = mesh.progress[MARK]
    slot = mesh.first[vertex]
    while slot != NONE:
        mesh.progress[WORK] += 1
        face = slot // 3
        if mesh.alive[face]:
            for corner in range(3):
                other = mesh.faces[face, corner]
                if other != vertex and other > above and mesh.marks[other] != mark:
                    mesh.marks[other] = mark
                    _push(mesh, min(vertex, other), max(vertex, other))
        slot = mesh.following[slot]


@kernel
def _is_current(mesh: Simplification, index: Integer) -> bool:
    entry = mesh.entries[index]
    current: bool = (
        mesh.versions[entry[0]] == entry[2]
        and mesh.versions[entry[1]] == entry[3]
        and entry[2] != NONE
        and entry[3] != NONE
    )
    return current


@kernel
def _push(mesh: Simplification, u: Integer, v: Integer) -> None:
    """Queue an edge; when the heap is full, the outdated entries are taken out first.

    Current entries are no more than edges, and edges do not become more: the heap has room for twice as many.
    """
    if mesh.progress[HEAP_SIZE] == len(mesh.costs):
        _compact(mesh)
        if mesh.progress[HEAP_SIZE] == len(mesh.costs):
            return
    index = mesh.progress[HEAP_SIZE]
    cost, _, _, _ = _collapsed(mesh, u, v)
    mesh.progress[HEAP_SIZE] += 1
    _place(mesh, index, cost, u, v, mesh.versions[u], mesh.versions[v])
    while index > 0 and _before(mesh, index, (index - 1) // 2):
        _swap(mesh, index, (index - 1) // 2)
        index = (index - 1) // 2


@kernel
def _pop(mesh: Simplification) -> None:
    """Take the first entry out of the heap."""
    mesh.progress[HEAP_SIZE] -= 1
    end = mesh.progress[HEAP_SIZE]
    _swap(mesh, 0, end)
    _sink(mesh, 0, end)


@kernel
def _compact(mesh: Simplification) -> None:
    kept = 0
    for index in range(mesh.progress[HEAP_SIZE]):
        if _is_current(mesh, index):
            _swap(mesh, kept, index)
            kept += 1
    mesh.progress[HEAP_SIZE] = kept
    for index in range(kept // 2 - 1, -1, -1):
        _sink(mesh, index, kept)


@kernel
def _sink(mesh: Simplification, index: Integer, end: Integer) -> None:
    while True:
        child = 2 * index + 1
        if child >= end:
            return
        if child + 1 < end and _before(mesh, child + 1, child):
            child += 1
        if not _before(mesh, child, index):
            return
        _swap(mesh, child, index)
        index = child


@kernel
def _before(mesh: Simplification, i: Integer, j: Integer) -> bool:
    if mesh.costs[i] != mesh.costs[j]:
        return bool(mesh.costs[i] < mesh.costs[j])
    if mesh.entries[i, 0] != mesh.entries[j, 0]:
        return bool(mesh.entries[i, 0] < mesh.entries[j, 0])
    return bool(mesh.entries[i, 1] < mesh.entries[j, 1])


@kernel
def _swap(mesh: Simplification, i: Integer, j: Integer) -> None:
    cost = mesh.costs[i]
    mesh.costs[i] = mesh.costs[j]
    mesh.costs[j] = cost
    for column in range(4):
        held = mesh.entries[i, column]
        mesh.entries[i, column] = mesh.entries[j, column]
        mesh.entries[j, column] = held


@kernel
def _place(
    mesh: Simplification, index: Integer, cost: float, u: Integer, v: Integer, of_u: Integer, of_v: Integer
) -> None:
    mesh.costs[index] = cost
    mesh.entries[index, 0] = u
    mesh.entries[index, 1] = v
    mesh.entries[index, 2] = of_u
    mesh.entries[index, 3] = of_v
