"""The trained tables: what the coder expects before it knows anything about the mesh at hand.

Two files, without and with positions, made by tools/train_connectivity.py: scores of candidates, and for each context
how probable a one was in training and how often it was asked. They are part of the format: other tables, other streams.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.connectivity.decision_kernels import PAIRS, Models
from meshtide_codec.connectivity.mixing_kernels import FIRST_WEIGHT

if TYPE_CHECKING:
    from numpy.typing import NDArray

PRIOR_LIMIT = 8  # a context starts with at most this count, so that it still learns fast


def new_models(*, geometric: bool) -> Models:
    """Models for one level, as the training left them; the caller may change them."""
    scores, contexts = _trained(geometric=geometric)
    return Models(contexts.copy(), scores.copy(), new_pair_weights())


def table_path(*, geometric: bool) -> Path:
    """Where the table of a mode lies."""
    return Path(__file__).parent / "tables" / ("with_positions.npz" if geometric else "without_positions.npz")


def new_pair_weights() -> NDArray[np.int32]:
    """Equal weights for the two contexts of every sort of decision."""
    return np.full(2 * PAIRS, FIRST_WEIGHT, np.int32)


@cache
def _trained(*, geometric: bool) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Scores and contexts of one mode."""
    with np.load(table_path(geometric=geometric)) as table:
        scores = table["scores"].astype(np.int32)
        probabilities = table["probabilities"].astype(np.int32)
        counts = np.minimum(table["counts"].astype(np.int32), PRIOR_LIMIT)
    return scores, probabilities << 8 | counts
