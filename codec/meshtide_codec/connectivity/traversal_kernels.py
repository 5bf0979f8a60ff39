"""The traversal of one level: copied faces, gates, extra faces, seeds, leftovers, until all faces are known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel
from meshtide_codec.connectivity.coarse_kernels import copy_free_faces
from meshtide_codec.connectivity.edge_index_kernels import find_entry, is_degenerate
from meshtide_codec.connectivity.extra_face_kernels import code_extra_face
from meshtide_codec.connectivity.gate_kernels import code_gates
from meshtide_codec.connectivity.level_kernels import (
    DONE,
    FACES_DONE,
    FOREIGN_COARSE,
    NOT_CLEAN,
    TOO_FEW_FACES,
)
from meshtide_codec.connectivity.seed_kernels import code_leftover, code_seed
from meshtide_codec.connectivity.truth_kernels import finish_face

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.choice_kernels import Models
    from meshtide_codec.connectivity.coarse_kernels import CoarseMesh
    from meshtide_codec.connectivity.level_kernels import Level
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder


@kernel
def traverse(coder: Coder, buffer: Buffer, models: Models, level: Level, witnesses: NDArray[np.int32]) -> int:
    """Code all faces of a level into `level.fine.triangles`; returns DONE or a negative status."""
    status = copy_free_faces(level.coarse, level.fine)
    if status < 0:
        return status
    level.progress[FACES_DONE] = status
    if level.encoding:
        for triangle in range(status):
            corners = level.fine.triangles[triangle]
            if not finish_face(level.truth, corners[0], corners[1], corners[2]):
                return FOREIGN_COARSE
    while level.progress[FACES_DONE] < len(level.fine.triangles):
        status = code_gates(coder, buffer, models, level)
        if status < 0:
            return status
        if level.progress[FACES_DONE] == len(level.fine.triangles):
            break
        if not level.clean:
            status = code_extra_face(coder, buffer, models, level)
        if status == DONE:
            status = code_seed(coder, buffer, models, level, witnesses)
        if status == DONE:
            if level.clean:
                return NOT_CLEAN
            status = code_leftover(coder, buffer, models, level)
        if status == DONE:
            return FOREIGN_COARSE if level.encoding else TOO_FEW_FACES
        if status < 0:
            return status
    return DONE


@kernel
def find_witnesses(faces: NDArray[np.int32], parents: NDArray[np.int32], coarse: CoarseMesh) -> NDArray[np.int32]:
    """One fine face above each coarse face that has a split corner or a split neighbour, (k,) int32; -1 elsewhere."""
    witnesses = np.full(len(coarse.faces), -1, np.int32)
    for face in range(len(faces)):
        a, b, c = parents[faces[face, 0]], parents[faces[face, 1]], parents[faces[face, 2]]
        if not is_degenerate(a, b, c):
            entry = find_entry(coarse.edges, a, b, c)
            if entry >= 0:
                witnesses[coarse.edges.face[entry]] = face
    return witnesses
