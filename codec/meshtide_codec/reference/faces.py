"""Connectivity: the faces of a level, given those of the coarser one (docs/format.md, section 7).

An encoder finds out whether edges of the coarse level have several faces a side; then it walks without writing, at
first as if nothing rare were needed (`clean`), again if that fails, and sees whether every gate had a face among its
candidates (`closed`) and whether there were extra faces. At a gate or above a seed it wants the first face in canonical
order that fits and is not coded yet.
"""

from __future__ import annotations

from meshtide_codec.errors import MapConnError
from meshtide_codec.reference.candidates import (
    AHEAD,
    APEX,
    AROUND,
    COUNT,
    COVERED,
    DOUBT,
    ESCAPE,
    EXTRA,
    FIRST,
    HOLE,
    NUMBERS,
    SECOND,
    SEED,
    SIBLING,
    THIRD,
    WITHIN,
    Candidates,
    Decisions,
    GateKind,
    Lacks,
)
from meshtide_codec.reference.coding import SIGNED_CONTEXTS, Layer, RangeDecoder
from meshtide_codec.reference.levels import NONE, Coarse, Front, Level, Single, after, before, dot

LARGEST_FAMILY = 32  # of which all are looked at
NEAR = 16
LARGEST_LIST = 256
FAR = Single(3e38)


