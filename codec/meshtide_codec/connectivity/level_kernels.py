"""The state of one level's traversal, and the ways in which a new face enters it.

Encoder and decoder run the same kernels over this state; the encoder's Truth says what to write, the decoder's is
empty. Cost of adding a face: O(1) look-ups.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from meshtide_codec.compilation import borrowing_kernel, inlined_kernel, merged_kernel
from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity.coarse_kernels import SPLIT, CoarseMesh, cover, has_split_apex
from meshtide_codec.connectivity.edge_index_kernels import is_degenerate
from meshtide_codec.connectivity.shape_kernels import angle_class, position, squared_distance

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.candidate_kernels import Candidates
    from meshtide_codec.connectivity.half_edge_kernels import FineMesh
    from meshtide_codec.connectivity.truth_kernels import Truth

# Places in Level.progress.
FACES_DONE = 0
ADDED = 1  # a face was added and there may be more
NUMBER = 1  # of the last gate: marks of earlier gates are void
EXTRA_PASS = 2  # next half-edge at which extra faces are asked for
SEED = 3  # next coarse face that may lack a fine one
LEFTOVER = 4  # next vertex at which leftover faces are asked for
LEFTOVER_ENTRY = 5  # encoder: entry of that vertex in the index of true faces
GATE_PASSES = 6  # next half-edges that the passes over the gates look at
MOST_GATE_PASSES = 9
PROGRESS_SIZE = GATE_PASSES + MOST_GATE_PASSES

NO_VERTEX = -1

# Status codes of a traversal, beside TOO_MANY_FACES (-1) and NO_SUCH_CANDIDATE (-2).
DONE = 0
NOT_CLOSED = -3  # a gate has no face in its list, in a level announced as closed
NOT_CLEAN = -4  # gates and seeds do not reach all faces, in a level announced as clean
FOREIGN_COARSE = -5  # encoder: the coarse faces are not what the fine ones collapse to
NO_SUCH_VERTEX = -6  # the stream names a vertex outside of the level, or a face with a repeated corner
TOO_FEW_FACES = -7  # decoder: the stream ends with faces missing


class Level(NamedTuple):
    """Everything that a traversal works on.

    Attributes:
        coarse: the level above.
        fine: the level being coded.
        truth: the faces to encode, empty in a decoder.
        candidates: room for the list of the current decision.
        progress: (PROGRESS_SIZE,) int64, see the places above.
        corners: (3,) int64, corners of a face that is being spelt out, NO_VERTEX where not chosen yet.
        encoding: whether truth is there.
        closed: announced: every gate has a face in its list.
        clean: announced: gates and seeds reach every face.
        geometric: whether the vertices' positions are known.
        deep: whether candidates are weighed and asked for as at effort high; only where positions are known.
    """

    coarse: CoarseMesh
    fine: FineMesh
    truth: Truth
    candidates: Candidates
    progress: NDArray[np.int64]
    corners: NDArray[np.int64]
    encoding: bool
    closed: bool
    clean: bool
    geometric: bool
    deep: bool


@inlined_kernel
def next_number(level: Level) -> int:
    """A number for a new decision."""
    level.progress[NUMBER] += 1
    return int(level.progress[NUMBER])


@merged_kernel
def add_face_at_gate(level: Level, gate: int, row: int) -> None:
    """Add the face between a gate and the candidate at `row`, closing the edges that it closes."""
    triangles = level.fine.triangles
    vertices = level.fine.vertices
    triangle = level.progress[FACES_DONE]
    level.progress[FACES_DONE] = triangle + 1
    second = half_edges.field(triangles, gate, half_edges.CORNER)
    first = half_edges.field(triangles, half_edges.following(gate), half_edges.CORNER)
    apex = int(level.candidates.vertex[row])
    flags = int(level.candidates.flags[row])
    coarse_face = level.candidates.coarse_face[row]
    if coarse_face >= 0:
        level.coarse.covered[coarse_face] = 1
    if level.encoding:
        level.truth.done[level.truth.edges.face[level.candidates.right[row]]] = 1
    half_edges.write_corners(level.fine, triangle, first, second, apex)
    base = 4 * triangle
    half_edges.close_edge(triangles, vertices, gate, base, first, second)
    if flags & half_edges.CLOSES_SECOND:
        partner = int(vertices[apex, half_edges.CLOSING_SECOND])
        half_edges.close_edge(triangles, vertices, partner, base + 1, second, apex)
    elif _may_have_another_face(level, apex, second):
        half_edges.open_edge(triangles, vertices, base + 1, second, apex)
    if flags & half_edges.CLOSES_FIRST:
        partner = int(vertices[apex, half_edges.CLOSING_FIRST])
        half_edges.close_edge(triangles, vertices, partner, base + 2, apex, first)
    elif _may_have_another_face(level, first, apex):
        half_edges.open_edge(triangles, vertices, base + 2, apex, first)
    half_edges.link(triangles, vertices, base, first)
    half_edges.link(triangles, vertices, base + 1, second)
    half_edges.link(triangles, vertices, base + 2, apex)
    if level.geometric:
        _add_angles(vertices, first, second, apex)


@inlined_kernel
def _may_have_another_face(level: Level, start: int, end: int) -> bool:
    """Whether a face with the directed edge start -> end is possible and not among the copied ones."""
    coarse_start = level.fine.parents[start]
    coarse_end = level.fine.parents[end]
    if (level.coarse.activity[coarse_start] | level.coarse.activity[coarse_end]) & SPLIT:
        return True
    return has_split_apex(level.coarse, coarse_start, coarse_end)


@merged_kernel
def _add_angles(vertices: NDArray[np.int32], first: int, second: int, apex: int) -> None:
    gate = squared_distance(position(vertices, first), position(vertices, second))
    one = squared_distance(position(vertices, first), position(vertices, apex))
    other = squared_distance(position(vertices, second), position(vertices, apex))
    at_apex = angle_class(gate, one, other)
    at_first = angle_class(other, one, gate)
    vertices[apex, half_edges.ANGLE] += at_apex
    vertices[first, half_edges.ANGLE] += at_first
    vertices[second, half_edges.ANGLE] += max(0, 31 - at_apex - at_first)


@borrowing_kernel
def add_face_anywhere(level: Level, a: int, b: int, c: int) -> int:
    """Add a face that no gate produced; returns ADDED or what is wrong with it."""
    if is_degenerate(a, b, c):
        return NO_SUCH_VERTEX
    triangle = level.progress[FACES_DONE]
    level.progress[FACES_DONE] = triangle + 1
    half_edges.write_corners(level.fine, triangle, a, b, c)
    half_edges.attach_anywhere(level.fine, triangle)
    cover(level.coarse, level.fine, triangle)
    if level.geometric:
        _add_angles(level.fine.vertices, a, b, c)
    return ADDED


@borrowing_kernel
def add_chosen_face(level: Level, first: int, second: int, row: int) -> int:
    """Add the face of two corners and the candidate at `row`; returns ADDED or what is wrong with it."""
    if level.encoding:
        level.truth.done[level.truth.edges.face[level.candidates.right[row]]] = 1
    return add_face_anywhere(level, first, second, int(level.candidates.vertex[row]))
