"""Which contexts a decision of the Diff is mixed from (docs/format.md, section 8.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.class_tables import SaturatingClasses

if TYPE_CHECKING:
    from meshtide_codec.reference.diff_prediction import Prediction

# Where each block of contexts begins.
PLANE = 0
ALIGNMENT = PLANE + 12 * 12 * 2 * 6
RING = ALIGNMENT + 5 * 4 * 3 * 8
MIDPOINT = RING + 16 * 8 * 4 * 4
ACROSS = MIDPOINT + 16 * 8 * 4 * 4
JOINT = ACROSS + 10 * 8 * 9 * 5
MIRRORED = JOINT + 4 * 4 * 7 * 40

FOUR = SaturatingClasses(4, 2)
EIGHT = SaturatingClasses(8, 2)
TEN = SaturatingClasses(10, 2)
TEN_WIDE = SaturatingClasses(10, 3)
TWELVE = SaturatingClasses(12, 2)
SIXTEEN = SaturatingClasses(16, 2)

Input = tuple[int, int]
"""A context's place, and its sign."""


def contexts_for(predicted: Prediction, axis: int, plane: float, mirror_axis: int) -> list[Input]:
    """The six inputs of the decision along an axis; `plane` is the plane's offset there."""
    steepness = int(abs(predicted.normal[axis]) * 3.999)
    known = predicted.known_class
    ring, midpoint = predicted.ring, predicted.midpoint
    return [
        _plane(predicted, axis, plane),
        _alignment(predicted, axis),
        (
            RING + ((SIXTEEN(ring.offset[axis]) * 8 + ring.trust) * 4 + steepness) * 4 + known,
            sign_of(ring.offset[axis]),
        ),
        (
            MIDPOINT + ((SIXTEEN(midpoint.offset[axis]) * 8 + midpoint.trust) * 4 + steepness) * 4 + known,
            sign_of(midpoint.offset[axis]),
        ),
        _across(predicted, axis, plane),
        _joint(predicted, axis, plane) if predicted.mirror_state == 0 else _mirrored(predicted, axis, mirror_axis),
    ]


def neuron_for(predicted: Prediction) -> int:
    """The neuron for the decisions of a vertex."""
    state = predicted.mirror_state
    trust = 0 if state == 0 else (2 if state >= 7 else 1)  # known, and neighbours mostly agree
    return ((predicted.error_class >> 1) * 4 + predicted.known_class) * 3 + trust


def sign_of(value: float) -> int:
    """+1 when the value is not negative, else -1."""
    return 1 if value >= 0.0 else -1


def _plane(predicted: Prediction, axis: int, plane: float) -> Input:
    alike = int(plane * predicted.mean[axis] > 0.0)
    place = (TWELVE(plane) * 12 + TEN_WIDE(predicted.mean[axis])) * 2 + alike
    return PLANE + place * 6 + (predicted.error_class >> 2), sign_of(plane)


def _alignment(predicted: Prediction, axis: int) -> Input:
    below, level, above = predicted.below[axis], predicted.level[axis], predicted.above[axis]
    smoothed = predicted.smoothed[axis]
    sign = 1 if above > below or (above == below and smoothed >= 0.0) else -1
    alike = int(smoothed * sign > 0.0)
    place = (min(max(above, below), 4) * 4 + min(above, below, 3)) * 3 + min(level, 2)
    return ALIGNMENT + place * 8 + FOUR(smoothed) * 2 + alike, sign


def _across(predicted: Prediction, axis: int, plane: float) -> Input:
    across = predicted.across.offset[axis]
    sign = sign_of(across)
    agreeing, opposing = ahead_and_behind(predicted, axis, sign)
    plane_ahead = plane * sign
    ahead = 0
    if plane_ahead > -1.0:
        ahead = 4 if plane_ahead >= 0.75 else int(2.5 + 2.0 * plane_ahead)  # the last class
    place = (TEN(across) * 8 + predicted.across.trust) * 9 + min(agreeing, 2) * 3 + min(opposing, 2)
    return ACROSS + place * 5 + ahead, sign


def _mirrored(predicted: Prediction, axis: int, mirror_axis: int) -> Input:
    mirrored = predicted.mirrored[axis]
    distance = min(int(abs(mirrored) * 2.0 + 0.5), 7)
    place = (distance * 9 + predicted.mirror_state) * 2 + int(axis == mirror_axis)
    return MIRRORED + place, sign_of(mirrored)


def _joint(predicted: Prediction, axis: int, plane: float) -> Input:
    guess = plane
    if predicted.midpoint.trust > 0:
        guess = predicted.midpoint.offset[axis]
    elif predicted.ring.trust > 0:
        guess = predicted.ring.offset[axis]
    sign = sign_of(guess)
    agreeing, opposing = ahead_and_behind(predicted, axis, sign)
    plane_ahead = plane * sign
    half_steps = min(int(plane_ahead * 2.0 + 3.5), 6) if plane_ahead > -1.7 else 0  # the first class
    place = (min(agreeing, 3) * 4 + min(opposing, 3)) * 7 + half_steps
    return JOINT + place * 40 + EIGHT(guess) * 5 + min(predicted.midpoint.trust, 4), sign


def ahead_and_behind(predicted: Prediction, axis: int, sign: int) -> tuple[int, int]:
    """Members at the coordinate in the direction of `sign`, and at the opposite one."""
    below, above = predicted.below[axis], predicted.above[axis]
    return (above, below) if sign > 0 else (below, above)
