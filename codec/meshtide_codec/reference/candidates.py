"""Candidates for the apex of a new face, and what each of them is worth (docs/format.md, section 6).

An encoder asks the same questions, and answers them for the face that it wants at the gate.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.reference.coding import EVEN, SIGNED_CONTEXTS, Shape, clamp
from meshtide_codec.reference.levels import NONE, Single, Vector, after, arc, before, cross, dot, vector

if TYPE_CHECKING:
    from meshtide_codec.reference.coding import Layer, RangeDecoder
    from meshtide_codec.reference.levels import Front

AHEAD, COVERED, SIBLING, WITHIN, AROUND = range(5)  # kinds
CORNERS = 8 * 5
SEEN_LIMIT = 96
FAN_LIMIT = 8
SPHERE_LIMIT = 32
SCORE_RANGE = 5000
LEARNING_STEP = 0x9E3779B9
ZERO, TINY = Single(0), Single(1e-20)
DOUBT = Single(0.6)

# Where each table of scores begins. Without positions SHAPE has one place for a corner.
SHAPE = 0
LENGTHS = SHAPE + 256 * CORNERS
ENDS = LENGTHS + 1024
VALENCE = ENDS + 4 * 128
APART = VALENCE + 16 * CORNERS
DEFAULT_SCORES = APART + 16 * CORNERS
RATIOS = DEFAULT_SCORES
TURN_APEX = RATIOS + 1024
TURN_END = TURN_APEX + 8 * 8 * 32
FOLD_END = TURN_END + 2 * 8 * 32
LACK_END = FOLD_END + 2 * 16
LACK_APEX = LACK_END + 64
STEP = LACK_APEX + 128
INSIDE = STEP + 16 * 16 * 2
HIGH_SCORES = INSIDE + 8 * 16 * 4
PLAIN_ENDS = SHAPE + CORNERS
PLAIN_VALENCE = PLAIN_ENDS + 4 * 128
PLAIN_SCORES = PLAIN_VALENCE + 16 * CORNERS


@dataclass(eq=False)
class Candidate:
    """A vertex that may be the apex.

    Attributes:
        corner: 8 kind + [it has faces] + 2 [it closes the edge at `first`] + 4 [at `second`].
        places: of its scores.
        way, centre: from `first` to it, and to the centre of the sphere through the three (effort high).
    """

    vertex: int
    corner: int
    places: list[int] = field(default_factory=list)
    score: int = 0
    weight: Single = ZERO
    way: Vector = field(default_factory=lambda: vector(0, 0, 0))
    centre: Vector = field(default_factory=lambda: vector(0, 0, 0))


@dataclass
class Lacks:
    """Of coarse vertices: 8 (children, up to 3, less one) + faces around that are not covered, up to 7."""

    first: int
    second: int
    shared: bool


class Candidates:
    """The candidates at one gate: lanes, in which None stands for those that are out.

    Args:
        front: the mesh so far.
        scores: trained, and what has been learned since.
        positions: whether vertices have positions.
        high: effort high, with positions.
    """

    def __init__(self, front: Front, scores: list[int], *, positions: bool, high: bool) -> None:
        self._front = front
        self._scores = scores
        self._positions = positions
        self._high = high
        self._learned = 0

    def aim(self, half_edge: int, first: int, second: int, lacks: Lacks | None, refused: int) -> None:
        """Look at the gate `half_edge`, second -> first; the new face begins with first, second; `refused` is none."""
        front = self._front
        self.lanes: list[Candidate | None] = []
        self._seen = 0
        self._refused = refused
        self.total = Single(0)
        self.first, self.second, self.known = first, second, front.corners[before(half_edge)]
        self.blocked = self._blocked_fans(half_edge)
        self._lacks = lacks
        self._out, self._in = front.newest_from(first), front.newest_to(second)
        u, v = min(front.degrees[first], 7), min(front.degrees[second], 7)
        alike = 16 * min(u, v) + abs(u - v)
        self._ends = [
            alike,
            128 + 16 * u + v,
            256 + 16 * v + u,
            384 + alike,
        ]  # by what closes: none, first, second, both
        if self._positions:
            p, q, r = front.positions[first], front.positions[second], front.positions[self.known]
            self._side = q - p
            normal = cross(p - q, r - q)
            self._across = cross(normal, self._side)
            self._far = p + q - r
            self._length = dot(self._side, self._side)
            self._scale = Single(1) / self._length if self._length > 0 else Single(0)
            self._normal_length = dot(normal, normal)
            self._folds = [self._fold(self._out), self._fold(self._in)]

    def _blocked_fans(self, half_edge: int) -> list[int]:
        """The vertices around the gate's ends, on from the face behind, to which no gate leads; and its apex."""
        front = self._front
        blocked = [self.known]
        h = after(half_edge)  # leaves `first`
        while len(blocked) < FAN_LIMIT and h not in front.gates:
            blocked.append(front.corners[after(h)])
            if front.twins[h] == NONE:
                break
            h = after(front.twins[h])
        limit = len(blocked) + FAN_LIMIT
        h = before(half_edge)  # reaches `second`
        while len(blocked) < limit and h not in front.gates:
            blocked.append(front.corners[h])
            if front.twins[h] == NONE:
                break
            h = before(front.twins[h])
        return blocked

    def _fold(self, gate: int) -> Vector:
        """The normal of the face behind a gate that a candidate would close."""
        if gate == NONE:
            return vector(0, 0, 0)
        positions, corners = self._front.positions, self._front.corners
        a, b, c = (positions[corners[h]] for h in (gate, after(gate), before(gate)))
        return cross(b - a, c - a)

    def is_blocked(self, vertex: int) -> bool:
        """Whether a face at this gate can have the vertex only where edges have several faces."""
        front = self._front
        return (front.degrees[vertex] > 0 and front.newest_from(vertex) == NONE) or vertex in self.blocked

    def add(self, base: int, size: int, kind: int, family_lack: int, *, everyone: bool) -> None:
        """Vertices base, base + 1, ...; everyone: also those whose edges are all taken."""
        size = min(size, SEEN_LIMIT - self._seen)
        self._seen += size
        for vertex in range(base, base + size):
            out = vertex in {self.first, self.second}
            if not (out or (not everyone and (vertex == self._refused or self.is_blocked(vertex)))):
                self.lanes.append(self._candidate(vertex, kind, family_lack))

    def _candidate(self, vertex: int, kind: int, family_lack: int) -> Candidate:
        front = self._front
        touched = front.degrees[vertex] > 0
        closes1 = touched and self._out != NONE and front.corners[after(self._out)] == vertex
        closes2 = touched and self._in != NONE and front.corners[self._in] == vertex
        corner = 8 * kind + touched + 2 * closes1 + 4 * closes2
        made = Candidate(vertex, corner)
        valence = 16 * corner + min(front.degrees[vertex], 15)
        ends = self._ends[closes1 + 2 * closes2]
        if self._positions:
            made.places = [ENDS + ends, VALENCE + valence]
            self._measure(made, kind, family_lack)
        else:
            made.places = [PLAIN_ENDS + ends, PLAIN_VALENCE + valence, SHAPE + corner]
        made.score = sum(self._scores[place] for place in made.places) >> 2
        return made

    def _measure(self, made: Candidate, kind: int, family_lack: int) -> None:
        """The places that positions choose."""
        front = self._front
        x = front.positions[made.vertex]
        d, e = x - front.positions[self.first], x - front.positions[self.second]
        length = self._length
        ii, jj = dot(d, d), dot(e, e)
        t = ii + (length - jj)
        nn = _greater(length * ii - t * t * Single(0.25), Single(0))
        cosine = (ii + jj - length) * Single(0.5) / np.sqrt(ii * jj + TINY)
        angle = _sixteenth(cosine * Single(8))
        bend = _sixteenth(dot(d, self._across) * Single(8) / np.sqrt(nn * self._normal_length + TINY))
        g = x - self._far
        apart = _octave(dot(g, g) * self._scale, 0.03125)
        longer, shorter = _greater(ii, jj), _lesser(ii, jj)
        made.places += [
            SHAPE + 256 * made.corner + 16 * bend + angle,
            LENGTHS + 64 * _octave(longer, 0.25) + 4 * _octave(shorter, 0.25) + min(kind, 3),
            APART + 16 * made.corner + apart,
        ]
        if self._lacks is None:
            return
        flags = made.corner & 7
        closing = flags >> 1
        closes1, closes2 = closing & 1, closing >> 1
        at1 = arc((length + ii - jj) * Single(0.5) / np.sqrt(length * ii + TINY))
        at2 = arc((length + jj - ii) * Single(0.5) / np.sqrt(length * jj + TINY))
        degrees, angles = front.degrees, front.angles
        normal = cross(self._side, d)
        folded = [
            _sixteenth(dot(normal, fold) * Single(8) / np.sqrt(nn * dot(fold, fold) + TINY)) for fold in self._folds
        ]
        own = kind == AHEAD
        lacks = self._lacks
        made.places += [
            RATIOS + 64 * _octave(longer * self._scale, 0.125) + 4 * _octave(shorter * self._scale, 0.03125) + closing,
            TURN_APEX + 32 * (8 * flags + min(degrees[made.vertex], 7)) + _turn(angles[made.vertex] + arc(cosine)),
            TURN_END + 32 * (8 * closes1 + min(degrees[self.first], 7)) + _turn(angles[self.first] + at1),
            TURN_END + 32 * (8 * closes2 + min(degrees[self.second], 7)) + _turn(angles[self.second] + at2),
            FOLD_END + (16 + folded[0] if closes1 else 0),
            FOLD_END + (16 + folded[1] if closes2 else 0),
            LACK_END + 2 * _lack(lacks.first, closes1, own) + lacks.shared,
            LACK_END + 2 * _lack(lacks.second, closes2, own) + lacks.shared,
            LACK_APEX + 4 * _lack(family_lack, closes1 & closes2, own) + closing,
            STEP + 32 * bend + 2 * apart + (closes1 | closes2),
        ]
        ed = t * Single(0.5)
        safe = _greater(Single(2) * (length * ii - ed * ed), Single(1e-6))
        made.way = d
        made.centre = ii * (length - ed) / safe * self._side + length * (ii - ed) / safe * d

    def _look_inside(self) -> None:
        """How far others are inside the spheres, which is known when all are there."""
        near = [other for other in self.lanes[:SPHERE_LIMIT] if other is not None]
        for made in self.present():
            centre = made.centre
            radius = dot(centre, centre)
            ways = []
            for other in near:
                if other is not made:
                    way = other.way - centre
                    ways.append(dot(way, way))
            inside = sum(bool(way < radius * Single(0.96875)) for way in ways)
            ratio = min([Single(4) * radius, *ways]) / radius * Single(8)
            margin = int(_lesser(ratio, Single(15))) if radius > 0 and ratio >= 0 else 0
            place = INSIDE + 4 * (16 * (made.corner & 7) + margin) + min(inside, 3)
            made.places.append(place)
            made.score += self._scores[place] >> 2

    def weigh(self) -> None:
        """Weights, once all candidates are there: two to the power of the scores."""
        if self._high:
            self._look_inside()
        if self.lanes:
            lowest = max(made.score for made in self.present()) - SCORE_RANGE
            for made in self.present():
                made.score = max(made.score, lowest)
                made.weight = power(made.score - lowest)
        self._add_up()

    def _add_up(self) -> None:
        """The total of the weights: four sums, of every fourth lane."""
        totals = [Single(0)] * 4
        for lane, made in enumerate(self.lanes):
            if made is not None:
                totals[lane % 4] += made.weight
        self.total = (totals[0] + totals[1]) + (totals[2] + totals[3])

    def present(self) -> list[Candidate]:
        """Those that are not out."""
        return [made for made in self.lanes if made is not None]

    def __len__(self) -> int:
        return len(self.present())

    def ranked(self) -> list[Candidate]:
        """By falling score, the first lane first."""
        return sorted(self.present(), key=lambda made: -made.score)

    def drop(self, out: Candidate) -> None:
        """Take one out."""
        self.lanes[self.lanes.index(out)] = None
        self._add_up()

    def find(self, vertex: int) -> Candidate | None:
        """A vertex among them, that with the least corner if it is there several times."""
        found = [made for made in self.present() if made.vertex == vertex]
        return min(found, key=lambda made: made.corner, default=None)

    def learn(self, offered: list[Candidate], chosen: Candidate, total: Single) -> None:
        """One step of the scores after a choice among those that were offered."""
        pace = Single(20 if self._high else 50)
        self._learned = (self._learned + LEARNING_STEP) % 2**32
        dither = Single(self._learned >> 8) * Single(2.0**-24) + Single(1024)
        for made in offered:
            share = Single(made is chosen) - made.weight / total
            step = int(share * pace + dither) - 1024
            for place in made.places:
                self._scores[place] = clamp(self._scores[place] + step, -32000, 32000)


