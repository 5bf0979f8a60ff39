"""The adaptive states of the Map coder and of the Diff coder: contexts and mixer weights.

Streams begin from trained states, which spare small meshes and early packets the time to learn. The states are part
of the format: `geometry_states.npz` holds for each context its probability (16 bits) and count, and the weights;
`deep_states.npz` the same for effort high. `tools/train_geometry.py` and `tools/train_deep.py` make the files.
"""

from __future__ import annotations

import dataclasses
import functools
from importlib import resources
from typing import TYPE_CHECKING, Self, TypeVar

import numpy as np

from meshtide_codec.compact import diff_deep_context_kernels, diff_kernels, map_deep_layout, map_layout
from meshtide_codec.entropy.deep_mixing_kernels import new_corrections, new_deep_weights
from meshtide_codec.entropy.mixing_kernels import new_weights
from meshtide_codec.entropy.model_kernels import new_contexts

if TYPE_CHECKING:
    from meshtide_codec.entropy.deep_mixing_kernels import Corrections, Mixer
    from meshtide_codec.entropy.mixing_kernels import Weights
    from meshtide_codec.entropy.model_kernels import Contexts

STATES_FILE = "geometry_states.npz"
DEEP_STATES_FILE = "deep_states.npz"

UNTRAINED_TRUST = 1.4
"""Sum of an untrained neuron's weights: contexts that agree are more certain together than each alone."""


@dataclasses.dataclass
class Models:
    """Contexts (one int32 each) and mixer weights; what a packet's coder starts from and leaves behind."""

    contexts: Contexts
    weights: Weights

    def copy(self) -> Self:
        """An independent copy, so that a damaged packet does not spoil the states before it."""
        return dataclasses.replace(self, **{name: array.copy() for name, array in vars(self).items()})

    def adopt(self, other: Self) -> None:
        """Go on from `other`'s states."""
        vars(self).update(vars(other))


@dataclasses.dataclass
class DeepModels(Models):
    """The same for deep mixing: contexts (slow, then fast), weights, final weights and corrections, all int32."""

    final_weights: Weights
    corrections: Corrections

    @property
    def mixer(self) -> Mixer:
        """What `code_deep_bit` takes."""
        return self.contexts, self.weights, self.final_weights, self.corrections


def new_map_models() -> Models:
    """States for the first Map of a stream."""
    return _trained("map").copy()


def trained_diff_models() -> Models:
    """States for the first Diff of a slice: shared by all slices, so not to be changed."""
    return _trained("diff")


def new_deep_map_models() -> DeepModels:
    """States for the first Map of a stream at effort high."""
    return _trained_deeply("map").copy()


def trained_deep_diff_models() -> DeepModels:
    """The same at effort high."""
    return _trained_deeply("diff")


def untrained_map_models() -> Models:
    """Even chances and equal weights for the Map coder: where training begins."""
    return Models(new_contexts(map_layout.CONTEXTS), new_weights(map_layout.NEURONS, UNTRAINED_TRUST))


def untrained_diff_models() -> Models:
    """Even chances and equal weights for the Diff coder: where training begins."""
    return Models(new_contexts(diff_kernels.CONTEXTS), new_weights(diff_kernels.NEURONS, UNTRAINED_TRUST))


def untrained_deep_map_models() -> DeepModels:
    """Even chances and equal weights for the Map coder at effort high: where training begins."""
    layout = map_deep_layout
    return DeepModels(
        new_contexts(2 * layout.CONTEXTS),
        new_deep_weights(layout.NEURONS, layout.INPUTS, 2 * layout.HEARD_CONTEXTS, UNTRAINED_TRUST),
        new_deep_weights(layout.FINALS, layout.CHOICES, layout.CHOICES, 1.0),
        new_corrections(layout.CORRECTIONS),
    )


def untrained_deep_diff_models() -> DeepModels:
    """Even chances and equal weights for the Diff coder at effort high: where training begins."""
    layout = diff_deep_context_kernels
    return DeepModels(
        new_contexts(2 * layout.CONTEXTS),
        new_deep_weights(layout.NEURONS, layout.INPUTS, 2 * layout.HEARD_CONTEXTS, UNTRAINED_TRUST),
        new_deep_weights(layout.FINALS, layout.CHOICES, layout.CHOICES, 1.0),
        new_corrections(layout.CORRECTIONS),
    )


AnyModels = TypeVar("AnyModels", bound=Models)


@functools.cache
def _trained(coder: str) -> Models:
    """The trained states of one of the coders, from the package's data."""
    with (resources.files("meshtide_codec.compact") / STATES_FILE).open("rb") as file, np.load(file) as states:
        probabilities = states[f"{coder}_probabilities"].astype(np.int32)
        counts = states[f"{coder}_counts"].astype(np.int32)
        weights = states[f"{coder}_weights"].astype(np.int32)
    return _frozen(Models((probabilities << 8) | counts, weights))


@functools.cache
def _trained_deeply(coder: str) -> DeepModels:
    """The trained states of one of the coders at effort high, from the package's data."""
    with (resources.files("meshtide_codec.compact") / DEEP_STATES_FILE).open("rb") as file, np.load(file) as states:
        probabilities = states[f"{coder}_probabilities"].astype(np.int32)
        counts = states[f"{coder}_counts"].astype(np.int32)
        weights, final_weights, corrections = (
            states[f"{coder}_{name}"].astype(np.int32) for name in ("weights", "final_weights", "corrections")
        )
    return _frozen(DeepModels((probabilities << 8) | counts, weights, final_weights, corrections))


def _frozen(models: AnyModels) -> AnyModels:
    """The models, whose arrays no one can change; those of copies can be."""
    for array in vars(models).values():
        array.flags.writeable = False
    return models
