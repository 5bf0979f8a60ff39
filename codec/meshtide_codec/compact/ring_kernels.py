"""One-rings: the neighbours of each vertex in the order in which its triangles turn around it.

Each triangle at a vertex is a wedge from one neighbour to the next; wedges are chained head to tail. A closed ring is
a single chain that meets its start again; around borders, non-manifold and inconsistently oriented vertices the
chains stand one after the other. Vertices of more than RING_LIMIT triangles keep their wedges' first corners,
unsorted: time is O(faces * RING_LIMIT) whatever the input.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Faces = NDArray[np.int32]
    Rings = tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.uint8]]

RING_LIMIT = 64


@kernel
def collect_wedges(faces: Faces, vertices: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """For vertex v, wedges `ends[starts[v]:starts[v + 1]]` (from, to) in the order of the faces.

    `faces` (m, 3) must have every index in [0, vertices): the caller has checked that.
    """
    starts = np.zeros(vertices + 1, np.int32)
    for face in range(len(faces)):
        for corner in range(3):
            starts[faces[face, corner] + 1] += 1
    for vertex in range(vertices):
        starts[vertex + 1] += starts[vertex]
    filled = starts[:vertices].copy()
    ends = np.empty((3 * len(faces), 2), np.int32)
    for face in range(len(faces)):
        for corner in range(3):
            vertex = faces[face, corner]
            place = filled[vertex]
            ends[place, 0] = faces[face, (corner + 1) % 3]
            ends[place, 1] = faces[face, (corner + 2) % 3]
            filled[vertex] = place + 1
    return starts, ends


@kernel
def _take_wedge(ends: NDArray[np.int32], place: int, first: int) -> None:
    """Move the wedge at `place` out of the untaken ones, which then begin after `first`."""
    if place != first:
        ends[place, 0] = ends[first, 0]
        ends[place, 1] = ends[first, 1]


@kernel
def _reverse(members: NDArray[np.int32], begin: int, end: int) -> None:
    low = begin
    high = end - 1
    while low < high:
        held = members[low]
        members[low] = members[high]
        members[high] = held
        low += 1
        high -= 1


@kernel
def order_rings(faces: Faces, vertices: int) -> Rings:
    """Rings of all vertices: `members[starts[v]:starts[v + 1]]`, and whether each is one closed turn.

    `faces` (m, 3) must have every index in [0, vertices): the caller has checked that.

    Returns starts (vertices + 1,), members, closed (vertices,).
    """
    wedge_starts, ends = collect_wedges(faces, vertices)
    starts = np.zeros(vertices + 1, np.int32)
    members = np.empty(6 * len(faces) + 1, np.int32)
    closed = np.zeros(vertices, np.uint8)
    count = 0
    for vertex in range(vertices):
        first = wedge_starts[vertex]
        last = wedge_starts[vertex + 1]
        if last - first > RING_LIMIT:
            for place in range(first, last):
                members[count] = ends[place, 0]
                count += 1
            first = last
        ring_begin = count
        while first < last:
            chain_begin = count
            head = ends[first, 0]
            tail = ends[first, 1]
            first += 1
            members[count] = head
            count += 1
            meets = tail == head
            while not meets:  # forwards from the tail
                members[count] = tail
                count += 1
                place = first
                while place < last and ends[place, 0] != tail:
                    place += 1
                if place == last:
                    break
                tail = ends[place, 1]
                _take_wedge(ends, place, first)
                first += 1
                meets = tail == head
            if meets:
                closed[vertex] = 1 if chain_begin == ring_begin and first == last else 0
                continue
            forward_end = count
            while True:  # backwards from the head
                place = first
                while place < last and ends[place, 1] != head:
                    place += 1
                if place == last:
                    break
                head = ends[place, 0]
                _take_wedge(ends, place, first)
                first += 1
                members[count] = head
                count += 1
            if count > forward_end:  # chain = reversed backward part, then forward part
                _reverse(members, chain_begin, forward_end)
                _reverse(members, chain_begin, count)
        starts[vertex + 1] = count
    return starts, members[:count].copy(), closed


@kernel
def find_across(rings: Rings) -> NDArray[np.int32]:
    """For the ring slot of v that holds a, with b in the next slot: the vertex across edge (a, b) from v, or -1.

    It is read from the ring of a, where b stands between v and the vertex asked for. Rings longer than RING_LIMIT
    are passed over.
    """
    starts, members, closed = rings
    across = np.full(len(members), -1, np.int32)
    for vertex in range(len(closed)):
        begin, end = starts[vertex], starts[vertex + 1]
        if end - begin > RING_LIMIT:
            continue
        for slot in range(begin, end):
            near = members[slot]
            if slot + 1 < end:
                other = members[slot + 1]
            elif closed[vertex]:
                other = members[begin]
            else:
                continue
            near_begin, near_end = starts[near], starts[near + 1]
            if near_end - near_begin > RING_LIMIT:
                continue
            for place in range(near_begin, near_end):
                if members[place] != other:
                    continue
                after = before = -1
                if place + 1 < near_end:
                    after = members[place + 1]
                elif closed[near]:
                    after = members[near_begin]
                if place > near_begin:
                    before = members[place - 1]
                elif closed[near]:
                    before = members[near_end - 1]
                if before == vertex:
                    across[slot] = after
                elif after == vertex:
                    across[slot] = before
                break
    return across