def power(score: int) -> Single:
    """Two to the power of a score in 256ths, linear between powers: the bits of a float are nearly its logarithm."""
    return Single(struct.unpack("<f", struct.pack("<i", (score << 15) + (127 << 23)))[0])


def logarithm(x: Single) -> int:
    """The other way round."""
    return (int(x.view(np.int32)) - (127 << 23)) >> 15


def _lesser(a: Single, b: Single) -> Single:
    return min(b, a)


def _greater(a: Single, b: Single) -> Single:
    return max(b, a)


def _octave(x: Single, first: float) -> int:
    """0..15 by halves of octaves, from `first` on."""
    x = _lesser(_greater(x * Single(0.25 / first), Single(0.25)), Single(63))
    return (int(x.view(np.int32)) >> 22) - 250


def _sixteenth(cosine: Single) -> int:
    return int(_lesser(_greater(cosine + Single(8), Single(0)), Single(15)))


def _turn(angle: Single) -> int:
    """Sums of angles, 12 to half a turn."""
    return int(_lesser(angle * Single(12), Single(31)))


def _lack(coded: int, closed: int, own: bool) -> int:
    left = max(coded % 8 - own, 0)
    return 15 * closed + coded // 8 * 5 + min(left, 4)


# ---- Decisions

TURNS, ODDS = 4, 32
PICK_BY_ODDS = 0
PICK_BY_LEFT = PICK_BY_ODDS + TURNS * ODDS * CORNERS
PICK_BY_RIVAL = PICK_BY_LEFT + 2 * 4 * ODDS * 16
PICK_BY_SHAPE = PICK_BY_RIVAL + 8 * CORNERS * CORNERS
GATE = PICK_BY_SHAPE + 2 * 256 * CORNERS
GATE_BY_SCORE = GATE + 504
GATE_BY_CORNER = GATE_BY_SCORE + ODDS * 21
GATE_BY_ODDS = GATE_BY_CORNER + 12 * CORNERS
HOLE = GATE_BY_ODDS + ODDS * 21
ESCAPE = HOLE + 16
EXTRA = ESCAPE + 64
SEED = EXTRA + 512
NUMBERS = SEED + 64
CONTEXTS = NUMBERS + 6 * SIGNED_CONTEXTS
APEX, FIRST, SECOND, THIRD, COUNT = range(5)  # numbers