class FacesDecoder:
    """Decodes the faces of one level.

    Args:
        coarse, fine: the levels; the fine one has its vertices.
        layer: what the levels before have learned.
        bits: of the grid.
        most_faces: of any level.
        positions: whether the fine vertices have positions.
        high: effort high.
    """

    def __init__(
        self,
        decoder: RangeDecoder,
        coarse: Level,
        fine: Level,
        layer: Layer,
        *,
        bits: int,
        most_faces: int,
        positions: bool,
        high: bool,
    ) -> None:
        self._fine = fine
        count = 2 * len(fine) + layer.mixer.contexts.signed(decoder, NUMBERS + COUNT * SIGNED_CONTEXTS)
        if not 0 <= count <= most_faces:
            raise MapConnError("more faces than were announced")
        self._high = high and positions
        self._front = Front(coarse, fine, count, bits, positions=positions, high=self._high)
        self._candidates = Candidates(self._front, layer.scores, positions=positions, high=self._high)
        self._decisions = Decisions(decoder, layer, self._candidates, positions=positions, high=self._high)
        several = self._closed = self._clean = self._extra = False
        if count:
            several, self._closed, self._clean = (self._decisions.flag() for _ in range(3))
            self._extra = not self._clean and self._decisions.flag()
        self._several = several
        self._coarse = Coarse(coarse, several=several)
        self._copied = [False] * (len(coarse.corners) // 4)
        self._stack: list[int] = []  # gates to be visited, the next one last
        self._later: list[int] = []  # gates that wait, the next one first
        self._within: list[int] = []
        self._last_leftover = 0

    def decode(self) -> None:
        """Fill in corners, twins, heads and degrees of the fine level."""
        self._copy_faces()
        self._run_gates()
        seed = edge = 0
        while not self._front.full:
            edge, found = self._extra_face(edge) if self._extra else (0, False)
            while seed < len(self._coarse.covered) and self._coarse.covered[seed]:
                seed += 1
            if found:
                pass
            elif seed < len(self._coarse.covered):
                self._seed(seed)
            elif not self._clean:
                self._leftover()
            else:
                raise MapConnError("faces are missing")
            self._run_gates()
        self._front.finish(self._fine)

    # ---- faces that are the coarse level's

    def _copy_faces(self) -> None:
        """Coarse faces without split corners stand in the fine level, in their slots."""
        front, coarse, level = self._front, self._coarse, self._coarse.level
        slots = len(self._copied)
        front.slot_count = slots
        for slot in range(slots - 1, -1, -1):
            a, b, c = (level.first_children[corner] for corner in level.corners[4 * slot : 4 * slot + 3])
            if front.split[a] or front.split[b] or front.split[c]:
                front.free_slots.append(slot)
                continue
            if front.full:
                raise MapConnError("more faces than were announced")
            self._copied[slot] = coarse.covered[slot] = True
            front.put(slot, a, b, c)
            front.twins[4 * slot : 4 * slot + 4] = level.twins[4 * slot : 4 * slot + 4]
        for slot in range(slots):
            if self._high and self._copied[slot]:
                front.add_angles(4 * slot)
        self._open_copied()

    def _open_copied(self) -> None:
        """Where copied faces end others may begin."""
        front, coarse, level = self._front, self._coarse, self._coarse.level
        for slot in front.free_slots:
            for h in range(4 * slot, 4 * slot + 3):
                behind = level.twins[h]
                if behind != NONE and self._copied[behind >> 2]:
                    self._leave(behind, h)
        for slot, copied in enumerate(self._copied):
            for h in range(4 * slot, 4 * slot + 3):
                if self._several and copied and front.twins[h] == NONE and h not in front.gates:
                    p, q = level.corners[h], level.corners[after(h)]
                    ahead = coarse.edge(q, p) if coarse.crowded(q) else NONE
                    if ahead != NONE:
                        self._leave(h, ahead)

    def _leave(self, h: int, ahead: int) -> None:
        """A half-edge u -> v for which no gate waits: a gate of its own, if another face may stand there."""
        front = self._front
        u, v = front.corners[h], front.corners[after(h)]
        expected = front.split[u] or front.split[v]
        for k in self._coarse.edges(front.parents[v], front.parents[u], ahead):
            expected = expected or not self._copied[k >> 2]
        if expected:
            front.open(h, ahead)
            self._stack.append(h)
        else:
            front.twins[h] = NONE

    def _ahead(self, p: int, q: int) -> int:
        """The coarse half-edge p -> q whose face lies ahead."""
        return NONE if p == q else self._coarse.edge(p, q)

    # ---- new faces

    def _add_at_gate(self, gate: int, apex: int) -> None:
        front, coarse = self._front, self._coarse
        ahead = front.gates[gate]
        first, second = front.corners[after(gate)], front.corners[gate]
        p, q, r = front.parents[first], front.parents[second], front.parents[apex]
        image = NONE
        if p not in {q, r} and q != r:
            image = next((k for k in coarse.edges(p, q, ahead) if coarse.apex(k) == r), NONE)
        closing2, closing1 = front.find_gate(apex, second), front.find_gate(first, apex)
        h = front.add(first, second, apex)
        front.join(h, gate)
        if image != NONE:
            coarse.covered[image >> 2] = True
            ahead2 = coarse.edge(r, q) if coarse.crowded(r) else coarse.level.twins[after(image)]
            ahead1 = coarse.edge(p, r) if coarse.crowded(p) else coarse.level.twins[before(image)]
        elif r == q:
            ahead2, ahead1 = NONE, NONE if r == p else ahead
        elif r == p:
            ahead2, ahead1 = ahead, NONE
        else:
            ahead2, ahead1 = self._ahead(r, q), self._ahead(p, r)
        for side, closing, beyond in ((h + 1, closing2, ahead2), (h + 2, closing1, ahead1)):
            if closing != NONE:
                front.join(side, closing)
            else:
                self._leave(side, beyond)

    def _add_loose(self, a: int, b: int, c: int) -> None:
        """A face from elsewhere."""
        front, coarse = self._front, self._coarse
        corners = (a, b, c)
        if len(set(corners)) < 3:
            raise MapConnError("a face with two equal corners")
        p, q, r = above = [front.parents[corner] for corner in corners]
        h = front.add(a, b, c)
        if len(set(above)) == 3:
            for k in coarse.edges(p, q, coarse.edge(p, q)):
                if coarse.apex(k) == r:
                    coarse.covered[k >> 2] = True
        for i, j in ((0, 1), (1, 2), (2, 0)):
            gate = front.find_gate(corners[j], corners[i])
            if gate != NONE:
                front.join(h + i, gate)
            else:
                self._leave(h + i, self._ahead(above[j], above[i]))

    # ---- gates

    def _run_gates(self) -> None:
        """Visit gates until none is left: those on the stack, then those that wait, then those within one cell."""
        while not self._front.full:
            if self._stack:
                gate, late = self._stack.pop(), False
            elif self._later:
                gate, late = self._later.pop(0), True
            elif self._within:
                gate, late = self._within.pop(0), True
            else:
                return
            if gate in self._front.gates:
                self._visit(gate, late=late)

    def _visit(self, gate: int, *, late: bool) -> None:
        front, candidates, decisions = self._front, self._candidates, self._decisions
        first, second = front.corners[after(gate)], front.corners[gate]
        p, q = front.parents[first], front.parents[second]
        shared = p == q
        if shared and not late:
            self._within.append(gate)
            return
        refused = self._hole(gate)
        if refused is not None and decisions.bit(HOLE + refused[1]):
            self._add_at_gate(gate, refused[0])
            return
        for phase in range(2 if shared else 1):
            self._gather(gate, phase, NONE if refused is None else refused[0])
            if not len(candidates):
                continue
            best = candidates.ranked()[0]
            if self._high and not late and best.weight < DOUBT * candidates.total:
                self._later.append(gate)
                return
            last = not shared or phase == 1
            if (self._closed and last) or decisions.has_face(self._kind_of(gate, phase)):
                self._add_at_gate(gate, decisions.choose(learning=True).vertex)
                return
        if not self._clean and self._has_blocked_face(gate):
            self._add_at_gate(gate, self._any_apex(first, second))
            return
        front.borders[first] = front.borders[second] = 1
        front.close(gate)

    def _has_blocked_face(self, gate: int) -> int:
        """Whether a gate has a face all the same: with a vertex all of whose edges have their faces."""
        front, candidates = self._front, self._candidates
        first, second = front.corners[after(gate)], front.corners[gate]
        self._gather_all(gate, first, second)
        for made in candidates.present():
            if not candidates.is_blocked(made.vertex):
                candidates.drop(made)
        if len(candidates):
            return self._decisions.has_face(self._kind_of(gate, 2))
        shared = front.parents[first] == front.parents[second]
        return self._decisions.bit(ESCAPE + 2 * shared + (front.gates[gate] != NONE))

    def _hole(self, gate: int) -> tuple[int, int] | None:
        """The vertex that closes both edges of the gate, and the context of whether it does."""
        front, coarse = self._front, self._coarse
        first, second = front.corners[after(gate)], front.corners[gate]
        out, into = front.newest_from(first), front.newest_to(second)
        if NONE in {out, into}:
            return None
        x = front.corners[after(out)]
        if x != front.corners[into] or x == front.corners[before(gate)]:
            return None
        p, q, r = front.parents[first], front.parents[second], front.parents[x]
        ahead = front.gates[gate]
        if p == q:
            return x, 2 + (r == p)
        if r in {p, q}:
            return x, 1
        if ahead != NONE and coarse.apex(ahead) == r:
            return x, 4 + coarse.is_covered(ahead)
        return x, 0

    def _kind_of(self, gate: int, phase: int) -> GateKind:
        """phase: 0 and, within a cell, 1; 2 with the candidates that are blocked."""
        front = self._front
        first, second = front.corners[after(gate)], front.corners[gate]
        shared = front.parents[first] == front.parents[second]
        ahead = front.gates[gate]
        family = phase if shared else 2 if ahead == NONE else 3 + self._coarse.is_covered(ahead)
        if phase == 2:
            family = 5 + shared
        borders = front.borders[first] + front.borders[second]
        return GateKind(family, borders, front.split[first] or front.split[second])

    def _aim(self, half_edge: int, first: int, second: int, refused: int = NONE) -> tuple[int, int]:
        """Look at a gate; the parents of its ends."""
        p, q = self._front.parents[first], self._front.parents[second]
        lacks = Lacks(self._coarse.lack(p), self._coarse.lack(q), p == q) if self._high else None
        self._candidates.aim(half_edge, first, second, lacks, refused)
        return p, q

    def _gather(self, gate: int, phase: int, refused: int) -> None:
        """The candidates of a gate."""
        front, coarse = self._front, self._coarse
        first, second = front.corners[after(gate)], front.corners[gate]
        p, q = self._aim(gate, first, second, refused)
        if p != q:
            for k in coarse.edges(p, q, front.gates[gate]):
                self._add_children(coarse.apex(k), COVERED if coarse.is_covered(k) else AHEAD)
            self._add_children(p, SIBLING, first)
            self._add_children(q, SIBLING, second)
        elif phase == 0:
            self._add_children(p, WITHIN, first)
        else:
            for r in coarse.neighbours(p):
                self._add_children(r, AROUND)
        self._candidates.weigh()

    def _gather_all(self, half_edge: int, first: int, second: int) -> None:
        """All vertices near a half-edge's face, in whatever state."""
        coarse = self._coarse
        p, q = self._aim(half_edge, first, second)
        if p != q:
            for a, b in ((p, q), (q, p)):
                for k in coarse.edges(a, b, coarse.edge(a, b)):
                    self._add_children(coarse.apex(k), COVERED if coarse.is_covered(k) else AHEAD, everyone=True)
            self._add_children(p, SIBLING, first, everyone=True)
            self._add_children(q, SIBLING, second, everyone=True)
        else:
            self._add_children(p, WITHIN, first, everyone=True)
            for r in coarse.neighbours(p):
                self._add_children(r, AROUND, everyone=True)
        self._candidates.weigh()

    def _add_children(self, p: int, kind: int, near: int = NONE, *, everyone: bool = False) -> None:
        """The children of a coarse vertex; of a large family only those near a vertex."""
        family = self._coarse.children(p)
        first, end = family.start, family.stop
        if near != NONE and len(family) == 1:
            return
        if near != NONE and len(family) > LARGEST_FAMILY:
            first, end = max(first, near - NEAR), min(end, near + NEAR)
        lack = self._coarse.lack(p) if self._high else 0
        self._candidates.add(first, end - first, kind, lack, everyone=everyone)

    # ---- what is rare

    def _any_apex(self, first: int, second: int) -> int:
        """An apex among all vertices."""
        if len(self._candidates) and self._decisions.bit(ESCAPE + 8):
            return self._decisions.choose(learning=False).vertex
        return self._vertex(APEX, first, second)

    def _vertex(self, which: int, origin: int, other: int) -> int:
        """A vertex by its number's distance, which is neither of these."""
        found = origin + self._decisions.number(which)
        if not 0 <= found < len(self._fine) or found in {origin, other}:
            raise MapConnError("a corner that is none")
        return found

    def _extra_face(self, edge: int) -> tuple[int, bool]:
        """Another face at a half-edge that has its twin, or is border; where the pass stands, and whether one came."""
        front, coarse = self._front, self._coarse
        for h in range(edge, 4 * front.slot_count):
            if h & 3 == 3 or not front.is_face(h >> 2) or front.twins[h] > h:
                continue
            a, b = front.corners[h], front.corners[after(h)]
            p, q = front.parents[a], front.parents[b]
            shared, split = p == q, coarse.split(p) or coarse.split(q)
            faces = uncovered = 0
            if shared:
                faces = max(len(coarse.children(p)) - 2, 0)
            elif coarse.crowded(p) or coarse.crowded(q):
                for k in coarse.edges(p, q, coarse.edge(p, q)) + coarse.edges(q, p, coarse.edge(q, p)):
                    faces += 1
                    uncovered += not coarse.is_covered(k)
                    split = split or coarse.split(coarse.apex(k))
            if not split or not faces:
                continue
            border = front.twins[h] == NONE
            place = (shared * 6 + min(faces, 5)) * 3 + min(uncovered, 2)
            place = (place * 3 + front.borders[a] + front.borders[b]) * 4
            place += 2 * border + (not (coarse.split(p) and coarse.split(q)))
            if not self._decisions.bit(EXTRA + place):
                continue
            first, second = (b, a) if self._decisions.bit(ESCAPE + 16 + border) else (a, b)
            self._gather_all(h, first, second)
            self._add_loose(first, second, self._any_apex(first, second))
            return h, True
        return 4 * front.slot_count, False

    def _seed(self, seed: int) -> None:
        """The face above a coarse face that is not covered: three corners, the nearest first."""
        coarse, decisions = self._coarse, self._decisions
        coarse.covered[seed] = True
        if not self._clean and not decisions.bit(SEED):
            return
        corners: list[int] = []
        for above in coarse.level.corners[4 * seed : 4 * seed + 3]:
            family = coarse.children(above)
            if len(family) > LARGEST_LIST:
                place = decisions.raw_number((len(family) - 1).bit_length())
                if place >= len(family):
                    raise MapConnError("a corner that is none")
                corners.append(family[place])
            else:
                corners.append(self._nearest(family, corners))
        self._add_loose(*corners)

    def _nearest(self, family: range, corners: list[int]) -> int:
        """One of a family, those near the corners so far first."""
        distances = {v: self._distance(v, corners) for v in family}
        for turn in range(len(family) - 1):
            best = min(family, key=distances.__getitem__)
            if self._decisions.bit(SEED + 8 + 8 * len(corners) + min(turn, 7)):
                return best
            distances[best] = FAR
        return min(family, key=distances.__getitem__)

    def _distance(self, v: int, corners: list[int]) -> Single:
        positions = self._front.positions
        distance = Single(0)
        for corner in corners:
            if positions:
                way = positions[v] - positions[corner]
                distance += dot(way, way)
            else:
                distance += Single(abs(v - corner))
        return distance * Single(2) + Single(1) if self._front.degrees[v] else distance

    def _leftover(self) -> None:
        """A face by its corners' numbers."""
        first = self._last_leftover + self._decisions.number(FIRST)
        if not 0 <= first < len(self._fine):
            raise MapConnError("a corner that is none")
        self._last_leftover = first
        second = self._vertex(SECOND, first, NONE)
        third = self._vertex(THIRD, first, second)
        self._add_loose(first, second, third)
