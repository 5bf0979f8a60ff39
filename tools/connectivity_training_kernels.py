"""Kernels of the training of the connectivity coder's tables: recording decisions, fitting scores to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel
from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity.candidate_kernels import BLOCKED_ONLY, UNBLOCKED, gather_apexes
from meshtide_codec.connectivity.coarse_kernels import copy_free_faces
from meshtide_codec.connectivity.extra_face_kernels import code_extra_face
from meshtide_codec.connectivity.gate_kernels import DOUBTFUL, next_gate
from meshtide_codec.connectivity.level_kernels import (
    DONE,
    FACES_DONE,
    GATE_PASSES,
    add_chosen_face,
    add_face_at_gate,
    next_number,
)
from meshtide_codec.connectivity.score_kernels import (
    connectivity_features,
    gate_ends,
    score_candidates,
    shape_features,
)
from meshtide_codec.connectivity.seed_kernels import code_leftover, code_seed
from meshtide_codec.connectivity.shape_kernels import gate_shape
from meshtide_codec.connectivity.truth_kernels import find_right, finish_face

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.choice_kernels import Models
    from meshtide_codec.connectivity.level_kernels import Level
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

PLAIN_FEATURES = 3  # scores that are added up for a candidate without positions
FEATURES = 7  # and with positions


@kernel
def record_level(
    coder: Coder,
    buffer: Buffer,
    models: Models,
    level: Level,
    witnesses: NDArray[np.int32],
    features: NDArray[np.int32],
    right: NDArray[np.int8],
    ends: NDArray[np.int64],
) -> int:
    """Traverse a level as the encoder does, but write down every choice at a gate instead of coding it.

    `features` (rows, FEATURES), `right` (rows,) get one row a candidate, `ends` the row behind the last one of each
    choice. Returns the number of choices; stops early when there is no room for more.
    """
    choices = 0
    rows = 0
    level.progress[FACES_DONE] = copy_free_faces(level.coarse, level.fine)
    for triangle in range(level.progress[FACES_DONE]):
        corners = level.fine.triangles[triangle]
        finish_face(level.truth, corners[0], corners[1], corners[2])
    while level.progress[FACES_DONE] < len(level.fine.triangles):
        gate = next_gate(level, GATE_PASSES)
        may_wait = gate >= 0
        if gate < 0:
            gate = next_gate(level, GATE_PASSES + 1)
        if gate >= 0:
            added = _record_gate(models, level, gate, may_wait, features, right, rows)
            if added < 0:
                return choices
            if added > 0:
                rows += added
                ends[choices] = rows
                choices += 1
            continue
        status = code_extra_face(coder, buffer, models, level)
        if status == DONE:
            status = code_seed(coder, buffer, models, level, witnesses)
        if status == DONE:
            status = code_leftover(coder, buffer, models, level)
        if status <= 0:
            return choices
    return choices


@kernel
def _record_gate(
    models: Models,
    level: Level,
    gate: int,
    may_wait: bool,
    features: NDArray[np.int32],
    right: NDArray[np.int8],
    rows: int,
) -> int:
    """Settle one gate; returns the number of rows written, or -1 when there is no room."""
    fine = level.fine
    vertices = fine.vertices
    candidates = level.candidates
    second = half_edges.field(fine.triangles, gate, half_edges.CORNER)
    first = half_edges.field(fine.triangles, half_edges.following(gate), half_edges.CORNER)
    known_apex = half_edges.field(fine.triangles, half_edges.preceding(gate), half_edges.CORNER)
    number = next_number(level)
    if half_edges.mark_surroundings(fine, first, second, number):
        half_edges.drop_gate(fine.triangles, vertices, gate, first, second, half_edges.EXTRA)
        return 0
    count = 0
    found = False
    for wanted in (UNBLOCKED, BLOCKED_ONLY):
        count, _, _ = gather_apexes(candidates, level.coarse, fine, first, second, known_apex, number, wanted)
        _, total = score_candidates(
            models.scores, level.geometric, candidates, count, vertices, first, second, known_apex
        )
        if may_wait and total > DOUBTFUL and wanted == UNBLOCKED:
            return 0
        found = find_right(level.truth, candidates, count, first, second)
        if found:
            break
    if not found:
        half_edges.drop_gate(fine.triangles, vertices, gate, first, second, half_edges.BORDER)
        vertices[first, half_edges.AT_BORDER] = 1
        vertices[second, half_edges.AT_BORDER] = 1
        return 0
    if rows + count > len(features):
        return -1
    shape = gate_shape(vertices, first, second, known_apex)
    chosen = 0
    for row in range(count):
        kind = int(candidates.kind[row])
        flags = int(candidates.flags[row])
        corner = int(candidates.corner[row])
        vertex = int(candidates.vertex[row])
        one = connectivity_features(vertices, kind, flags, corner, vertex, gate_ends(vertices, first, second))
        other = shape_features(vertices, kind, corner, vertex, shape)
        for place in range(3):
            features[rows + row, place] = one[place]
        for place in range(4):
            features[rows + row, 3 + place] = other[place]
        right[rows + row] = 0
        if candidates.right[row] >= 0:
            right[rows + row] = 1
            chosen = row
    if candidates.flags[chosen] & half_edges.BLOCKED:
        add_chosen_face(level, first, second, chosen)
    else:
        add_face_at_gate(level, gate, chosen)
    return count if count > 1 else 0


@kernel
def descend(
    features: NDArray[np.int32],
    right: NDArray[np.int8],
    ends: NDArray[np.int64],
    used_features: int,
    scores: NDArray[np.float64],
    gradients: NDArray[np.float64],
    rate: float,
) -> float:
    """One pass of stochastic gradient descent (AdaGrad) over all choices; returns the mean cost in bits."""
    cost = 0.0
    weights = np.empty(1024, np.float64)
    begin = 0
    for end in ends:
        highest = -1e30
        for row in range(begin, end):
            score = 0.0
            for place in range(used_features):
                score += scores[features[row, place]]
            weights[row - begin] = score
            highest = max(highest, score)
        total = 0.0
        hit = 0.0
        for row in range(begin, end):
            weight = np.exp(weights[row - begin] - highest)
            weights[row - begin] = weight
            total += weight
            if right[row]:
                hit += weight
        cost -= np.log2(hit / total + 1e-12)
        for row in range(begin, end):
            gradient = -weights[row - begin] / total
            if right[row]:
                gradient += weights[row - begin] / hit
            if abs(gradient) > 1e-4:
                for place in range(used_features):
                    feature = features[row, place]
                    gradients[feature] += gradient * gradient
                    scores[feature] += rate * gradient / np.sqrt(gradients[feature] + 1.0)
        begin = end
    return cost / max(1, len(ends))
