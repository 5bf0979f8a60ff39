"""What a decision of the Diff is mixed from at effort high: six more contexts, eight plain numbers, eight neurons.

The contexts of effort default come first and unchanged. To them come those of the quadratic surface
(`surface_fit_kernels`), of the midpoints of any two of the ring, of alignment with two rings, and of how these agree.
The plain numbers are the predicted offsets themselves. O(1) per decision.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compact import diff_kernels as default
from meshtide_codec.compact import diff_prediction_kernels as prediction
from meshtide_codec.compact.diff_kernels import table_index, towards
from meshtide_codec.compact.quantizers import saturating_classes
from meshtide_codec.compilation import borrowing_kernel, inlined_kernel
from meshtide_codec.entropy.deep_mixing_kernels import HEARD, NUMBER_LIMIT
from meshtide_codec.entropy.mixing_kernels import INPUTS as DEFAULT_INPUTS

if TYPE_CHECKING:
    from meshtide_codec.compact.diff_prediction_kernels import Classes, Predictions, Rows
    from meshtide_codec.entropy.deep_mixing_kernels import Inputs
    from meshtide_codec.entropy.mixing_kernels import Opinions

# Predicted offsets of the vertex, three coordinates each, behind those of effort default.
QUADRIC = prediction.PREDICTIONS  # where the quadratic surface is nearest to SMOOTHED
SURFACE = QUADRIC + 3  # unit normal of the quadratic surface, or zero
PAIRS = SURFACE + 3  # midpoints of any two members of the ring
PREDICTIONS = PAIRS + 3

# Classes, behind those of effort default.
QUADRIC_CLASS = prediction.CLASSES  # how well the surface fitted the neighbours; 23: there is none
PAIRS_TRUST = QUADRIC_CLASS + 1
AGE = PAIRS_TRUST + 1  # depths since the vertex became a leaf, less 1, at most 7
FAR_BELOW = AGE + 1  # per axis, vertices of two rings at offset -1
FAR_ABOVE = FAR_BELOW + 3  # per axis, vertices of two rings at offset +1
VALENCE = FAR_ABOVE + 3  # members of the ring, at most 15
CLASSES = VALENCE + 1

_QUADRIC = default.CONTEXTS
_ALIGNED_RING = _QUADRIC + 24 * 4 * 24
_PAIRS = _ALIGNED_RING + 9 * 16 * 8
_FAR = _PAIRS + 16 * 8 * 4 * 4
_PAIRS_AND_RING = _FAR + 5 * 5 * 9 * 4
_ACROSS_AND_QUADRIC = _PAIRS_AND_RING + 12 * 9 * 8 * 8
CONTEXTS = _ACROSS_AND_QUADRIC + 16 * 9 * 9

PAIR_LIMIT = 10  # members of the ring that are paired

HEARD_CONTEXTS = DEFAULT_INPUTS + 6
NUMBERS = HEARD * HEARD_CONTEXTS  # where the plain numbers begin among the inputs
INPUTS = NUMBERS + 8

CHOICES = 8  # neurons that mix each decision
_BY_ORDER = 0
_BY_ERROR = _BY_ORDER + 3 * 8 * 3
_BY_ALIGNMENT = _BY_ERROR + prediction.ERROR_CLASSES * 4
_BY_TRUST = _BY_ALIGNMENT + default.MIRROR_STATES * 9
_BY_SURFACE = _BY_TRUST + 8 * 8
_BY_PAIRS = _BY_SURFACE + 24 * 4
_BY_VALENCE = _BY_PAIRS + 8 * 8
_BY_FAR = _BY_VALENCE + 16 * 3
NEURONS = _BY_FAR + 5 * 5 * 3
FINALS = 3 * 8
CORRECTIONS = prediction.ERROR_CLASSES

_FOUR = saturating_classes(4, 2)
_TWELVE = saturating_classes(12, 2)
_SIXTEEN = saturating_classes(16, 2)
_TWENTY_FOUR = saturating_classes(24, 2)


@inlined_kernel
def number(offset: float) -> int:
    """A predicted offset as an input of the mixer."""
    return min(max(int(offset * 256.0), -NUMBER_LIMIT), NUMBER_LIMIT)


@inlined_kernel
def signed_class(value: float) -> int:
    """0..8: classes of |value| on both sides of 4."""
    magnitude = int(_TWELVE[table_index(value)]) * 4 // 11
    return 4 + magnitude if value >= 0.0 else 4 - magnitude


@inlined_kernel
def alignment(classes: Classes, axis: int, sign: int) -> int:
    """0..8 by how many neighbours lie at the coordinate ahead and at the one behind, two at most."""
    below, above = classes[prediction.BELOW + axis], classes[prediction.ABOVE + axis]
    ahead, behind = (above, below) if sign > 0 else (below, above)
    return int(min(ahead, 2) * 3 + min(behind, 2))


@borrowing_kernel
def set_deep_contexts(
    axis: int, quadric: float, predictions: Predictions, classes: Classes, places: Opinions, signs: Opinions
) -> None:
    """Fill `places` and `signs` of the contexts that effort high adds, for the decision along `axis`."""
    ring = predictions[prediction.RING + axis]
    across = predictions[prediction.ACROSS + axis]
    pairs = predictions[PAIRS + axis]
    steepness = int(abs(predictions[SURFACE + axis]) * 3.999)
    first = DEFAULT_INPUTS

    signs[first] = towards(quadric)
    place = _TWENTY_FOUR[table_index(quadric)] * 4 + steepness
    places[first] = _QUADRIC + place * prediction.ERROR_CLASSES + classes[QUADRIC_CLASS]

    sign = towards(ring)
    signs[first + 1] = sign
    place = alignment(classes, axis, sign) * 16 + _SIXTEEN[table_index(ring)]
    places[first + 1] = _ALIGNED_RING + place * 8 + classes[prediction.RING_TRUST]

    sign = towards(pairs)
    signs[first + 2] = sign
    place = (_SIXTEEN[table_index(pairs)] * 8 + classes[PAIRS_TRUST]) * 4 + steepness
    places[first + 2] = _PAIRS + place * 4 + classes[prediction.KNOWN_CLASS]
    signs[first + 4] = sign
    place = (_TWELVE[table_index(pairs)] * 9 + signed_class(ring * sign)) * 8 + classes[AGE]
    places[first + 4] = _PAIRS_AND_RING + place * 8 + classes[prediction.MIDPOINT_TRUST]

    below, above = classes[FAR_BELOW + axis], classes[FAR_ABOVE + axis]
    sign = 1 if above > below or (above == below and quadric >= 0.0) else -1
    signs[first + 3] = sign
    place = (min(max(above, below), 4) * 5 + min(above, below, 4)) * 9 + alignment(classes, axis, sign)
    nearing = _FOUR[table_index(quadric)] if quadric * sign > 0.0 else 0
    places[first + 3] = _FAR + place * 4 + nearing

    sign = towards(across)
    signs[first + 5] = sign
    place = _SIXTEEN[table_index(across)] * 9 + signed_class(quadric * sign)
    places[first + 5] = _ACROSS_AND_QUADRIC + place * 9 + signed_class(pairs * sign)


@borrowing_kernel
def set_numbers(axis: int, plane: float, quadric: float, predictions: Predictions, inputs: Inputs) -> None:
    """Fill the plain numbers of `inputs`."""
    inputs[NUMBERS] = number(quadric)
    inputs[NUMBERS + 1] = number(plane)
    inputs[NUMBERS + 2] = number(predictions[prediction.MEAN + axis])
    inputs[NUMBERS + 3] = number(predictions[prediction.SMOOTHED + axis])
    inputs[NUMBERS + 4] = number(predictions[prediction.RING + axis])
    inputs[NUMBERS + 5] = number(predictions[prediction.MIDPOINT + axis])
    inputs[NUMBERS + 6] = number(predictions[prediction.ACROSS + axis])
    inputs[NUMBERS + 7] = number(predictions[PAIRS + axis])


@borrowing_kernel
def choose_neurons(order: int, axis: int, predictions: Predictions, classes: Classes, neurons: Opinions) -> None:
    """Fill `neurons` for the decision along `axis`, the `order`-th of the vertex."""
    state = classes[prediction.MIRROR_STATE]
    trust = 0 if state == 0 else (2 if state >= default.MIRROR_TRUSTED else 1)
    neurons[0] = _BY_ORDER + (order * 8 + classes[AGE]) * 3 + trust
    neurons[1] = _BY_ERROR + classes[prediction.ERROR_CLASS] * 4 + classes[prediction.KNOWN_CLASS]
    neurons[2] = _BY_ALIGNMENT + state * 9 + alignment(classes, axis, 1)
    neurons[3] = _BY_TRUST + classes[prediction.RING_TRUST] * 8 + classes[prediction.MIDPOINT_TRUST]
    steepness = int(abs(predictions[SURFACE + axis]) * 3.999)
    neurons[4] = _BY_SURFACE + classes[QUADRIC_CLASS] * 4 + steepness
    neurons[5] = _BY_PAIRS + classes[PAIRS_TRUST] * 8 + classes[prediction.ACROSS_TRUST]
    neurons[6] = _BY_VALENCE + classes[VALENCE] * 3 + order
    far_below, far_above = min(classes[FAR_BELOW + axis], 4), min(classes[FAR_ABOVE + axis], 4)
    neurons[7] = _BY_FAR + (far_below * 5 + far_above) * 3 + order


@borrowing_kernel
def guess_pairs(count: int, offsets: Rows, predictions: Predictions, classes: Classes) -> None:
    """Set PAIRS: midpoints of any two of the ring's first members."""
    sum_x = sum_y = sum_z = total = 0.0
    best = prediction.FAR
    count = min(count, PAIR_LIMIT)
    for place in range(count):
        for other in range(place + 1, count):
            x = 0.5 * (offsets[place, 0] + offsets[other, 0])
            y = 0.5 * (offsets[place, 1] + offsets[other, 1])
            z = 0.5 * (offsets[place, 2] + offsets[other, 2])
            distance = prediction.distance_from_agreeing(x, y, z)
            weight = prediction.guess_weight(distance, offsets[place, 3] + offsets[other, 3])
            sum_x += weight * x
            sum_y += weight * y
            sum_z += weight * z
            total += weight
            best = min(best, distance)
    prediction.conclude(predictions, PAIRS, classes, PAIRS_TRUST, sum_x, sum_y, sum_z, total, best)
