"""Gates: half-edges whose other side is open. Most faces are coded here, one apex at a time.

Half-edges are numbered in the order in which they are made, so the queue of gates is the numbering itself: the first
pass looks at each half-edge once, in order. A gate whose best candidate is doubtful is left open then, because its
surroundings may be known better later; when the first pass has nothing left, the second pass asks it for good.
Where faces are coded deeply there are more passes, each of which asks gates that were too doubtful for those before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import borrowing_kernel, merged_kernel
from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity.candidate_kernels import BLOCKED_ONLY, UNBLOCKED, gather_apexes
from meshtide_codec.connectivity.choice_kernels import code_apex, code_has_face, learn, weigh
from meshtide_codec.connectivity.decision_kernels import AT_EXTRA_FACE, AT_GATE, borders
from meshtide_codec.connectivity.level_kernels import (
    DONE,
    FACES_DONE,
    GATE_PASSES,
    NOT_CLOSED,
    add_chosen_face,
    add_face_at_gate,
    next_number,
)
from meshtide_codec.connectivity.score_deep_kernels import FULL_WEIGHT as FULL_DEEP_WEIGHT
from meshtide_codec.connectivity.score_kernels import FULL_WEIGHT
from meshtide_codec.connectivity.truth_kernels import find_right

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.choice_kernels import Models
    from meshtide_codec.connectivity.level_kernels import Level
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

DOUBTFUL = FULL_WEIGHT * 5 // 2  # sum of weights beyond which a gate waits: the best has less than 40 %
DEEPLY_DOUBTFUL: NDArray[np.int64] = np.array([65, 66, 68, 72, 80, 100, 130, 200]) * FULL_DEEP_WEIGHT // 64
"""The same for all passes but the last, where faces are coded deeply."""
NEVER_DOUBTFUL = 1 << 62


@merged_kernel
def next_gate(level: Level, place: int) -> int:
    """The next open half-edge of the pass whose place in `progress` is given, or -1; advances that pass beyond it."""
    triangles = level.fine.triangles
    half_edge = level.progress[place]
    end = 4 * level.progress[FACES_DONE]
    while half_edge < end:
        if half_edge & 3 == 3:
            half_edge += 1
        elif half_edges.field(triangles, half_edge, half_edges.TWIN) == half_edges.OPEN:
            level.progress[place] = half_edge + 1
            return int(half_edge)
        else:
            half_edge += 1
    level.progress[place] = half_edge
    return -1


@borrowing_kernel
def code_gates(coder: Coder, buffer: Buffer, models: Models, level: Level) -> int:
    """Code gates until none is left or all faces are known; returns DONE or a negative status."""
    last = len(DEEPLY_DOUBTFUL) if level.deep else 1
    while level.progress[FACES_DONE] < len(level.fine.triangles):
        which = 0
        gate = next_gate(level, GATE_PASSES)
        while gate < 0 and which < last:
            which += 1
            gate = next_gate(level, GATE_PASSES + which)
        if gate < 0:
            return DONE
        doubtful = DEEPLY_DOUBTFUL[min(which, last - 1)] if level.deep else DOUBTFUL
        status = code_gate(coder, buffer, models, level, gate, doubtful if which < last else NEVER_DOUBTFUL)
        if status < 0:
            return status
    return DONE


@merged_kernel
def code_gate(coder: Coder, buffer: Buffer, models: Models, level: Level, gate: int, doubtful: int) -> int:
    """Code the face on the open side of a half-edge, or that there is none; beyond a sum of weights, leave it open."""
    fine = level.fine
    triangles = fine.triangles
    vertices = fine.vertices
    second = half_edges.field(triangles, gate, half_edges.CORNER)
    first = half_edges.field(triangles, half_edges.following(gate), half_edges.CORNER)
    known_apex = half_edges.field(triangles, half_edges.preceding(gate), half_edges.CORNER)
    number = next_number(level)
    if half_edges.mark_surroundings(fine, first, second, number):
        half_edges.drop_gate(triangles, vertices, gate, first, second, half_edges.EXTRA)
        return DONE
    count, below, uncovered = gather_apexes(
        level.candidates, level.coarse, fine, first, second, known_apex, number, UNBLOCKED
    )
    best, total = 0, 0
    if count > 0:
        best, total = weigh(models, level, count, first, second, known_apex)
    if total > doubtful:
        return DONE
    at_border = borders(fine, first, second)
    surroundings = (fine.parents[first] == fine.parents[second], below, uncovered, at_border)
    has_face = 0
    if level.encoding and find_right(level.truth, level.candidates, count, first, second):
        has_face = 1
    if level.closed:
        if count == 0 or (level.encoding and not has_face):
            return NOT_CLOSED
        has_face = 1
    elif count > 0:
        has_face = code_has_face(coder, buffer, models, level, surroundings, count, best, total, has_face)
    if has_face:
        row = code_apex(coder, buffer, models, level, AT_GATE, count, best, total)
        if row < 0:
            return row
        learn(models, level, count, first, second, known_apex, row, total)
        add_face_at_gate(level, gate, row)
        return DONE
    if not level.clean:
        status = _code_blocked_apex(coder, buffer, models, level, (first, second, known_apex), number, surroundings)
        if status != DONE:
            return status
    half_edges.drop_gate(triangles, vertices, gate, first, second, half_edges.BORDER)
    vertices[first, half_edges.AT_BORDER] = 1
    vertices[second, half_edges.AT_BORDER] = 1
    return DONE


@borrowing_kernel
def _code_blocked_apex(
    coder: Coder,
    buffer: Buffer,
    models: Models,
    level: Level,
    corners: tuple[int, int, int],
    number: int,
    surroundings: tuple[bool, int, int, int],
) -> int:
    """Code a face whose apex is blocked, or that there is none; returns ADDED, DONE or a negative status."""
    first, second, known_apex = corners
    candidates = level.candidates
    count, _, _ = gather_apexes(candidates, level.coarse, level.fine, first, second, known_apex, number, BLOCKED_ONLY)
    if count == 0:
        return DONE
    best, total = weigh(models, level, count, first, second, known_apex)
    has_face = 0
    if level.encoding and find_right(level.truth, candidates, count, first, second):
        has_face = 1
    if not code_has_face(coder, buffer, models, level, surroundings, count, best, total, has_face):
        return DONE
    row = code_apex(coder, buffer, models, level, AT_EXTRA_FACE, count, best, total)
    if row < 0:
        return row
    learn(models, level, count, first, second, known_apex, row, total)
    return add_chosen_face(level, first, second, row)
