"""Faces without a known neighbour: seeds above coarse faces, and leftovers that are spelt out.

A coarse face that is not accounted for when the gates are exhausted has a fine face that no gate reached: a seed. Its
corners are children of the coarse corners, chosen one after the other. Whatever remains then is a leftover: for each
vertex of a split family, whether it has one; its other corners from a list of vertices around, or else by their
distance in the vertex order. Cost: O(candidates) for a face, O(vertices + faces) questions in all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compilation import borrowing_kernel
from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity.candidate_kernels import CAPACITY, EVERYTHING, SIBLING, gather_apexes
from meshtide_codec.connectivity.coarse_kernels import SPLIT
from meshtide_codec.connectivity.decision_kernels import (
    AT_CORNER,
    LEFTOVER_CONTEXTS,
    LISTED_CONTEXTS,
    NO_SUCH_CANDIDATE,
    OFFSET_CONTEXTS,
    code_choice,
)
from meshtide_codec.connectivity.level_kernels import (
    DONE,
    FOREIGN_COARSE,
    LEFTOVER,
    LEFTOVER_ENTRY,
    NO_SUCH_VERTEX,
    NO_VERTEX,
    SEED,
    add_face_anywhere,
    next_number,
)
from meshtide_codec.connectivity.score_kernels import FULL_WEIGHT
from meshtide_codec.connectivity.shape_kernels import position, squared_distance
from meshtide_codec.connectivity.truth_kernels import finish_face
from meshtide_codec.entropy.model_kernels import code_adaptive_bit, code_signed
from meshtide_codec.entropy.range_coder_kernels import code_raw_bits

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.choice_kernels import Models
    from meshtide_codec.connectivity.level_kernels import Level
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder


@borrowing_kernel
def code_seed(coder: Coder, buffer: Buffer, models: Models, level: Level, witnesses: NDArray[np.int32]) -> int:
    """Add a face above the next coarse face that lacks one; returns ADDED, DONE when none does, or a status.

    `witnesses` (k,) int32: in an encoder, one true face above each coarse face.
    """
    coarse = level.coarse
    face = level.progress[SEED]
    while face < len(coarse.faces) and coarse.covered[face]:
        face += 1
    level.progress[SEED] = face
    if face == len(coarse.faces):
        return DONE
    if level.encoding and witnesses[face] < 0:
        return FOREIGN_COARSE
    corners = level.corners
    corners[:] = NO_VERTEX
    for corner in range(3):
        parent = coarse.faces[face, corner]
        right = NO_VERTEX
        if level.encoding:
            for other in range(3):
                vertex = level.truth.faces[witnesses[face], other]
                if level.fine.parents[vertex] == parent:
                    right = int(vertex)
        vertex = _code_child(coder, buffer, models, level, parent, right)
        if vertex < 0:
            return vertex
        corners[corner] = vertex
    coarse.covered[face] = 1
    if level.encoding and not finish_face(level.truth, corners[0], corners[1], corners[2]):
        return FOREIGN_COARSE
    return add_face_anywhere(level, corners[0], corners[1], corners[2])


@borrowing_kernel
def _code_child(coder: Coder, buffer: Buffer, models: Models, level: Level, parent: int, right: int) -> int:
    """Code which child of `parent` is the next corner."""
    lowest = int(level.coarse.children[parent])
    count = int(level.coarse.children[parent + 1]) - lowest
    if count > CAPACITY:
        bits = 0
        while (count - 1) >> bits:
            bits += 1
        offset = code_raw_bits(coder, buffer, bits, right - lowest)
        return lowest + offset if offset < count else NO_SUCH_VERTEX
    for row in range(count):
        level.candidates.vertex[row] = lowest + row
        level.candidates.kind[row] = SIBLING
        level.candidates.corner[row] = 0
    return _code_listed(coder, buffer, models, level, count, right)


@borrowing_kernel
def _code_listed(coder: Coder, buffer: Buffer, models: Models, level: Level, count: int, right: int) -> int:
    """Code which vertex of the list is `right`, the nearest to the corners chosen so far first."""
    if count == 0:
        return NO_SUCH_CANDIDATE
    candidates = level.candidates
    nearest = _distance_to_corners(level, int(candidates.vertex[0]))
    for row in range(1, count):
        nearest = min(nearest, _distance_to_corners(level, int(candidates.vertex[row])))
    best = 0
    total = 0
    for row in range(count):
        vertex = int(candidates.vertex[row])
        candidates.right[row] = 0 if vertex == right else -1
        candidates.weight[row] = int(FULL_WEIGHT * nearest / _distance_to_corners(level, vertex))
        total += int(candidates.weight[row])
        if candidates.weight[row] > candidates.weight[best]:
            best = row
    row = code_choice(coder, buffer, models.contexts, models.weights, AT_CORNER, candidates, count, best, total)
    return int(candidates.vertex[row]) if row >= 0 else row


@borrowing_kernel
def _distance_to_corners(level: Level, vertex: int) -> float:
    """How far a vertex is from the corners chosen so far, at least 1; without positions by the order of vertices."""
    vertices = level.fine.vertices
    distance = 1.0
    for corner in level.corners:
        if corner == NO_VERTEX:
            continue
        if level.geometric:
            distance += squared_distance(position(vertices, corner), position(vertices, vertex))
        else:
            distance += abs(float(corner - vertex))
    if vertices[vertex, half_edges.FACES] > 0 and not level.geometric:
        distance *= 2.0
    return distance


@borrowing_kernel
def code_leftover(coder: Coder, buffer: Buffer, models: Models, level: Level) -> int:
    """Add the next face that nothing else reached; returns ADDED, DONE when vertices run out, or a status."""
    vertices = level.fine.vertices
    progress = level.progress
    while progress[LEFTOVER] < len(vertices):
        vertex = progress[LEFTOVER]
        if level.coarse.activity[level.fine.parents[vertex]] & SPLIT:
            more = 0
            if level.encoding and _find_leftover(level, vertex) >= 0:
                more = 1
            context = min(int(vertices[vertex, half_edges.FACES]), 3) * 2
            context += vertices[vertex, half_edges.AT_BORDER]
            if code_adaptive_bit(coder, buffer, models.contexts, LEFTOVER_CONTEXTS + context, more):
                return _code_other_corners(coder, buffer, models, level, vertex)
        progress[LEFTOVER] = vertex + 1
    return DONE


@borrowing_kernel
def _find_leftover(level: Level, vertex: int) -> int:
    """Encoder: an entry of `vertex` whose face is not coded yet, or -1. Moves forward only."""
    edges = level.truth.edges
    entry = max(level.progress[LEFTOVER_ENTRY], int(edges.start[vertex]))
    stop = edges.start[vertex + 1]
    while entry < stop and level.truth.done[edges.face[entry]]:
        entry += 1
    level.progress[LEFTOVER_ENTRY] = entry
    return entry if entry < stop else -1


@borrowing_kernel
def _code_other_corners(coder: Coder, buffer: Buffer, models: Models, level: Level, first: int) -> int:
    """Code the second and the third corner of a leftover face, then add it."""
    corners = level.corners
    corners[:] = NO_VERTEX
    corners[0] = first
    for place in range(1, 3):
        right = NO_VERTEX
        if level.encoding:
            edges = level.truth.edges
            entry = level.progress[LEFTOVER_ENTRY]
            right = int(edges.target[entry]) if place == 1 else int(edges.apex[entry])
        around = first if place == 1 else corners[1]
        count, _, _ = gather_apexes(
            level.candidates, level.coarse, level.fine, first, around, NO_VERTEX, next_number(level), EVERYTHING
        )
        listed = 0
        if level.encoding:
            for row in range(count):
                if level.candidates.vertex[row] == right:
                    listed = 1
        if code_adaptive_bit(coder, buffer, models.contexts, LISTED_CONTEXTS + place - 1, listed):
            vertex = _code_listed(coder, buffer, models, level, count, right)
        else:
            vertex = first + code_signed(coder, buffer, models.contexts, OFFSET_CONTEXTS, right - first)
        if vertex < 0 or vertex >= len(level.fine.vertices):
            return NO_SUCH_VERTEX
        corners[place] = vertex
    if level.encoding:
        level.truth.done[level.truth.edges.face[level.progress[LEFTOVER_ENTRY]]] = 1
    return add_face_anywhere(level, first, corners[1], corners[2])
