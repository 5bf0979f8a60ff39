"""The states that coders begin with: the table files that are part of the format (docs/format.md, section 10)."""

from __future__ import annotations

import functools
from importlib import resources

import numpy as np

from meshtide_codec.reference.deep_mixing import DeepNeurons
from meshtide_codec.reference.mixing import Neurons
from meshtide_codec.reference.models import Contexts

GEOMETRY_INPUTS = 6
PRIOR_LIMIT = 8
PAIRS = 14
FIRST_PAIR_WEIGHT = 9216
DEEP_FACE_RATE = 18
DEEP_PRIOR_LIMIT = 20
FAST_PRIOR_LIMIT = 12
PACKAGE = resources.files("meshtide_codec")


def geometry_neurons(coder: str) -> Neurons:
    """A fresh copy of the trained contexts and weights of the coder "map" or "diff"."""
    tables = _tables("compact/geometry_states.npz")
    contexts = Contexts(tables[f"{coder}_probabilities"], tables[f"{coder}_counts"])
    return Neurons(contexts, tables[f"{coder}_weights"], GEOMETRY_INPUTS)


def deep_neurons(coder: str, inputs: int, rate: int) -> DeepNeurons:
    """A fresh copy of all that the coder "map" or "diff" learns at effort high, with the inputs of a neuron."""
    tables = _tables("compact/deep_states.npz")
    contexts = Contexts(tables[f"{coder}_probabilities"], tables[f"{coder}_counts"])
    weights, final_weights, corrections = (
        tables[f"{coder}_{name}"] for name in ("weights", "final_weights", "corrections")
    )
    return DeepNeurons(contexts, weights, final_weights, corrections, inputs, rate)


def connectivity_states(*, geometric: bool) -> tuple[Neurons, list[int]]:
    """Fresh contexts with pairs of weights, and the scores of candidates, with or without positions."""
    tables = _tables(f"connectivity/tables/{'with' if geometric else 'without'}_positions.npz")
    counts = [min(count, PRIOR_LIMIT) for count in tables["counts"]]
    neurons = Neurons(Contexts(tables["probabilities"], counts), [FIRST_PAIR_WEIGHT] * 2 * PAIRS, inputs=2)
    return neurons, list(tables["scores"])


def deep_connectivity_states(inputs: int) -> tuple[list[int], list[int], DeepNeurons]:
    """Scores of candidates, their counts, and what else the coder of faces learns at effort high."""
    tables = _tables("connectivity/tables/deep.npz")
    slow = [min(count, DEEP_PRIOR_LIMIT) for count in tables["counts"]]
    fast = [min(count, FAST_PRIOR_LIMIT) for count in tables["counts"]]
    contexts = Contexts(2 * tables["probabilities"], slow + fast)
    neurons = DeepNeurons(
        contexts, tables["weights"], tables["final_weights"], tables["corrections"], inputs, DEEP_FACE_RATE
    )
    return tables["scores"], [min(count, DEEP_PRIOR_LIMIT) for count in tables["score_counts"]], neurons


@functools.cache
def _tables(path: str) -> dict[str, list[int]]:
    """The arrays of integers of a table file; they must not be changed."""
    with (PACKAGE / path).open("rb") as file, np.load(file) as arrays:
        return {name: array.tolist() for name, array in arrays.items() if array.dtype.kind in "iu"}
