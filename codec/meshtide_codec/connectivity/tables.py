"""The trained tables: what score a candidate gets before anything is known about the mesh at hand."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.connectivity.decision_kernels import CONTEXTS, Models
from meshtide_codec.entropy.model_kernels import new_contexts

if TYPE_CHECKING:
    from numpy.typing import NDArray

PRIOR_LIMIT = 12  # decisions of the training that a fresh context remembers


def new_models(*, geometric: bool) -> Models:
    """Models for one level, as the training left them; scores are shared, contexts are the caller's own."""
    scores, contexts = _trained("geometric" if geometric else "plain")
    return Models(contexts.copy(), scores.copy())


@cache
def _trained(mode: str) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Scores and contexts of one mode."""
    with files(__package__).joinpath("tables", f"{mode}.npz").open("rb") as stream, np.load(stream) as tables:
        scores = tables["scores"].astype(np.int32)
        probabilities = tables["probabilities"].astype(np.int32)
        counts = np.minimum(tables["counts"].astype(np.int32), PRIOR_LIMIT)
    return scores, probabilities << 8 | counts
