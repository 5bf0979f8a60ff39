"""Levels: cells of the octree, the triangles between them, and who is beside whom (docs/format.md, section 4).

An encoder's levels are made by the very walk that codes them: half-edges, heads and slots stand as a decoder's will.
It has nothing to decide here.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshtide_codec.errors import MapConnError

if TYPE_CHECKING:
    from collections.abc import Iterator

Single = np.float32
"""Numbers of 32 bits: every operation rounds once."""
Vector = NDArray[np.float32]
"""x, y, z, and a fourth number that each use explains."""
Point = tuple[int, int, int]

NONE = -1
RING_LIMIT = 24
PROBES = 16
SEARCH_LIMIT = 64
FAN_LIMIT = 32


@dataclass
class Level:
    """The vertices of one depth in Morton order, and its faces.

    Half-edge 4 t + k runs from corner k of face t to its next one; there is no half-edge 4 t + 3.

    Attributes:
        depth: of the octree.
        centres: of the cells, in half finest steps.
        cell_depths: at which the cells arose.
        leaves: whether a cell holds one finest vertex.
        parents: in the coarser level.
        first_children: in the finer level, once that is known, and one entry more.
        corners: of each half-edge, where it begins.
        twins: of each half-edge, the one that runs back, or NONE.
        heads: of each vertex, a half-edge that leaves it, one without twin if there is one; NONE without faces.
        degrees: of each vertex, its faces.
    """

    depth: int
    centres: list[Point]
    cell_depths: list[int]
    leaves: list[bool]
    parents: list[int]
    first_children: list[int] = field(default_factory=list)
    corners: list[int] = field(default_factory=list)
    twins: list[int] = field(default_factory=list)
    heads: list[int] = field(default_factory=list)
    degrees: list[int] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.parents)

    def faces(self) -> list[Point]:
        """Each rotated so that its least corner comes first, in lexicographic order."""
        found = []
        for first in range(0, len(self.corners), 4):
            a, b, c = self.corners[first : first + 3]
            found.append(min((a, b, c), (b, c, a), (c, a, b)))
        if len(set(found)) < len(found):
            raise MapConnError("a face is there twice")
        return sorted(found)


def root(vertices: int, bits: int) -> Level:
    """Depth 0: the whole cube, for a mesh of so many finest vertices."""
    middle = 1 << bits
    return Level(0, [(middle, middle, middle)], [0], [vertices == 1], [0], heads=[NONE], degrees=[0])


def after(half_edge: int) -> int:
    """The next half-edge of the same face."""
    return half_edge - 2 if half_edge & 3 == 2 else half_edge + 1


def before(half_edge: int) -> int:
    """The half-edge before it, of the same face."""
    return half_edge + 2 if half_edge & 3 == 0 else half_edge - 1


@dataclass
class Ring:
    """The fan of a vertex' head: its neighbours one after the other.

    Attributes:
        members: at most 24, and one more if that is where the fan ends at a border.
        ways: of each member, the half-edge from it to the one after it, in a face of the vertex; NONE for the last
            member, unless the ring is closed.
        closed: whether the last member's way leads to the first.
    """

    members: list[int]
    ways: list[int]
    closed: bool


def ring_of(level: Level, vertex: int) -> Ring:
    """The ring of a vertex; empty without faces."""
    ring = Ring([], [], closed=False)
    head = half_edge = level.heads[vertex]
    while half_edge != NONE and len(ring.members) < RING_LIMIT:
        ahead, back = after(half_edge), before(half_edge)
        ring.members.append(level.corners[ahead])
        ring.ways.append(ahead)
        half_edge = level.twins[back]
        if half_edge == head:
            ring.closed = True
            return ring
        if half_edge == NONE:
            ring.members.append(level.corners[back])
            ring.ways.append(NONE)
    if ring.ways:
        ring.ways[-1] = NONE  # a member after it is left out
    return ring


class CellTable:
    """Which vertex lives in a cell: a hash table that may leave some out.

    Args:
        count: how many cells will be put in.
    """

    def __init__(self, count: int) -> None:
        self._size = 1 << max(2, (2 * count + 1).bit_length())
        self._entries: list[tuple[int, int] | None] = [None] * self._size

    def put(self, cell: Point, vertex: int) -> None:
        """A cell that is there already keeps its vertex."""
        home, tag = _hash(cell)
        for probe in range(PROBES):
            place = (home + probe) % self._size
            entry = self._entries[place]
            if entry is None:
                self._entries[place] = tag, vertex
                return
            if entry[0] == tag:
                return

    def find(self, cell: Point) -> int:
        """The vertex of a cell, or NONE."""
        home, tag = _hash(cell)
        for probe in range(PROBES):
            entry = self._entries[(home + probe) % self._size]
            if entry is None:
                return NONE
            if entry[0] == tag:
                return entry[1]
        return NONE


def _hash(cell: Point) -> tuple[int, int]:
    """Home and tag."""
    x, y, z = cell
    code = (x << 42 | y << 21 | z) * 0x9E3779B97F4A7C15 % 2**64
    code = (code ^ code >> 32) * 0xD6E8FEB86659FD93 % 2**64
    return code >> 32, code % 2**32


def vector(x: Single | float, y: Single | float, z: Single | float, fourth: Single | float = 0.0) -> Vector:
    """Four numbers of 32 bits."""
    return np.array([x, y, z, fourth], Single)


def dot(a: Vector, b: Vector) -> Single:
    """The products of x, y and z, added in this order."""
    x, y, z, _ = a * b
    total: Single = x + y + z
    return total


def cross(a: Vector, b: Vector) -> Vector:
    """The cross product; its fourth number is 0."""
    ax, ay, az, _ = a
    bx, by, bz, _ = b
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx, 0], Single)


def least(a: Vector, b: Vector | Single | float) -> Vector:
    """The lesser of both; b where neither is."""
    b = np.asarray(b, Single)
    return np.where(a < b, a, b)


def greatest(a: Vector, b: Vector | Single | float) -> Vector:
    """The greater of both; b where neither is."""
    b = np.asarray(b, Single)
    return np.where(a > b, a, b)


def exponent(value: Single) -> int:
    """The greatest k with 2^k <= value, for a normal number; -127 for 0."""
    return (int(Single(value).view(np.int32)) >> 23) - 127


def arc(cosine: Single) -> Single:
    """The angle of a cosine, in half turns.

    M. Abramowitz and I. Stegun, "Handbook of Mathematical Functions", 4.4.45.
    """
    x = min(abs(cosine), Single(1))
    angle = np.sqrt(Single(1) - x) * (
        Single(0.4999787) + x * (Single(-0.0675181) + x * (Single(0.0236380) - x * Single(0.0059617)))
    )
    return Single(Single(1) - angle if cosine < 0 else angle)


# ---- Levels in the making


class Coarse:
    """The coarse level as the walk asks it.

    Args:
        several: whether edges may have more than one face a side, so that twins do not reach all of them.
    """

    def __init__(self, level: Level, *, several: bool) -> None:
        self.level = level
        self.covered = [False] * (len(level.corners) // 4)
        self._several = several
        self._leaving: list[list[int]] = [[] for _ in range(len(level))]
        for h, corner in enumerate(level.corners):
            if h & 3 != 3:
                self._leaving[corner].append(h)
        self._crowded = [several and self._is_crowded(vertex) for vertex in range(len(level))]

    def _is_crowded(self, vertex: int) -> bool:
        """Whether the vertex' fan and the twins miss some faces at its edges."""
        targets = [self.level.corners[after(h)] for h in self._leaving[vertex]]
        return len(set(targets)) < len(targets) or len(list(self._fan(vertex, len(targets)))) < len(targets)

    def _fan(self, vertex: int, limit: int) -> Iterator[int]:
        """The half-edges that leave a vertex, from its head on, while they have twins."""
        head = h = self.level.heads[vertex]
        for _ in range(limit):
            if h == NONE:
                return
            yield h
            h = self.level.twins[before(h)]
            if h == head:
                return

    def crowded(self, vertex: int) -> bool:
        """Whether a vertex' edges may have several faces a side."""
        return self._crowded[vertex]

    def children(self, vertex: int) -> range:
        """Its vertices of the fine level."""
        return range(self.level.first_children[vertex], self.level.first_children[vertex + 1])

    def split(self, vertex: int) -> bool:
        """Whether it has several children."""
        return len(self.children(vertex)) > 1

    def apex(self, h: int) -> int:
        """The corner across a half-edge."""
        return self.level.corners[before(h)]

    def is_covered(self, h: int) -> bool:
        """Whether a fine face is known above the face of a half-edge."""
        return self.covered[h >> 2]

    def edge(self, p: int, q: int) -> int:
        """A half-edge p -> q, or NONE."""
        leaving = self._leaving[p][:SEARCH_LIMIT] if self._crowded[p] else self._fan(p, SEARCH_LIMIT)
        return next((h for h in leaving if self.level.corners[after(h)] == q), NONE)

    def edges(self, p: int, q: int, known: int) -> list[int]:
        """The half-edges p -> q, one of which is `known` unless that is NONE."""
        if self._crowded[p] or self._crowded[q] or (known == NONE and self._several):
            return [h for h in self._leaving[p][:SEARCH_LIMIT] if self.level.corners[after(h)] == q]
        return [] if known == NONE else [known]

    def neighbours(self, p: int) -> list[int]:
        """The vertices around, some of them twice."""
        corners = self.level.corners
        if self._crowded[p]:
            return [v for h in self._leaving[p][:SEARCH_LIMIT] for v in (corners[after(h)], corners[before(h)])]
        found = []
        for h in self._fan(p, FAN_LIMIT):
            found.append(corners[after(h)])
            if self.level.twins[before(h)] == NONE:
                found.append(corners[before(h)])
        return found

    def lack(self, p: int) -> int:
        """8 (children, up to 3, less one) + faces of the fan that are not covered, up to 7."""
        uncovered = sum(not self.is_covered(h) for h in self._fan(p, FAN_LIMIT))
        return 8 * (min(len(self.children(p)), 3) - 1) + min(uncovered, 7)


