"""Extra faces: what the gates cannot reach at edges that have a face already.

At every edge of the active part one question: is there a further face, and in which direction does it run? Covers
edges with three or more faces, faces that turn over at an edge, and gates whose face was not in the short list.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compilation import borrowing_kernel, merged_kernel
from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity.candidate_kernels import EVERYTHING, gather_apexes
from meshtide_codec.connectivity.choice_kernels import code_apex, weigh
from meshtide_codec.connectivity.coarse_kernels import APEX_SCAN_LIMIT, SPLIT
from meshtide_codec.connectivity.decision_kernels import (
    AT_EXTRA_FACE,
    EXTRA_CONTEXTS,
    EXTRA_DIRECTION_CONTEXTS,
    NO_SUCH_CANDIDATE,
    borders,
)
from meshtide_codec.connectivity.edge_index_kernels import first_entry
from meshtide_codec.connectivity.level_kernels import (
    DONE,
    EXTRA_PASS,
    FACES_DONE,
    add_chosen_face,
    next_number,
)
from meshtide_codec.connectivity.truth_kernels import find_right, waiting_entry
from meshtide_codec.entropy.model_kernels import code_adaptive_bit

if TYPE_CHECKING:
    from meshtide_codec.connectivity.choice_kernels import Models
    from meshtide_codec.connectivity.coarse_kernels import CoarseMesh
    from meshtide_codec.connectivity.level_kernels import Level
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder


@borrowing_kernel
def code_extra_face(coder: Coder, buffer: Buffer, models: Models, level: Level) -> int:
    """Go on to the next extra face and add it; returns ADDED, DONE when there are no more, or a negative status."""
    triangles = level.fine.triangles
    end = 4 * level.progress[FACES_DONE]
    while level.progress[EXTRA_PASS] < end:
        half_edge = level.progress[EXTRA_PASS]
        if half_edge & 3 != 3:
            state = half_edges.field(triangles, half_edge, half_edges.TWIN)
            if state == half_edges.BORDER or state > half_edge:
                status = _code_at_edge(coder, buffer, models, level, half_edge, state)
                if status != DONE:
                    return status
        level.progress[EXTRA_PASS] = half_edge + 1
    return DONE


@merged_kernel
def _code_at_edge(coder: Coder, buffer: Buffer, models: Models, level: Level, half_edge: int, state: int) -> int:
    """Ask for a further face at the edge of `half_edge`."""
    fine = level.fine
    second = half_edges.field(fine.triangles, half_edge, half_edges.CORNER)
    first = half_edges.field(fine.triangles, half_edges.following(half_edge), half_edges.CORNER)
    known_apex = half_edges.field(fine.triangles, half_edges.preceding(half_edge), half_edges.CORNER)
    context = _context(level, first, second, state)
    if context < 0:
        return DONE
    direction = 0
    count = 0
    more = 0
    if level.encoding:
        while direction < 2 and not more:
            start, end = (first, second) if direction == 0 else (second, first)
            if waiting_entry(level.truth, start, end) >= 0:
                count = _gather(level, start, end, known_apex)
                if find_right(level.truth, level.candidates, count, start, end):
                    more = 1
                    break
            direction += 1
    if not code_adaptive_bit(coder, buffer, models.contexts, EXTRA_CONTEXTS + context, more):
        return DONE
    direction_context = EXTRA_DIRECTION_CONTEXTS + (1 if state == half_edges.BORDER else 0)
    direction = code_adaptive_bit(coder, buffer, models.contexts, direction_context, direction & 1)
    if direction:
        first, second = second, first
    if not level.encoding:
        count = _gather(level, first, second, known_apex)
        if count == 0:
            return NO_SUCH_CANDIDATE
    best, total = weigh(models, level, count, first, second, known_apex)
    row = code_apex(coder, buffer, models, level, AT_EXTRA_FACE, count, best, total)
    if row < 0:
        return row
    return add_chosen_face(level, first, second, row)


@borrowing_kernel
def _gather(level: Level, first: int, second: int, known_apex: int) -> int:
    number = next_number(level)
    half_edges.mark_surroundings(level.fine, first, second, number)
    count, _, _ = gather_apexes(
        level.candidates, level.coarse, level.fine, first, second, known_apex, number, EVERYTHING
    )
    return count


@merged_kernel
def _context(level: Level, first: int, second: int, state: int) -> int:
    """Context of the question at an edge; -1 where everything around is unsplit, so that nothing can be missing."""
    coarse = level.coarse
    first_parent = level.fine.parents[first]
    second_parent = level.fine.parents[second]
    activity = coarse.activity[first_parent] | coarse.activity[second_parent]
    shared = 1 if first_parent == second_parent else 0
    faces = 0
    uncovered = 0
    if shared:
        faces = min(5, coarse.children[first_parent + 1] - coarse.children[first_parent] - 2)
    else:
        one = _faces_below(coarse, first_parent, second_parent)
        other = _faces_below(coarse, second_parent, first_parent)
        faces = min(5, one[0] + other[0])
        uncovered = min(2, one[1] + other[1])
        activity |= one[2] | other[2]
    if not activity & SPLIT:
        return -1
    both_split = coarse.activity[first_parent] & coarse.activity[second_parent] & SPLIT
    context = ((shared * 6 + faces) * 3 + uncovered) * 3 + borders(level.fine, first, second)
    return (context * 2 + (1 if state == half_edges.BORDER else 0)) * 2 + (0 if both_split else 1)


@merged_kernel
def _faces_below(coarse: CoarseMesh, start: int, end: int) -> tuple[int, int, int]:
    """Coarse faces at a coarse directed edge, how many are not accounted for, and their apexes' joint activity."""
    edges = coarse.edges
    faces = 0
    uncovered = 0
    activity = 0
    place = first_entry(edges, start, end, 0)
    stop = min(int(edges.start[start + 1]), place + APEX_SCAN_LIMIT)
    while place < stop and edges.target[place] == end:
        faces += 1
        uncovered += 1 - coarse.covered[edges.face[place]]
        activity |= coarse.activity[edges.apex[place]]
        place += 1
    return faces, uncovered, activity
