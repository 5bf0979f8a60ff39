"""Which inputs and neurons a decision of the Diff is mixed from at effort high (docs/format.md, section 8.5.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.class_tables import SaturatingClasses
from meshtide_codec.reference.diff_contexts import FOUR, SIXTEEN, TWELVE, ahead_and_behind, contexts_for, sign_of

if TYPE_CHECKING:
    from meshtide_codec.reference.diff_contexts import Input
    from meshtide_codec.reference.diff_deep_prediction import DeepPrediction

# Where each block of contexts begins.
QUADRIC = 14528
ALIGNED_RING = QUADRIC + 24 * 4 * 24
PAIRS = ALIGNED_RING + 9 * 16 * 8
FAR = PAIRS + 16 * 8 * 4 * 4
PAIRS_AND_RING = FAR + 5 * 5 * 9 * 4
ACROSS_AND_QUADRIC = PAIRS_AND_RING + 12 * 9 * 8 * 8

# Where each set of neurons begins.
BY_ORDER = 0
BY_ERROR = BY_ORDER + 3 * 8 * 3
BY_ALIGNMENT = BY_ERROR + 24 * 4
BY_TRUST = BY_ALIGNMENT + 9 * 9
BY_SURFACE = BY_TRUST + 8 * 8
BY_PAIRS = BY_SURFACE + 24 * 4
BY_VALENCE = BY_PAIRS + 8 * 8
BY_FAR = BY_VALENCE + 16 * 3

INPUTS = 4 * 12 + 8
TWENTY_FOUR = SaturatingClasses(24, 2)


def deep_contexts_for(
    predicted: DeepPrediction, axis: int, plane: float, quadric: float, mirror_axis: int
) -> list[Input]:
    """The twelve contexts of the decision along an axis, and their signs."""
    ring, across, pairs = predicted.ring, predicted.across, predicted.pairs
    ring_at, across_at, pairs_at = ring.offset[axis], across.offset[axis], pairs.offset[axis]
    steepness = int(abs(predicted.surface[axis]) * 3.999)
    to_ring, to_pairs, to_across = sign_of(ring_at), sign_of(pairs_at), sign_of(across_at)
    place = (TWENTY_FOUR(quadric) * 4 + steepness) * 24 + predicted.quadric_class
    aligned = (_alignment(predicted, axis, to_ring) * 16 + SIXTEEN(ring_at)) * 8 + ring.trust
    paired = ((SIXTEEN(pairs_at) * 8 + pairs.trust) * 4 + steepness) * 4 + predicted.known_class
    ringed = (TWELVE(pairs_at) * 9 + _signed_class(ring_at * to_pairs)) * 8 + predicted.age
    over = (SIXTEEN(across_at) * 9 + _signed_class(quadric * to_across)) * 9 + _signed_class(pairs_at * to_across)
    return [
        *contexts_for(predicted, axis, plane, mirror_axis),
        (QUADRIC + place, sign_of(quadric)),
        (ALIGNED_RING + aligned, to_ring),
        (PAIRS + paired, to_pairs),
        _far(predicted, axis, quadric),
        (PAIRS_AND_RING + ringed * 8 + predicted.midpoint.trust, to_pairs),
        (ACROSS_AND_QUADRIC + over, to_across),
    ]


def numbers_for(predicted: DeepPrediction, axis: int, plane: float, quadric: float) -> list[int]:
    """The eight plain inputs."""
    offsets = [
        quadric,
        plane,
        predicted.mean[axis],
        predicted.smoothed[axis],
        predicted.ring.offset[axis],
        predicted.midpoint.offset[axis],
        predicted.across.offset[axis],
        predicted.pairs.offset[axis],
    ]
    return [min(max(int(offset * 256.0), -2047), 2047) for offset in offsets]


def neurons_for(predicted: DeepPrediction, order: int, axis: int) -> list[int]:
    """The eight neurons of the decision along an axis, the `order`-th of the vertex."""
    state = predicted.mirror_state
    trust = 0 if state == 0 else (2 if state >= 7 else 1)
    steepness = int(abs(predicted.surface[axis]) * 3.999)
    far_below, far_above = min(predicted.far_below[axis], 4), min(predicted.far_above[axis], 4)
    return [
        BY_ORDER + (order * 8 + predicted.age) * 3 + trust,
        BY_ERROR + predicted.error_class * 4 + predicted.known_class,
        BY_ALIGNMENT + state * 9 + _alignment(predicted, axis, 1),
        BY_TRUST + predicted.ring.trust * 8 + predicted.midpoint.trust,
        BY_SURFACE + predicted.quadric_class * 4 + steepness,
        BY_PAIRS + predicted.pairs.trust * 8 + predicted.across.trust,
        BY_VALENCE + predicted.valence * 3 + order,
        BY_FAR + (far_below * 5 + far_above) * 3 + order,
    ]


def _far(predicted: DeepPrediction, axis: int, quadric: float) -> Input:
    below, above = predicted.far_below[axis], predicted.far_above[axis]
    sign = 1 if above > below or (above == below and quadric >= 0.0) else -1
    place = (min(max(above, below), 4) * 5 + min(above, below, 4)) * 9 + _alignment(predicted, axis, sign)
    return FAR + place * 4 + (FOUR(quadric) if quadric * sign > 0.0 else 0), sign


def _alignment(predicted: DeepPrediction, axis: int, sign: int) -> int:
    ahead, behind = ahead_and_behind(predicted, axis, sign)
    return min(ahead, 2) * 3 + min(behind, 2)


def _signed_class(value: float) -> int:
    return 4 + sign_of(value) * (TWELVE(value) * 4 // 11)