class Front:
    """The fine mesh in the making: its faces so far, and the gates, half-edges where others may follow.

    Attributes:
        positions: of the vertices, in cells of the fine depth.
        gates: for each open half-edge the coarse half-edge whose face lies ahead, or NONE.
        split: whether a vertex has siblings.
        borders: 1 for vertices at a gate that was found to have no face.
        angles: of each vertex the sum of its faces' angles, in half turns (effort high).
    """

    def __init__(self, coarse: Level, fine: Level, faces: int, bits: int, *, positions: bool, high: bool) -> None:
        count = len(fine)
        unit = Single(2 << (bits - fine.depth))
        self.parents = fine.parents
        self.positions: list[Vector] = []
        if positions:
            self.positions = [vector(*centre) * (Single(1) / unit) for centre in fine.centres]
        self.gates: dict[int, int] = {}
        self._from: list[list[int]] = [[] for _ in range(count)]  # gates, the newest last
        self._to: list[list[int]] = [[] for _ in range(count)]
        self.split = [coarse.first_children[parent + 1] - coarse.first_children[parent] > 1 for parent in fine.parents]
        self.borders = [0] * count
        self.degrees = [0] * count
        self.angles = [Single(0)] * count
        self.heads = [NONE] * count
        slots = max(faces, len(coarse.corners) // 4)
        self.corners = [NONE] * (4 * slots)
        self.twins = [NONE] * (4 * slots)
        self.face_limit = faces
        self.face_count = self.slot_count = 0
        self.free_slots: list[int] = []
        self._high = high

    @property
    def full(self) -> bool:
        """Whether all faces are known."""
        return self.face_count == self.face_limit

    def is_face(self, slot: int) -> bool:
        """Whether there is a face in a slot."""
        return self.corners[4 * slot] != NONE

    def newest_from(self, v: int) -> int:
        """The newest gate that leaves a vertex, or NONE."""
        return self._from[v][-1] if self._from[v] else NONE

    def newest_to(self, v: int) -> int:
        """The newest gate that reaches a vertex, or NONE."""
        return self._to[v][-1] if self._to[v] else NONE

    def find_gate(self, origin: int, target: int) -> int:
        """The newest gate from here to there, among the newest 64."""
        newest = self._from[origin][: -SEARCH_LIMIT - 1 : -1]
        return next((h for h in newest if self.corners[after(h)] == target), NONE)

    def open(self, h: int, ahead: int) -> None:
        """Make a gate."""
        self.gates[h] = ahead
        self.twins[h] = NONE
        self._from[self.corners[h]].append(h)
        self._to[self.corners[after(h)]].append(h)

    def close(self, h: int) -> None:
        """A gate no longer."""
        del self.gates[h]
        self._from[self.corners[h]].remove(h)
        self._to[self.corners[after(h)]].remove(h)

    def join(self, h: int, gate: int) -> None:
        """Make a gate and a half-edge twins."""
        self.close(gate)
        self.twins[h], self.twins[gate] = gate, h

    def add(self, a: int, b: int, c: int) -> int:
        """A face, in the lowest free slot; its first half-edge."""
        if self.full:
            raise MapConnError("more faces than were announced")
        if self.free_slots:
            slot = self.free_slots.pop()
        else:
            slot = self.slot_count
            self.slot_count += 1
        self.put(slot, a, b, c)
        if self._high:
            self.add_angles(4 * slot)
        return 4 * slot

    def put(self, slot: int, a: int, b: int, c: int) -> None:
        """A face in a slot of its own."""
        self.face_count += 1
        for k, v in enumerate((a, b, c)):
            self.corners[4 * slot + k] = v
            self.degrees[v] += 1
            self.heads[v] = 4 * slot + k

    def add_angles(self, h: int) -> None:
        """Add the angles of the face whose first half-edge this is to those of its corners."""
        a, b, c = self.corners[h : h + 3]
        p, q, r = self.positions[a], self.positions[b], self.positions[c]
        pq, qr, rp = q - p, r - q, p - r
        g, j, i = dot(pq, pq), dot(qr, qr), dot(rp, rp)
        for v, along, product in ((a, g + i - j, g * i), (b, g + j - i, g * j), (c, i + j - g, i * j)):
            self.angles[v] += arc(along * Single(0.5) / np.sqrt(product + Single(1e-20)))

    def finish(self, fine: Level) -> None:
        """Fill the slots that are still free with the last faces, and hand the mesh over."""
        for hole in self.free_slots:  # the highest first
            while self.slot_count and not self.is_face(self.slot_count - 1):
                self.slot_count -= 1
            if self.slot_count <= self.face_count:
                break
            if hole < self.face_count:
                self.slot_count -= 1
                self._move(self.slot_count, hole)
        end = 4 * self.face_count
        fine.corners, fine.twins = self.corners[:end], self.twins[:end]
        fine.heads, fine.degrees = self.heads, self.degrees
        for h in range(end):
            if h & 3 != 3 and fine.twins[h] == NONE:
                fine.heads[fine.corners[h]] = h

    def _move(self, slot: int, hole: int) -> None:
        for k in range(3):
            twin, h = self.twins[4 * slot + k], 4 * hole + k
            if twin != NONE and twin >> 2 == slot:
                twin = 4 * hole + (twin & 3)  # of a face that meets itself
            self.twins[h] = twin
            if twin != NONE:
                self.twins[twin] = h
            self.corners[h] = self.corners[4 * slot + k]
            self.heads[self.corners[h]] = h
            self.corners[4 * slot + k] = NONE
