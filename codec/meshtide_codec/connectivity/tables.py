"""The trained tables: what score a candidate gets before anything is known about the mesh at hand."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.connectivity.decision_kernels import CONTEXTS, Models
from meshtide_codec.connectivity.score_kernels import (
    CLOSINGS,
    KIND_SCORES,
    SCORES,
    STATES,
)
from meshtide_codec.entropy.model_kernels import new_contexts

if TYPE_CHECKING:
    from numpy.typing import NDArray


def new_models(*, geometric: bool) -> Models:
    """Fresh models for one level."""
    return Models(new_contexts(CONTEXTS), _scores(geometric=geometric))


@cache
def _scores(*, geometric: bool) -> NDArray[np.int32]:
    scores = np.zeros(SCORES, np.int32)
    for kind in range(6):
        for closed in range(CLOSINGS):
            for state in range(STATES):
                scores[KIND_SCORES + (kind * CLOSINGS + closed) * STATES + state] = (
                    (300 * closed if closed < 3 else -300)
                    - (400 if kind == 1 else 0)
                    - (200 if kind > 1 else 0)
                    - (600 if kind == 5 else 0)
                )
    return scores