PICK_TURN = 0
PICK_CORNER = PICK_TURN + 16
PICK_ODDS = PICK_CORNER + CORNERS
GATE_FAMILY = PICK_ODDS + ODDS
GATE_CORNER = GATE_FAMILY + 64
GATE_ODDS = GATE_CORNER + CORNERS
PICK_MARGIN = GATE_ODDS + ODDS
GATE_SCORE = PICK_MARGIN + 32
NEURONS = GATE_SCORE + 32
FINAL_NEURONS = 16
SETTLED = 65536 // 14


def _shape(contexts: int, scores: int, groups: int, rate: int, finer: int) -> Shape:
    return Shape(
        contexts=contexts,
        neurons=NEURONS,
        final_neurons=FINAL_NEURONS,
        groups=groups,
        rate=rate,
        settled=SETTLED,
        shift=9 - finer,
        final_shift=9 - finer,
        scores=scores,
        score_shift=8 - finer,
    )


DEFAULT_SHAPE = _shape(CONTEXTS, DEFAULT_SCORES, groups=1, rate=4, finer=0)
HIGH_SHAPE = _shape(CONTEXTS + 9 * HIGH_SCORES, HIGH_SCORES, groups=5, rate=5, finer=2)
PLAIN_SHAPE = _shape(CONTEXTS, PLAIN_SCORES, groups=1, rate=4, finer=0)


