"""How likely each candidate is: sums of integer scores, one for each property of the triangle it would make.

A score counts LOGISTIC_UNIT per nat: two candidates whose scores differ by d are expected with odds exp(d / 256) : 1.
Scores are turned into weights exp(score - best score); a candidate's weight over the sum of all weights is how
confident the table is in it. Without positions three properties count, with positions seven. The scores start as
trained and move with every choice that was not expected, so they adapt to the mesh at hand. Cost: O(candidates).
"""

from __future__ import annotations

from decimal import Context
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import borrowing_kernel, inlined_kernel, merged_kernel
from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity import shape_kernels as shapes
from meshtide_codec.connectivity.candidate_kernels import CORNERS, KINDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.candidate_kernels import Candidates
    from meshtide_codec.connectivity.shape_kernels import GateShape

    Scores = NDArray[np.int32]
    Vertices = NDArray[np.int32]

# Sections of a score table: where the scores of each property start.
MOST_FACES = 7  # faces at a vertex are counted up to this
KIND_SCORES = 0
VALENCE_SCORES = KIND_SCORES + KINDS * CORNERS
END_SCORES = VALENCE_SCORES + 8 * 4 * CORNERS
LENGTH_SCORES = END_SCORES + 16 * 16
SHORT_LENGTH_SCORES = LENGTH_SCORES + KINDS * shapes.LENGTHS * shapes.ANGLES
ANGLE_SUM_SCORES = SHORT_LENGTH_SCORES + shapes.SHORT_LENGTHS**3
BEND_SCORES = ANGLE_SUM_SCORES + CORNERS * 32
SCORES = BEND_SCORES + CORNERS * shapes.ANGLES * 8

LOGISTIC_UNIT = 256
FULL_WEIGHT = 4096  # weight of the best candidate
SCORE_SHIFT = 2  # scores are compared in steps of four
LOWEST_WEIGHT = 1023  # steps below the best score at which a weight is zero

LEARNING_RATE = 12  # how far a score moves when a choice comes as a full surprise
EXPECTED_EIGHTHS = 7  # a choice with at least this share of all weights moves nothing


def _weights() -> NDArray[np.int64]:
    """FULL_WEIGHT * exp(-i * 4 / LOGISTIC_UNIT), rounded; by `decimal`, so the same on every machine."""
    context = Context(prec=20)
    steps = LOGISTIC_UNIT >> SCORE_SHIFT
    exact = [context.multiply(FULL_WEIGHT, context.exp(context.divide(-i, steps))) for i in range(LOWEST_WEIGHT + 1)]
    return np.array([int(weight.to_integral_value()) for weight in exact], np.int64)


WEIGHTS = _weights()


@inlined_kernel
def connectivity_features(
    vertices: Vertices, kind: int, flags: int, corner: int, vertex: int, ends: int
) -> tuple[int, int, int]:
    """Places in the table of what the connectivity alone says about a candidate; `ends` is made by `gate_ends`."""
    faces = min(int(vertices[vertex, half_edges.FACES]), MOST_FACES)
    open_pairs = min(int(vertices[vertex, half_edges.OPEN_EDGES]) >> 1, 3)
    first = ((flags & half_edges.CLOSES_FIRST) << 3) | (ends >> 3)
    second = ((flags & half_edges.CLOSES_SECOND) << 2) | (ends & 7)
    return (
        KIND_SCORES + kind * CORNERS + corner,
        VALENCE_SCORES + (faces * 4 + open_pairs) * CORNERS + corner,
        END_SCORES + first * 16 + second,
    )


