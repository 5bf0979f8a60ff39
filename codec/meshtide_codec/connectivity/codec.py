"""Faces of a level to bytes and back, given the coarser level. See the package's description for the method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.connectivity import coarse_kernels, decision_kernels, half_edge_kernels, level_kernels
from meshtide_codec.connectivity.candidate_kernels import new_candidates
from meshtide_codec.connectivity.coarse_kernels import build_coarse_mesh
from meshtide_codec.connectivity.edge_index_kernels import sorted_faces
from meshtide_codec.connectivity.half_edge_kernels import FineMesh
from meshtide_codec.connectivity.level_kernels import Level
from meshtide_codec.connectivity.models import adopt, copied, is_deep
from meshtide_codec.connectivity.tables import new_models
from meshtide_codec.connectivity.traversal_kernels import find_witnesses, traverse
from meshtide_codec.connectivity.truth_kernels import build_truth, empty_truth, survey
from meshtide_codec.entropy.range_coder_kernels import code_raw_bits
from meshtide_codec.errors import MapConnError, MeshError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.choice_kernels import Models
    from meshtide_codec.connectivity.coarse_kernels import CoarseMesh
    from meshtide_codec.connectivity.truth_kernels import Truth
    from meshtide_codec.entropy.codec import PayloadReader, PayloadWriter
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

    Integers = NDArray[np.integer]

NOTHING = np.zeros(1, np.int32)

REASONS = {
    coarse_kernels.TOO_MANY_FACES: "more faces are copied from the coarser level than were announced",
    decision_kernels.NO_SUCH_CANDIDATE: "a face names a candidate that is not in the list",
    level_kernels.NOT_CLOSED: "a gate has no candidate in a level announced as closed",
    level_kernels.NOT_CLEAN: "faces are missing after the last gate of a level announced as clean",
    level_kernels.NO_SUCH_VERTEX: "a face names a vertex outside of the level, or one vertex twice",
    level_kernels.TOO_FEW_FACES: "there are fewer faces than announced",
}


def write_faces(
    writer: PayloadWriter,
    fine_faces: Integers,
    parents: Integers,
    coarse_faces: Integers,
    coarse_count: int,
    positions: Integers | None = None,
    models: Models | None = None,
) -> None:
    """Add the faces of a level, given the level that it collapses to, to a payload that may hold more.

    Args:
        writer: of the payload; nothing is added if there are no faces.
        fine_faces: (m, 3), distinct oriented triangles with three different corners each, in any order.
        parents: (n,), coarse vertex of each fine vertex; never falls, and leaves out no coarse vertex.
        coarse_faces: (k, 3), what the fine faces become under `parents`, without degenerate and repeated ones.
        coarse_count: number of coarse vertices. The coarsest level of all is coded with coarse_count 1.
        positions: (n, 3) integers, positions known to the decoder before the faces are; None if there are none.
        models: those to start from and to teach; fresh ones if None.

    Raises:
        MeshError: an argument breaks these rules, or the models are deep ones and there are no positions.
    """
    models = models or new_models(geometric=positions is not None)
    problem = _problem(parents, coarse_faces, coarse_count, positions, models)
    if problem is None and not _valid_indices(fine_faces, len(parents)):
        problem = "the fine faces must be an (m, 3) array of fine vertices"
    if problem is not None:
        raise MeshError(f"connectivity cannot be coded: {problem}")
    if len(fine_faces) == 0:
        return
    fine_parents = np.ascontiguousarray(parents, np.int32)
    coarse = build_coarse_mesh(fine_parents, np.ascontiguousarray(coarse_faces, np.int32), coarse_count)
    truth = build_truth(np.ascontiguousarray(fine_faces, np.int32), len(parents))
    distinct, closed, clean = survey(truth)
    if not distinct:
        raise MeshError("connectivity cannot be coded: a face is given twice")
    if len(parents) == coarse_count:
        closed = clean = True  # nothing splits: all faces are copied, and nothing is announced wrongly
    while True:
        status = _write_as(closed, clean, writer, models, coarse, truth, fine_parents, positions)
        if status == level_kernels.DONE:
            return
        if status == level_kernels.NOT_CLOSED and closed:
            closed = False
        elif status == level_kernels.NOT_CLEAN and clean:
            clean = False
        else:
            raise MeshError(
                "connectivity cannot be coded: a fine face has a repeated corner, "
                "or the coarse faces are not what the fine ones collapse to"
            )


def _write_as(
    closed: bool,
    clean: bool,
    writer: PayloadWriter,
    models: Models,
    coarse: CoarseMesh,
    truth: Truth,
    parents: NDArray[np.int32],
    positions: Integers | None,
) -> int:
    """Write a level announced as closed or clean or not; returns the status that says whether it was true.

    Nothing has been written or learnt if it was not.
    """
    before = writer.mark()
    witnesses = find_witnesses(truth.faces, parents, coarse)
    learnt = models

    def write(coder: Coder, buffer: Buffer) -> int:
        nonlocal learnt
        learnt = copied(models)
        level = new_level(coarse, truth, parents, len(truth.faces), positions)
        level = level._replace(encoding=True, closed=closed, clean=clean, deep=is_deep(models))
        code_raw_bits(coder, buffer, 2, 2 * closed + clean)
        return int(traverse(coder, buffer, learnt, level, witnesses))

    status = writer.write(write, len(truth.faces))
    if status == level_kernels.DONE:
        adopt(models, learnt)
    else:
        writer.go_back(before)
    return status


def read_faces(
    reader: PayloadReader,
    parents: Integers,
    coarse_faces: Integers,
    coarse_count: int,
    face_count: int,
    positions: Integers | None = None,
    models: Models | None = None,
) -> NDArray[np.int32]:
    """The faces that `write_faces` added, (m, 3) int32, smallest corner first, in lexicographic order.

    `face_count` must have been checked against limits: memory is taken in proportion to it. The other arguments are
    those of `write_faces`. The models learn, unless the payload is damaged.

    Raises:
        MapConnError: the payload is damaged or does not belong to these arguments, or they are out of their rules.
    """
    models = models or new_models(geometric=positions is not None)
    problem = _problem(parents, coarse_faces, coarse_count, positions, models)
    if problem is not None:
        raise MapConnError(f"connectivity cannot be decoded: {problem}")
    if face_count == 0:
        return np.zeros((0, 3), np.int32)
    fine_parents = np.ascontiguousarray(parents, np.int32)
    coarse = build_coarse_mesh(fine_parents, np.ascontiguousarray(coarse_faces, np.int32), coarse_count)
    flags = code_raw_bits(reader.coder, reader.buffer, 2, 0)
    level = new_level(coarse, empty_truth(), fine_parents, face_count, positions)
    level = level._replace(closed=flags >= 2, clean=flags % 2 == 1, deep=is_deep(models))
    learnt = copied(models)
    status = traverse(reader.coder, reader.buffer, learnt, level, NOTHING)
    if status != level_kernels.DONE:
        raise MapConnError(f"{REASONS[status]}; the stream is damaged", offset=reader.offset)
    triangles = level.fine.triangles
    del level, coarse  # sorting needs room
    faces = sorted_faces(triangles, len(parents))
    if np.any(np.all(faces[1:] == faces[:-1], axis=1)):
        raise MapConnError("a face appears twice; the stream is damaged", offset=reader.offset)
    adopt(models, learnt)
    return faces


def _problem(
    parents: Integers, coarse_faces: Integers, coarse_count: int, positions: Integers | None, models: Models
) -> str | None:
    """What is wrong with the arguments that encoder and decoder share, or None."""
    if parents.ndim != 1 or len(parents) < coarse_count or coarse_count < 1:
        return f"{len(parents)} fine vertices cannot collapse to {coarse_count} coarse ones"
    steps = np.diff(parents)
    if parents[0] != 0 or parents[-1] != coarse_count - 1 or np.any(steps < 0) or np.any(steps > 1):
        return "the parents must rise from 0 to the last coarse vertex without gaps"
    if not _valid_indices(coarse_faces, coarse_count):
        return "the coarse faces must be a (k, 3) array of coarse vertices"
    if positions is not None and positions.shape != (len(parents), 3):
        return f"positions have the shape {positions.shape} instead of {(len(parents), 3)}"
    if positions is None and is_deep(models):
        return "deep models need positions"
    return None


def _valid_indices(faces: Integers, count: int) -> bool:
    if faces.ndim != 2 or faces.shape[1] != 3:
        return False
    return len(faces) == 0 or (int(faces.min()) >= 0 and int(faces.max()) < count)


def new_level(
    coarse: CoarseMesh,
    truth: Truth,
    parents: NDArray[np.int32],
    face_count: int,
    positions: Integers | None,
) -> Level:
    """The state at the start of a traversal, for a decoder."""
    vertices = np.zeros((len(parents), half_edge_kernels.VERTEX_COLUMNS), np.int32)
    vertices[:, half_edge_kernels.HEAD] = half_edge_kernels.NONE
    if positions is not None:
        vertices[:, half_edge_kernels.X : half_edge_kernels.X + 3] = positions
    triangles = np.empty((face_count, half_edge_kernels.TRIANGLE_COLUMNS), np.int32)
    return Level(
        coarse=coarse._replace(covered=coarse.covered.copy()),
        fine=FineMesh(parents, triangles, vertices),
        truth=truth._replace(done=np.zeros_like(truth.done), waiting=np.arange(len(truth.waiting), dtype=np.int32)),
        candidates=new_candidates(len(coarse.activity)),
        progress=np.zeros(level_kernels.PROGRESS_SIZE, np.int64),
        corners=np.zeros(3, np.int64),
        encoding=False,
        closed=False,
        clean=False,
        geometric=positions is not None,
        deep=False,
    )
