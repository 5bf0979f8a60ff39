"""The trained tables: what the coder expects before it knows anything about the mesh at hand.

Two files, without and with positions, made by tools/train_connectivity.py: scores of candidates, and for each context
how probable a one was in training and how often it was asked. A third, made by tools/train_deep_connectivity.py, for
faces that are coded deeply. They are part of the format: other tables, other streams.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.connectivity.models import copied, deep_models, default_models
from meshtide_codec.entropy.deep_mixing_kernels import FAST_LIMIT

if TYPE_CHECKING:
    from meshtide_codec.connectivity.choice_kernels import Models

PRIOR_LIMIT = 8  # a context starts with at most this count, so that it still learns fast


DEEP_PRIOR_LIMIT = 20  # the same for contexts and scores of effort high


def new_models(*, geometric: bool, deep: bool = False) -> Models:
    """Models for one level, or for all levels of a stream if deep, as the training left them; the caller's own.

    Deep models are for levels with positions.
    """
    return copied(_trained_deeply() if deep else _trained(geometric=geometric))


def table_path(*, geometric: bool) -> Path:
    """Where the table of a mode lies."""
    return Path(__file__).parent / "tables" / ("with_positions.npz" if geometric else "without_positions.npz")


def deep_table_path() -> Path:
    """Where the table of effort high lies."""
    return Path(__file__).parent / "tables" / "deep.npz"


@cache
def _trained(*, geometric: bool) -> Models:
    """The models of one mode."""
    with np.load(table_path(geometric=geometric)) as table:
        scores = table["scores"].astype(np.int32)
        probabilities = table["probabilities"].astype(np.int32)
        counts = np.minimum(table["counts"].astype(np.int32), PRIOR_LIMIT)
    return default_models(probabilities << 8 | counts, scores)


@cache
def _trained_deeply() -> Models:
    """The models of effort high."""
    with np.load(deep_table_path()) as table:
        arrays = {name: table[name].astype(np.int32) for name in table.files if name != "meshes"}
    slow = arrays["probabilities"] << 8 | np.minimum(arrays["counts"], DEEP_PRIOR_LIMIT)
    fast = arrays["probabilities"] << 8 | np.minimum(arrays["counts"], FAST_LIMIT)
    mixer = (np.concatenate([slow, fast]), arrays["weights"], arrays["final_weights"], arrays["corrections"])
    score_counts = np.minimum(arrays["score_counts"], DEEP_PRIOR_LIMIT)
    return deep_models(_trained(geometric=True), arrays["scores"], score_counts, mixer)
