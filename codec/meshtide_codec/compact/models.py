"""The adaptive states of the Map coder and of the Diff coder: contexts and mixer weights, fresh or carried along."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from meshtide_codec.compact import diff_kernels, map_kernels
from meshtide_codec.entropy.mixing_kernels import new_weights
from meshtide_codec.entropy.model_kernels import new_contexts

if TYPE_CHECKING:
    from meshtide_codec.entropy.mixing_kernels import Weights
    from meshtide_codec.entropy.model_kernels import Contexts

INITIAL_TRUST = 1.4
"""Sum of a fresh neuron's weights: contexts that agree are more certain together than each alone."""


@dataclasses.dataclass
class Models:
    """Contexts (one int32 each) and mixer weights; what a packet's coder starts from and leaves behind."""

    contexts: Contexts
    weights: Weights

    def copy(self) -> Models:
        """An independent copy, so that a damaged packet does not spoil the states before it."""
        return Models(self.contexts.copy(), self.weights.copy())

    def adopt(self, other: Models) -> None:
        """Go on from `other`'s states."""
        self.contexts = other.contexts
        self.weights = other.weights


def new_map_models() -> Models:
    """States for the first Map of a stream."""
    return Models(new_contexts(map_kernels.CONTEXTS), new_weights(map_kernels.NEURONS, INITIAL_TRUST))


def new_diff_models() -> Models:
    """States for the first Diff of a slice."""
    return Models(new_contexts(diff_kernels.CONTEXTS), new_weights(diff_kernels.NEURONS, INITIAL_TRUST))
