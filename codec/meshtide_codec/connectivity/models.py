"""What the connectivity coder has learnt, as one value that can be made, copied and taken over."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.connectivity import decision_deep_kernels as deep
from meshtide_codec.connectivity.candidate_kernels import CAPACITY
from meshtide_codec.connectivity.choice_kernels import Models
from meshtide_codec.connectivity.decision_deep_kernels import Questions
from meshtide_codec.connectivity.decision_kernels import PAIRS
from meshtide_codec.connectivity.mixing_kernels import FIRST_WEIGHT
from meshtide_codec.connectivity.property_deep_kernels import PLACES, PROPERTIES
from meshtide_codec.connectivity.score_deep_kernels import Scores
from meshtide_codec.entropy.deep_mixing_kernels import WEIGHT_ONE, new_corrections, new_deep_weights
from meshtide_codec.entropy.model_kernels import new_contexts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.entropy.deep_mixing_kernels import Mixer

    Integers = NDArray[np.int32]

UNTRAINED_TRUST = 0.5
"""Sum of an untrained neuron's weights of contexts,"""
UNTRAINED_SHARE = 0.7
"""and its weight of the share that the scores give a candidate."""


def new_pair_weights() -> Integers:
    """Equal weights for the two contexts of every sort of decision."""
    return np.full(2 * PAIRS, FIRST_WEIGHT, np.int32)


def default_models(contexts: Integers, scores: Integers) -> Models:
    """Models of effort default, which keep the arrays given."""
    nothing = np.zeros(0, np.int32)
    no_mixer = (nothing, nothing, nothing, nothing)
    no_places = np.zeros(0, np.int64)
    return Models(
        contexts,
        scores,
        new_pair_weights(),
        Scores(nothing, nothing, np.zeros((0, PROPERTIES), np.int32)),
        Questions(no_mixer, no_places, no_places, nothing, no_places, nothing),
    )


def deep_models(default: Models, scores: Integers, counts: Integers, mixer: Mixer) -> Models:
    """Models of effort high, which keep the arrays given; what is not asked deeply is asked as `default` says."""
    return default._replace(
        table=Scores(scores, counts, np.zeros((CAPACITY, PROPERTIES), np.int32)),
        questions=Questions(
            mixer,
            np.zeros(deep.HEARD_CONTEXTS, np.int64),
            np.ones(deep.HEARD_CONTEXTS, np.int64),
            np.zeros(deep.INPUTS, np.int32),
            np.zeros(deep.CHOSEN_NEURONS, np.int64),
            np.zeros(deep.CHOSEN_NEURONS, np.int32),
        ),
    )


def untrained_deep_models(default: Models) -> Models:
    """Models of effort high that have seen nothing: where training begins."""
    weights = new_deep_weights(deep.NEURONS, deep.INPUTS, 2 * deep.HEARD_CONTEXTS, UNTRAINED_TRUST)
    weights[deep.NUMBERS :: deep.INPUTS] = int(WEIGHT_ONE * UNTRAINED_SHARE)
    mixer = (
        new_contexts(2 * deep.CONTEXTS),
        weights,
        new_deep_weights(deep.FINALS, deep.CHOSEN_NEURONS, deep.CHOSEN_NEURONS, 1.0),
        new_corrections(deep.CORRECTIONS),
    )
    return deep_models(default, np.zeros(PLACES, np.int32), np.zeros(PLACES, np.int32), mixer)


def is_deep(models: Models) -> bool:
    """Whether models are those of effort high."""
    return len(models.table.scores) > 0


def copied(models: Models) -> Models:
    """An independent copy of all that learns."""
    contexts, weights, final_weights, corrections = models.questions.mixer
    mixer = contexts.copy(), weights.copy(), final_weights.copy(), corrections.copy()
    return models._replace(
        contexts=models.contexts.copy(),
        scores=models.scores.copy(),
        weights=models.weights.copy(),
        table=models.table._replace(scores=models.table.scores.copy(), counts=models.table.counts.copy()),
        questions=models.questions._replace(mixer=mixer),
    )


def adopt(models: Models, learnt: Models) -> None:
    """Let `models` go on from what a copy of them has learnt."""
    for array, other in zip(_learning(models), _learning(learnt), strict=True):
        array[:] = other


def _learning(models: Models) -> list[Integers]:
    return [
        models.contexts,
        models.scores,
        models.weights,
        models.table.scores,
        models.table.counts,
        *models.questions.mixer,
    ]
