"""Guesses of a vertex' position from few other vertices each: experts (docs/format.md, section 8.5)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec.reference.octree import NOBODY

if TYPE_CHECKING:
    from collections.abc import Iterator

    from meshtide_codec.reference.diff_rows import Neighbourhood, Row

SLACK = 0.3
DRIFT = 0.025
LARGEST_TRUST = 7
LARGEST_PAIRED = 10  # members of a ring that are paired
Guess = tuple[list[float], float]
"""An offset from the vertex, and how many of the vertices that it is made of are not known yet."""


@dataclass
class Expert:
    """The mean of guesses of one kind, and the class of the best one's distance from agreeing; 0: no guesses."""

    offset: list[float]
    trust: int


def ring_expert(around: Neighbourhood) -> Expert:
    """Parallelograms of three consecutive members of the ring."""
    return _mean(_ring_guesses(around))


def midpoint_expert(around: Neighbourhood) -> Expert:
    """Midpoints of opposite members of the ring."""
    return _mean(_midpoint_guesses(around))


def across_expert(around: Neighbourhood, rows: list[Row]) -> Expert:
    """Parallelograms over the edges of the ring."""
    return _mean(_across_guesses(around, rows))


def pairs_expert(around: Neighbourhood) -> Expert:
    """Midpoints of any two of the ring's first members."""
    return _mean(_pair_guesses(around))


def _ring_guesses(around: Neighbourhood) -> Iterator[Guess]:
    count, closed, offsets, unknown = around.askable, around.ring.closed, around.offsets, around.unknown
    for place in range(0 if closed else 1, count if closed else count - 1):
        before = place - 1 if place > 0 else count - 1
        after = place + 1 if place + 1 < count else 0
        offset = [offsets[before][axis] + offsets[after][axis] - offsets[place][axis] for axis in range(3)]
        yield offset, unknown[before] + unknown[after] + unknown[place]


def _midpoint_guesses(around: Neighbourhood) -> Iterator[Guess]:
    count, closed, offsets, unknown = around.askable, around.ring.closed, around.offsets, around.unknown
    half = count // 2
    for place in range(count if closed and count % 2 else half):
        other = (place + half) % count if closed else count - 1 - place
        offset = [0.5 * (offsets[place][axis] + offsets[other][axis]) for axis in range(3)]
        yield offset, unknown[place] + unknown[other]


def _across_guesses(around: Neighbourhood, rows: list[Row]) -> Iterator[Guess]:
    count, offsets, unknown = around.askable, around.offsets, around.unknown
    for place in range(count):
        opposite = around.ring.across[place]
        if opposite == NOBODY:
            continue
        after = place + 1 if place + 1 < count else 0
        far = rows[opposite]
        offset = [
            offsets[place][axis] + offsets[after][axis] - (far.position[axis] - around.own.position[axis])
            for axis in range(3)
        ]
        yield offset, unknown[place] + unknown[after] + 1.0 - far.known


def _pair_guesses(around: Neighbourhood) -> Iterator[Guess]:
    offsets, unknown = around.offsets[:LARGEST_PAIRED], around.unknown
    for place, other in itertools.combinations(range(len(offsets)), 2):
        offset = [0.5 * (offsets[place][axis] + offsets[other][axis]) for axis in range(3)]
        yield offset, unknown[place] + unknown[other]


def _mean(guesses: Iterator[Guess]) -> Expert:
    """Guesses weighted by how little they disagree with the known cell."""
    sums = [0.0, 0.0, 0.0]
    total = 0.0
    best = 1e9
    for offset, unknown in guesses:
        distance = _distance_from_agreeing(offset)
        slack = SLACK + distance
        weight = 1.0 / (slack * slack * (1.0 + 2.0 * unknown))
        for axis in range(3):
            sums[axis] += weight * offset[axis]
        total += weight
        best = min(best, distance)
    if not total > 0.0:
        return Expert([0.0, 0.0, 0.0], 0)
    scale = 1.0 / total
    return Expert([component * scale for component in sums], _trust_class(best))


def _distance_from_agreeing(offset: list[float]) -> float:
    """Squared distance from the known cell, two half cells around the middle, and a little of the distance from it."""
    far = [abs(component) for component in offset]
    over = [max(component - 2.0, 0.0) for component in far]
    outside = over[0] * over[0] + over[1] * over[1] + over[2] * over[2]
    return 0.25 * outside + DRIFT * (far[0] + far[1] + far[2])


def _trust_class(distance: float) -> int:
    """1 + floor(2 log2(1 + 4 distance)), at most 7."""
    grown = 1.0 + 4.0 * distance
    grown *= grown
    trust = 1
    while grown >= 2.0 and trust < LARGEST_TRUST:  # halved until nothing is left to halve
        grown *= 0.5
        trust += 1
    return trust
