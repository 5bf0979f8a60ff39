"""How likely each candidate is: sums of trained integer scores, one for each property of the triangle it would make.

A score counts LOGISTIC_UNIT per nat: two candidates whose scores differ by d are expected with odds exp(d / 256) : 1.
Scores are turned into weights exp(score - best score); a candidate's weight over the sum of all weights is how
confident the table is in it. With positions, angles and lengths count as well as what the connectivity alone says.
Cost: O(candidates).
"""

from __future__ import annotations

from decimal import Context
from itertools import pairwise
from math import isqrt
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import inlined_kernel
from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity.borrowing import borrowing_kernel
from meshtide_codec.connectivity.candidate_kernels import KINDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.candidate_kernels import Candidates
    from meshtide_codec.connectivity.half_edge_kernels import FineMesh

# Sections of a score table: where each property's scores start, and how properties are cut into classes.
CLOSINGS = 4  # edges closed: none, one, two, or blocked
STATES = 3  # vertex without faces, complete vertex, vertex with open edges
KIND_SCORES = 0
VALENCE_SCORES = KIND_SCORES + KINDS * CLOSINGS * STATES
END_SCORES = VALENCE_SCORES + 8 * 4 * CLOSINGS
SHAPE_SCORES = END_SCORES + 16 * 16
SHORT_EDGE_SCORES = SHAPE_SCORES + KINDS * 16 * 32
ANGLE_SUM_SCORES = SHORT_EDGE_SCORES + 16 * 16 * 16
SCORES = ANGLE_SUM_SCORES + CLOSINGS * STATES * 32

LOGISTIC_UNIT = 256
FULL_WEIGHT = 4096  # weight of the best candidate
SCORE_STEP = 4  # scores are compared in steps of this size


def _weights() -> NDArray[np.int64]:
    """FULL_WEIGHT * exp(-i * SCORE_STEP / LOGISTIC_UNIT), rounded; by `decimal`, so the same on every machine."""
    context = Context(prec=20)
    steps = LOGISTIC_UNIT // SCORE_STEP
    exact = [context.multiply(FULL_WEIGHT, context.exp(context.divide(-i, steps))) for i in range(1024)]
    return np.array([int(weight.to_integral_value()) for weight in exact], np.int64)


WEIGHTS = _weights()

ANGLE_STEPS = 1024  # the signed squared cosine from -1 to 1 in this many steps
LENGTH_RATIOS = 4096  # squared length ratios up to 256, in sixteenths