@inlined_kernel
def shape_features(
    vertices: Vertices, kind: int, corner: int, vertex: int, gate: GateShape
) -> tuple[int, int, int, int]:
    """Places in the table of what the positions say about a candidate."""
    apex = shapes.position(vertices, vertex)
    one = shapes.squared_distance(gate.first, apex)
    other = shapes.squared_distance(gate.second, apex)
    across = shapes.squared_distance(gate.known, apex)
    angle = shapes.angle_class(gate.squared, one, other)
    length = shapes.length_class(across, gate.ratio_scale)
    shorter = shapes.short_length(one)
    longer = shapes.short_length(other)
    if shorter > longer:
        shorter, longer = longer, shorter
    angle_sum = min(31, (int(vertices[vertex, half_edges.ANGLE]) + angle) >> 1)
    bend = shapes.bend_class(gate, apex)
    return (
        LENGTH_SCORES + (kind * shapes.LENGTHS + length) * shapes.ANGLES + angle,
        SHORT_LENGTH_SCORES
        + (shorter * shapes.SHORT_LENGTHS + longer) * shapes.SHORT_LENGTHS
        + shapes.short_length(gate.squared),
        ANGLE_SUM_SCORES + corner * 32 + angle_sum,
        BEND_SCORES + (corner * shapes.ANGLES + bend) * 8 + (angle >> 2),
    )


@inlined_kernel
def gate_ends(vertices: Vertices, first: int, second: int) -> int:
    """The faces at the two ends of a gate, up to MOST_FACES each, in one number."""
    one = min(int(vertices[first, half_edges.FACES]), MOST_FACES)
    other = min(int(vertices[second, half_edges.FACES]), MOST_FACES)
    return one * 8 + other


@merged_kernel
def score_candidates(
    scores: Scores,
    geometric: bool,
    candidates: Candidates,
    count: int,
    vertices: Vertices,
    first: int,
    second: int,
    known_apex: int,
) -> tuple[int, int]:
    """Fill `candidates.weight`; returns the row of the best candidate and the sum of all weights."""
    weight = candidates.weight
    if count == 1:
        weight[0] = FULL_WEIGHT
        return 0, FULL_WEIGHT
    ends = gate_ends(vertices, first, second)
    gate = shapes.gate_shape(vertices, first, second, known_apex)
    best = 0
    highest = -(1 << 40)
    for row in range(count):
        vertex = int(candidates.vertex[row])
        kind = int(candidates.kind[row])
        corner = int(candidates.corner[row])
        a, b, c = connectivity_features(vertices, kind, int(candidates.flags[row]), corner, vertex, ends)
        score = int(scores[a]) + int(scores[b]) + int(scores[c])
        if geometric:
            d, e, f, g = shape_features(vertices, kind, corner, vertex, gate)
            score += int(scores[d]) + int(scores[e]) + int(scores[f]) + int(scores[g])
        weight[row] = score
        if score > highest:
            highest = score
            best = row
    total = 0
    for row in range(count):
        share = int(WEIGHTS[min((highest - int(weight[row])) >> SCORE_SHIFT, LOWEST_WEIGHT)])
        weight[row] = share
        total += share
    return best, total


@borrowing_kernel
def learn_scores(
    scores: Scores,
    geometric: bool,
    candidates: Candidates,
    count: int,
    vertices: Vertices,
    first: int,
    second: int,
    known_apex: int,
    chosen: int,
    total: int,
) -> None:
    """Move the scores towards the candidate that was chosen, unless that was expected anyway.

    `total` is the sum of all weights before the choice; refused candidates have the weight -1 - (weight before).
    """
    weight = candidates.weight
    expected = int(weight[chosen])
    if max(expected, -1 - expected) * 8 >= total * EXPECTED_EIGHTHS:
        return
    ends = gate_ends(vertices, first, second)
    gate = shapes.gate_shape(vertices, first, second, known_apex)
    for row in range(count):
        share = int(weight[row])
        error = (total if row == chosen else 0) - max(share, -1 - share)
        change = (LEARNING_RATE * ((error << 6) // total) + 32) >> 6
        if change == 0:
            continue
        vertex = int(candidates.vertex[row])
        kind = int(candidates.kind[row])
        corner = int(candidates.corner[row])
        a, b, c = connectivity_features(vertices, kind, int(candidates.flags[row]), corner, vertex, ends)
        scores[a] += change
        scores[b] += change
        scores[c] += change
        if geometric:
            d, e, f, g = shape_features(vertices, kind, corner, vertex, gate)
            scores[d] += change
            scores[e] += change
            scores[f] += change
            scores[g] += change
