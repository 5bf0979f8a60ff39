"""Angles, lengths and bends of candidate triangles, cut into classes.

Doubles with + - * / in a fixed order: the positions are integers, so most of it is exact, and all of it is the same
on every machine. Angles are never computed: their classes are looked up by the signed square of the cosine, from
-1 to 1, which needs no root. Cost: O(1) for a triangle.
"""

from __future__ import annotations

from itertools import pairwise
from math import isqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec.compilation import inlined_kernel, merged_kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Table = NDArray[np.int32]

ANGLES = 32  # classes of angles, equal parts of 180 degrees
LENGTHS = 16  # classes of length ratios, four for each doubling
SHORT_LENGTHS = 16  # squared lengths in squared cells, and one class for all longer ones

COSINE_STEPS = 1024  # the signed squared cosine from -1 to 1 in this many steps
RATIO_STEPS = 4096  # ratios of squared lengths up to 256, in sixteenths


def _angle_classes() -> NDArray[np.int64]:
    """Class of an angle, 0 for 0 degrees, from its signed squared cosine.

    The bounds between classes are found by halving angles in integers scaled by 2^30.
    """
    scale = 1 << 30
    cosines = [0, scale]  # of 90 and 0 degrees
    while len(cosines) <= ANGLES // 2:
        finer = []
        for low, high in pairwise(cosines):
            finer += [low, _half_way(low, high, scale)]
        cosines = [*finer, cosines[-1]]
    squares = [cosine * cosine // scale for cosine in cosines[-2::-1]]  # falling to 0 at 90 degrees
    bounds = np.array(squares + [-square for square in squares[-2::-1]], np.int64)
    steps = (np.arange(COSINE_STEPS + 1) * 2 - COSINE_STEPS) * scale // COSINE_STEPS
    return np.array([int(np.count_nonzero(bounds > step)) for step in steps], np.int64)


def _half_way(low: int, high: int, scale: int) -> int:
    """Cosine of the mean of two angles in [0, 90] degrees, given their cosines; all are scaled."""
    sine_low = isqrt(scale * scale - low * low)
    sine_high = isqrt(scale * scale - high * high)
    cosine_of_difference = (low * high + sine_low * sine_high) // scale
    cosine_of_half = isqrt((scale + cosine_of_difference) * scale // 2)
    return (low + high) * scale // (2 * cosine_of_half)


ANGLE_CLASSES = _angle_classes()
LENGTH_CLASSES = np.array(
    [min(LENGTHS - 1, max(0, (max(i, 1) ** 2).bit_length() - 3)) for i in range(RATIO_STEPS)], np.int64
)
"""Equal lengths are at the lower end of class 6."""


class GateShape(NamedTuple):
    """What all candidates at a gate are measured against, in half cells.

    Attributes:
        first, second, known: (x, y, z) of the gate's ends and of the apex behind it.
        squared: squared length of the gate.
        ratio_scale: sixteen over it, or 0 for a gate without length.
        normal: cross product of the sides of the face behind the gate.
        normal_squared: its squared length.
    """

    first: tuple[float, float, float]
    second: tuple[float, float, float]
    known: tuple[float, float, float]
    squared: float
    ratio_scale: float
    normal: tuple[float, float, float]
    normal_squared: float


@inlined_kernel
def position(vertices: Table, vertex: int) -> tuple[float, float, float]:
    """Coordinates of a vertex."""
    return float(vertices[vertex, 0]), float(vertices[vertex, 1]), float(vertices[vertex, 2])


@inlined_kernel
def squared_distance(one: tuple[float, float, float], other: tuple[float, float, float]) -> float:
    """Squared distance of two points."""
    x = one[0] - other[0]
    y = one[1] - other[1]
    z = one[2] - other[2]
    return x * x + y * y + z * z


@inlined_kernel
def normal_of(
    one: tuple[float, float, float], two: tuple[float, float, float], three: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Cross product of (two - one) and (three - one)."""
    a = (two[0] - one[0], two[1] - one[1], two[2] - one[2])
    b = (three[0] - one[0], three[1] - one[1], three[2] - one[2])
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@merged_kernel
def gate_shape(vertices: Table, first: int, second: int, known_apex: int) -> GateShape:
    """Measure a gate from `first` to `second`, whose other side is the face (second, first, known_apex)."""
    one = position(vertices, first)
    two = position(vertices, second)
    three = position(vertices, known_apex)
    squared = squared_distance(one, two)
    normal = normal_of(two, one, three)
    return GateShape(
        one,
        two,
        three,
        squared,
        16.0 / squared if squared > 0.0 else 0.0,
        normal,
        normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2],
    )


@inlined_kernel
def class_of_cosine(signed_square: float, scale: float) -> int:
    """Class of the angle whose cosine squared, with its sign, is signed_square / scale; 0 if scale is not positive."""
    if not scale > 0.0:
        return 0
    place = int(signed_square / scale * (COSINE_STEPS // 2) + COSINE_STEPS // 2)
    return int(ANGLE_CLASSES[min(max(place, 0), COSINE_STEPS)])


@inlined_kernel
def angle_class(opposite: float, one: float, other: float) -> int:
    """Class of the angle between two sides of a triangle, from the squared lengths of the three."""
    double_dot = one + other - opposite
    return class_of_cosine(double_dot * abs(double_dot) * 0.25, one * other)


@inlined_kernel
def bend_class(gate: GateShape, apex: tuple[float, float, float]) -> int:
    """Class of the angle between the normals of the face behind the gate and of the candidate's face."""
    normal = normal_of(gate.first, gate.second, apex)
    dot = normal[0] * gate.normal[0] + normal[1] * gate.normal[1] + normal[2] * gate.normal[2]
    squared = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]
    return class_of_cosine(dot * abs(dot), squared * gate.normal_squared)


@inlined_kernel
def length_class(squared: float, ratio_scale: float) -> int:
    """Class of a squared length in proportion to the gate's."""
    ratio = squared * ratio_scale
    if ratio >= RATIO_STEPS:
        return LENGTHS - 1
    return int(LENGTH_CLASSES[int(ratio)])


@inlined_kernel
def short_length(squared: float) -> int:
    """Squared length in squared cells, rounded, or SHORT_LENGTHS - 1."""
    if squared >= 4 * (SHORT_LENGTHS - 1):
        return SHORT_LENGTHS - 1
    return int(squared * 0.25 + 0.5)