def _angle_classes() -> NDArray[np.int64]:
    """Class of an angle, 0 to 31 for 0 to 180 degrees (0 for a cosine of 1), from its signed squared cosine.

    The classes' bounds are cosines, found by halving angles with integers scaled by 2^30, so no machine differs.
    """
    scale = 1 << 30
    cosines = [0, scale]  # of 90 and 0 degrees
    for _ in range(4):
        finer = []
        for low, high in pairwise(cosines):
            finer += [low, _half_way(low, high, scale)]
        cosines = [*finer, cosines[-1]]
    bounds = [c * c // scale for c in cosines[::-1]]  # 17 squared cosines, 0 to 90 degrees
    signed = bounds + [-b for b in bounds[-2::-1]]  # 33, falling from 1 to -1
    steps = (np.arange(ANGLE_STEPS + 1) * 2 - ANGLE_STEPS) * scale // ANGLE_STEPS
    falling = np.array(signed[1:-1], np.int64)
    return np.array([int(np.count_nonzero(falling > step)) for step in steps], np.int64)


def _half_way(low: int, high: int, scale: int) -> int:
    """Cosine of the mean of two angles in [0, 90] degrees, given their cosines; all are scaled."""
    sine_low = isqrt(scale * scale - low * low)
    sine_high = isqrt(scale * scale - high * high)
    cosine_of_difference = (low * high + sine_low * sine_high) // scale
    half_difference = isqrt((scale + cosine_of_difference) * scale // 2)
    return (low + high) * scale // (2 * half_difference)


ANGLE_CLASSES = _angle_classes()
LENGTH_CLASSES = np.array(
    [min(15, max(0, (max(i, 1) ** 2).bit_length() - 3)) for i in range(LENGTH_RATIOS + 1)], np.int64
)
"""Two classes for each doubling of a squared length; equal lengths are at the lower end of class 6."""


@inlined_kernel
def squared_distance(vertices: NDArray[np.int32], one: int, other: int) -> int:
    """Squared distance of two vertices, in squared units of the grid."""
    x = int(vertices[one, 0]) - vertices[other, 0]
    y = int(vertices[one, 1]) - vertices[other, 1]
    z = int(vertices[one, 2]) - vertices[other, 2]
    return int(x * x + y * y + z * z)


@inlined_kernel
def angle_class(opposite: int, one: int, other: int) -> int:
    """Class 0 to 31 of the angle between two sides, from the squared lengths of the three sides."""
    product = float(one) * float(other)
    if not product > 0.0:
        return 0
    double_dot = float(one) + float(other) - float(opposite)
    cosine = double_dot * abs(double_dot) / product * (ANGLE_STEPS // 8) + ANGLE_STEPS // 2
    return int(ANGLE_CLASSES[int(min(max(cosine, 0.0), float(ANGLE_STEPS)))])


@inlined_kernel
def length_class(squared: int, reference: int) -> int:
    """Class 0 to 15 of a squared length in proportion to another one."""
    if not reference > 0:
        return 15
    return int(LENGTH_CLASSES[int(min(float(squared) * (16.0 / float(reference)), float(LENGTH_RATIOS)))])


@inlined_kernel
def vertex_state(vertices: NDArray[np.int32], vertex: int) -> int:
    """0: no faces yet; 1: has open edges; 2: complete."""
    if vertices[vertex, half_edges.FACES] == 0:
        return 0
    return 1 if vertices[vertex, half_edges.OPEN_EDGES] > 0 else 2


@inlined_kernel
def edges_closed(flags: int) -> int:
    """0, 1 or 2 edges closed, or 3 for a blocked candidate."""
    if flags & half_edges.BLOCKED:
        return 3
    return (flags & 1) + (flags >> 1)


@inlined_kernel
def connectivity_features(
    vertices: NDArray[np.int32], kind: int, flags: int, vertex: int, ends: int
) -> tuple[int, int, int]:
    """Places in the table of what the connectivity alone says about a candidate.

    `ends` packs the faces at the gate's two ends, up to 7 each.
    """
    closed = edges_closed(flags)
    faces = min(int(vertices[vertex, half_edges.FACES]), 7)
    open_pairs = min(int(vertices[vertex, half_edges.OPEN_EDGES]) >> 1, 3)
    first = ((flags & half_edges.CLOSES_FIRST) << 3) | (ends >> 3)
    second = ((flags & half_edges.CLOSES_SECOND) << 2) | (ends & 7)
    return (
        KIND_SCORES + (kind * CLOSINGS + closed) * STATES + vertex_state(vertices, vertex),
        VALENCE_SCORES + (faces * 4 + open_pairs) * CLOSINGS + closed,
        END_SCORES + first * 16 + second,
    )


@inlined_kernel
def shape_features(
    vertices: NDArray[np.int32], kind: int, flags: int, vertex: int, gate: tuple[int, int, int, int]
) -> tuple[int, int, int]:
    """Places in the table of what the positions say; `gate` is its ends, the apex behind it, its squared length."""
    one = squared_distance(vertices, gate[0], vertex)
    other = squared_distance(vertices, gate[1], vertex)
    across = squared_distance(vertices, gate[2], vertex)
    angle = angle_class(gate[3], one, other)
    length = length_class(across, gate[3])
    shorter = min((min(one, other) + 2) >> 2, 15)
    longer = min((max(one, other) + 2) >> 2, 15)
    corner = edges_closed(flags) * STATES + vertex_state(vertices, vertex)
    angle_sum = min(31, (int(vertices[vertex, half_edges.ANGLE]) + angle) >> 1)
    return (
        SHAPE_SCORES + (kind * 16 + length) * 32 + angle,
        SHORT_EDGE_SCORES + (shorter * 16 + longer) * 16 + min((gate[3] + 2) >> 2, 15),
        ANGLE_SUM_SCORES + corner * 32 + angle_sum,
    )


@inlined_kernel
def gate_ends(vertices: NDArray[np.int32], first: int, second: int) -> int:
    """The faces at the two ends of a gate, up to 7 each, in one number."""
    return min(int(vertices[first, half_edges.FACES]), 7) * 8 + min(int(vertices[second, half_edges.FACES]), 7)


@borrowing_kernel
def score_candidates(
    scores: NDArray[np.int32],
    geometric: bool,
    candidates: Candidates,
    count: int,
    vertices: NDArray[np.int32],
    first: int,
    second: int,
    known_apex: int,
) -> tuple[int, int]:
    """Fill `candidates.weight`; returns the row of the best candidate and the sum of all weights."""
    weight = candidates.weight
    ends = gate_ends(vertices, first, second)
    gate = (first, second, known_apex, squared_distance(vertices, first, second))
    best = 0
    for row in range(count):
        vertex = int(candidates.vertex[row])
        kind = int(candidates.kind[row])
        flags = int(candidates.flags[row])
        one, two, three = connectivity_features(vertices, kind, flags, vertex, ends)
        score = int(scores[one]) + scores[two] + scores[three]
        if geometric:
            one, two, three = shape_features(vertices, kind, flags, vertex, gate)
            score += int(scores[one]) + scores[two] + scores[three]
        weight[row] = score
        if score > weight[best]:
            best = row
    highest = weight[best]
    total = 0
    for row in range(count):
        weight[row] = WEIGHTS[min((highest - weight[row]) // SCORE_STEP, len(WEIGHTS) - 1)]
        total += int(weight[row])
    return best, total