@dataclass(frozen=True)
class GateKind:
    """What is known of a gate before its candidates are.

    Attributes:
        family: 0 within a cell, 1 the same, by cells around; 2 no coarse face ahead, 3 one that is not covered, 4 one
            that is; 5 those that are blocked, 6 the same within a cell.
        borders: of its ends.
        split: whether one of its ends has siblings.
    """

    family: int
    borders: int
    split: bool


class Decisions:
    """The mixed decisions at a gate, and plain ones."""

    def __init__(
        self, decoder: RangeDecoder, layer: Layer, candidates: Candidates, *, positions: bool, high: bool
    ) -> None:
        self._decoder = decoder
        self._mixer = layer.mixer
        self._candidates = candidates
        self._positions = positions
        self._high = high

    def bit(self, place: int) -> int:
        """A decision by one context."""
        return self._mixer.contexts.bit(self._decoder, place)

    def number(self, which: int) -> int:
        """A signed integer; each kind has its own contexts."""
        return self._mixer.contexts.signed(self._decoder, NUMBERS + which * SIGNED_CONTEXTS)

    def flag(self) -> bool:
        """A decision at even chances."""
        return self._decoder.bit(EVEN) == 1

    def raw_number(self, bits: int) -> int:
        """Bits at even chances."""
        return self._decoder.raw_bits(bits)

    def has_face(self, gate: GateKind) -> int:
        """Has the gate a face, with one of the candidates?"""
        best = self._candidates.ranked()[0]
        family, borders = gate.family, gate.borders
        closes = best.corner >> 1 & 3
        z = min(closes, 1) + (closes == 3)
        count = min(len(self._candidates) - 1, 3)
        score = clamp((best.score >> 7) + 16, 0, 31)
        odds = self._odds(best)
        odds_class = clamp((odds >> 7) + 10, 0, 31)
        places = [
            GATE + (((family * 3 + borders) * 3 + z) * 4 + count) * 2 + gate.split,
            GATE_BY_SCORE + (score * 7 + family) * 3 + borders,
            GATE_BY_CORNER + (best.corner * 3 + borders) * 4 + count,
            GATE_BY_ODDS + (odds_class * 7 + family) * 3 + borders,
        ]
        neurons = [GATE_FAMILY + (family * 3 + borders) * 3 + z, GATE_CORNER + best.corner, GATE_ODDS + odds_class]
        if self._high:
            places += [CONTEXTS + 8 * HIGH_SCORES + place for place in best.places]
            neurons.append(GATE_SCORE + score)
        return self._decide(places, [256, _scaled(odds), _scaled(best.score)], neurons, 8 + family)

    def choose(self, *, learning: bool) -> Candidate:
        """Which candidate it is."""
        offered, total = self._candidates.present(), self._candidates.total
        turn = 0
        while True:
            best, *others = self._candidates.ranked()
            if not others or self._is_it(best, others[0], turn):
                break
            self._candidates.drop(best)
            turn += 1
        certain = Single(7.9 if self._high else 7)
        if learning and len(offered) > 1 and best.weight * Single(8) < total * certain:
            self._candidates.learn(offered, best, total)
        return best

    def _is_it(self, best: Candidate, rival: Candidate, turn: int) -> int:
        odds = self._odds(best)
        odds_class = clamp((odds >> 7) + 10, 0, 31)
        turn, again = min(turn, 3), int(turn > 0)
        left = min(len(self._candidates) - 2, 3)
        margin = best.score - rival.score
        close = clamp(margin >> 7, 0, 15)
        shape = best.places[2]
        places = [
            PICK_BY_ODDS + (turn * ODDS + odds_class) * CORNERS + best.corner,
            PICK_BY_LEFT + ((again * 4 + left) * ODDS + odds_class) * 16 + close,
            PICK_BY_RIVAL + ((again * 4 + min(close >> 1, 3)) * CORNERS + best.corner) * CORNERS + rival.corner,
            PICK_BY_SHAPE + again * 256 * CORNERS + shape,
        ]
        neurons = [PICK_TURN + 4 * turn + left, PICK_CORNER + best.corner, PICK_ODDS + odds_class]
        if self._high:
            places += [CONTEXTS + 8 * place + 4 * again + (odds_class >> 3) for place in best.places]
            neurons.append(PICK_MARGIN + 16 * again + close)
        return self._decide(places, [256, _scaled(odds), _scaled(margin)], neurons, turn)

    def _decide(self, places: list[int], numbers: list[int], neurons: list[int], final_neuron: int) -> int:
        opposed = [False] * len(places)
        return self._mixer.bit(self._decoder, places, opposed, [*numbers, 0, 0, 0, 0, 0], neurons, final_neuron)

    def _odds(self, made: Candidate) -> int:
        """Of a candidate against all the others, in 256ths of a doubling."""
        others = max(self._candidates.total - made.weight, made.weight * Single(0.0001))
        return logarithm(made.weight) - logarithm(others)


def _scaled(value: int) -> int:
    """From 256ths of a doubling to the mixer's natural logarithms."""
    return clamp(value * 177 >> 8, -2047, 2047)
