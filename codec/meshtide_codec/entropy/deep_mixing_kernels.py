"""Deep mixing, for effort high: contexts at two speeds and plain numbers, several neurons, one that judges them.

Like `mixing_kernels`, with more of everything. Each context is kept twice, learning fast and slowly, and each is heard
twice: as a stretched probability and as a plain one (as M. Mahoney's paq8 does). Plain numbers of the coder's own are
inputs too. Several neurons, each chosen by a class of its own, mix the same inputs and learn from their own errors;
a final neuron mixes what they say. What it says is corrected by what has followed similar statements (secondary
estimation, after PAQ7). Integers throughout. Cost: O(inputs * neurons) per decision.

Probabilities, stretched probabilities and contexts are those of `mixing_kernels`; a weight of 1 is WEIGHT_ONE.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import borrowing_kernel
from meshtide_codec.entropy.mixing_kernels import SQUASH, STRETCH, STRETCH_LIMIT, teach
from meshtide_codec.entropy.model_kernels import COUNT_LIMIT
from meshtide_codec.entropy.range_coder_kernels import code_bit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.entropy.mixing_kernels import Opinions, Weights
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

    Corrections = NDArray[np.int32]
    Inputs = NDArray[np.int32]
    Mixer = tuple[Contexts, Weights, Weights, Corrections]
    """All that learns: contexts (the slow ones, then as many fast ones), weights of the neurons, weights of the final
    neurons, corrections; each flat, one behind the other."""

SLOW_LIMIT = COUNT_LIMIT  # caps of the contexts' counts
FAST_LIMIT = 12
HEARD = 4  # inputs that each context makes

WEIGHT_BITS = 16
WEIGHT_ONE = 1 << WEIGHT_BITS
WEIGHT_LIMIT = 8 * WEIGHT_ONE  # weights are kept within +-8
FINAL_RATE = 19  # final weights move by input * error, shifted right by so much
NUMBER_LIMIT = STRETCH_LIMIT  # plain numbers are kept within +-2047, as stretched probabilities are
_LINEAR_SHIFT = 5  # from a 16-bit probability less one half to an input

CORRECTION_STEPS = 33  # entries of a correction: stretched probabilities -2048, -1920, ..., 2048
_STEP_BITS = 7
_FRACTION_BITS = 6  # corrections have so many bits more than a probability
_CORRECTION_RATE = 6
_HALF_STEP = 1 << (_STEP_BITS - 1)


def new_deep_weights(neurons: int, inputs: int, opinions: int, total: float) -> Weights:
    """Equal weights that sum to `total` for the first `opinions` of each neuron's inputs, none for the others.

    >>> new_deep_weights(2, 3, 2, 1.0).tolist()
    [32768, 32768, 0, 32768, 32768, 0]
    """
    weights = np.zeros((neurons, inputs), np.int32)
    weights[:, :opinions] = int(WEIGHT_ONE * total / opinions)
    return weights.reshape(-1)


def new_corrections(classes: int) -> Corrections:
    """Corrections that change nothing yet.

    >>> (new_corrections(1)[[0, 16, 32]] >> 6).tolist()
    [48, 32768, 65488]
    """
    steps = (np.arange(CORRECTION_STEPS) - CORRECTION_STEPS // 2) << _STEP_BITS
    steps = np.clip(steps, -STRETCH_LIMIT, STRETCH_LIMIT)
    return np.tile(SQUASH[steps + STRETCH_LIMIT + 1] << _FRACTION_BITS, classes).astype(np.int32)


@borrowing_kernel
def code_deep_bit(
    coder: Coder,
    buffer: Buffer,
    mixer: Mixer,
    neurons: Opinions,
    final: int,
    correction: int,
    places: Opinions,
    signs: Opinions,
    inputs: Inputs,
    outputs: Inputs,
    rate: int,
    bit: int,
) -> int:
    """Code one decision; all of the mixer that took part learns from it.

    `places` and `signs` are those of the slow contexts. `inputs` holds the plain numbers behind HEARD * len(places)
    inputs, which are filled in here; `outputs` (len(neurons),) is scratch. `neurons` are the chosen neurons, `final`
    the final one, `correction` the class of the correction;
    `rate` slows the neurons' learning, as in `mixing_kernels`.
    """
    contexts, weights, final_weights, corrections = mixer
    fast = len(contexts) >> 1
    _hear_contexts(contexts, fast, places, signs, inputs)
    last = final * len(neurons)
    total = 0
    for index in range(len(neurons)):
        said = _sum_of_products(weights, neurons[index] * len(inputs), inputs) >> WEIGHT_BITS
        outputs[index] = min(max(said, -STRETCH_LIMIT), STRETCH_LIMIT)
        total += np.int64(final_weights[np.uintp(last + index)]) * outputs[index]
    stretched = min(max(total >> WEIGHT_BITS, -STRETCH_LIMIT), STRETCH_LIMIT)
    mixed = int(SQUASH[np.uintp(stretched + STRETCH_LIMIT + 1)])
    shifted = stretched + ((CORRECTION_STEPS // 2) << _STEP_BITS)
    part = shifted & ((1 << _STEP_BITS) - 1)
    lower = correction * CORRECTION_STEPS + (shifted >> _STEP_BITS)
    between = np.int64(corrections[np.uintp(lower)]) * ((1 << _STEP_BITS) - part)
    between += np.int64(corrections[np.uintp(lower + 1)]) * part
    corrected = between >> (_STEP_BITS + _FRACTION_BITS)
    bit = code_bit(coder, buffer, (mixed + corrected) >> 1, bit)

    nearer = np.uintp(lower + (1 if part >= _HALF_STEP else 0))
    target = (65535 << _FRACTION_BITS) if bit else 0
    corrections[nearer] += (target - corrections[nearer]) >> _CORRECTION_RATE
    error = (bit << 16) - mixed
    for index in range(len(neurons)):
        own_error = (bit << 16) - int(SQUASH[np.uintp(outputs[index] + STRETCH_LIMIT + 1)])
        _move_weight(final_weights, last + index, outputs[index], error, FINAL_RATE)
        for place in range(len(inputs)):
            _move_weight(weights, neurons[index] * len(inputs) + place, inputs[place], own_error, rate)
    for index in range(len(places)):
        teach(contexts, places[index], signs[index], SLOW_LIMIT, bit)
        teach(contexts, places[index] + fast, signs[index], FAST_LIMIT, bit)
    return bit


@borrowing_kernel
def _hear_contexts(contexts: Contexts, fast: int, places: Opinions, signs: Opinions, inputs: Inputs) -> None:
    """Fill the inputs that come from contexts: slow and fast ones stretched, then slow and fast ones plain."""
    count = len(places)
    for index in range(count):
        slow_context = contexts[np.uintp(places[index])]
        fast_context = contexts[np.uintp(places[index] + fast)]
        inputs[index] = STRETCH[np.uintp(slow_context >> 12)] * signs[index]
        inputs[count + index] = STRETCH[np.uintp(fast_context >> 12)] * signs[index]
        inputs[2 * count + index] = (((slow_context >> 8) - 32768) * signs[index]) >> _LINEAR_SHIFT
        inputs[3 * count + index] = (((fast_context >> 8) - 32768) * signs[index]) >> _LINEAR_SHIFT


@borrowing_kernel
def _sum_of_products(weights: Weights, first: int, inputs: Inputs) -> int:
    total = 0
    for place in range(len(inputs)):
        total += np.int64(weights[np.uintp(first + place)]) * inputs[place]
    return total


@borrowing_kernel
def _move_weight(weights: Weights, place: int, value: int, error: int, rate: int) -> None:
    """Move a weight by an input times the error."""
    weight = weights[np.uintp(place)] + ((value * error + (1 << (rate - 1))) >> rate)
    weights[np.uintp(place)] = min(max(weight, -WEIGHT_LIMIT), WEIGHT_LIMIT)
