"""How candidates are weighed and asked for: by a few contexts, or, where faces are coded deeply, by many.

The traversal is the same for both; this is where they part. Scores and questions of effort default are in
`score_kernels` and `decision_kernels`, those of effort high in `score_deep_kernels` and `decision_deep_kernels`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from meshtide_codec.compilation import merged_kernel
from meshtide_codec.connectivity.candidate_kernels import STATES
from meshtide_codec.connectivity.decision_deep_kernels import code_choice_deeply, code_gate_has_face_deeply
from meshtide_codec.connectivity.decision_kernels import code_choice, code_gate_has_face
from meshtide_codec.connectivity.score_deep_kernels import learn_choice, weigh_candidates
from meshtide_codec.connectivity.score_kernels import learn_scores, score_candidates

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.decision_deep_kernels import Questions
    from meshtide_codec.connectivity.level_kernels import Level
    from meshtide_codec.connectivity.score_deep_kernels import Scores
    from meshtide_codec.entropy.mixing_kernels import Weights
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder


class Models(NamedTuple):
    """What the coder expects.

    Attributes:
        contexts: (decision_kernels.CONTEXTS,) int32, adaptive contexts.
        scores: (score_kernels.SCORES,) int32, trained scores of candidates.
        weights: (2 * decision_kernels.PAIRS,) int32, of the two contexts of each sort of decision.
        table: scores of effort high; nothing unless `Level.deep`.
        questions: contexts and neurons of effort high; nothing unless `Level.deep`.
    """

    contexts: Contexts
    scores: NDArray[np.int32]
    weights: Weights
    table: Scores
    questions: Questions


@merged_kernel
def weigh(models: Models, level: Level, count: int, first: int, second: int, known_apex: int) -> tuple[int, int]:
    """Fill the weights of the listed candidates; returns the row of the best one and the sum of all weights."""
    if level.deep:
        return weigh_candidates(models.table, level, count, first, second, known_apex)
    vertices = level.fine.vertices
    return score_candidates(
        models.scores, level.geometric, level.candidates, count, vertices, first, second, known_apex
    )


@merged_kernel
def learn(
    models: Models, level: Level, count: int, first: int, second: int, known_apex: int, chosen: int, total: int
) -> None:
    """Let the scores learn which candidate was chosen."""
    if level.deep:
        learn_choice(models.table, level, count, chosen, total)
    else:
        vertices = level.fine.vertices
        learn_scores(
            models.scores,
            level.geometric,
            level.candidates,
            count,
            vertices,
            first,
            second,
            known_apex,
            chosen,
            total,
        )


@merged_kernel
def code_apex(
    coder: Coder, buffer: Buffer, models: Models, level: Level, stage: int, count: int, best: int, total: int
) -> int:
    """Code which of the weighed candidates is the apex; returns its row, or NO_SUCH_CANDIDATE."""
    if level.deep:
        return code_choice_deeply(
            coder, buffer, models.questions, models.table, stage, level.candidates, count, best, total
        )
    return code_choice(coder, buffer, models.contexts, models.weights, stage, level.candidates, count, best, total)


@merged_kernel
def code_has_face(
    coder: Coder,
    buffer: Buffer,
    models: Models,
    level: Level,
    surroundings: tuple[bool, int, int, int],
    count: int,
    best: int,
    total: int,
    has_face: int,
) -> int:
    """Code whether one of the weighed candidates completes a face at a gate."""
    if level.deep:
        return code_gate_has_face_deeply(
            coder,
            buffer,
            models.questions,
            models.table,
            surroundings,
            level.candidates,
            count,
            best,
            total,
            has_face,
        )
    closed = int(level.candidates.corner[best]) // STATES
    return code_gate_has_face(
        coder, buffer, models.contexts, models.weights, surroundings, count, closed, total, has_face
    )
