"""Classes of angles, lengths and bends of candidate triangles (docs/format.md, section 9.4)."""

from __future__ import annotations

from itertools import pairwise
from math import isqrt

Vector = tuple[float, float, float]

SCALE = 1 << 30
ANGLES = 32
LONGEST_CLASS = 15


def _cosine_between(low: int, high: int) -> int:
    """Cosine of the mean of two angles, from their cosines; all in units of 1 / SCALE."""
    sine_low = isqrt(SCALE * SCALE - low * low)
    sine_high = isqrt(SCALE * SCALE - high * high)
    cosine_of_difference = (low * high + sine_low * sine_high) // SCALE
    cosine_of_half = isqrt((SCALE + cosine_of_difference) * SCALE // 2)
    return (low + high) * SCALE // (2 * cosine_of_half)


def _angle_classes() -> list[int]:
    """Class of an angle for each signed squared cosine (index - 512) / 512."""
    cosines = [0, SCALE]
    while len(cosines) <= ANGLES // 2:
        between = [_cosine_between(low, high) for low, high in pairwise(cosines)]
        cosines = sorted(cosines + between)
    squares = [cosine * cosine // SCALE for cosine in cosines[:-1]]
    bounds = squares + [-square for square in squares[1:]]
    steps = [(2 * index - 1024) * SCALE // 1024 for index in range(1025)]
    return [sum(bound > step for bound in bounds) for step in steps]


ANGLE_CLASSES = _angle_classes()
LENGTH_CLASSES = [min(LONGEST_CLASS, max(0, (max(i, 1) ** 2).bit_length() - 3)) for i in range(4096)]


class Shapes:
    """Measures triangles of vertices at known positions, given in half cells."""

    def __init__(self, positions: list[tuple[int, int, int]]) -> None:
        self._positions = [(float(x), float(y), float(z)) for x, y, z in positions]

    def point(self, vertex: int) -> Vector:
        """Where a vertex is."""
        return self._positions[vertex]

    def squared(self, one: int, other: int) -> float:
        """Squared distance of two vertices."""
        return self.squared_to(one, self._positions[other])

    def squared_to(self, vertex: int, point: Vector) -> float:
        """Squared distance of a vertex from a point."""
        a = self._positions[vertex]
        x, y, z = a[0] - point[0], a[1] - point[1], a[2] - point[2]
        return x * x + y * y + z * z

    def angles(self, first: int, second: int, apex: int) -> tuple[int, int, int]:
        """Classes of the angles at the three corners of a face, which sum to 31 unless two of them alone are more."""
        gate, one, other = self.squared(first, second), self.squared(first, apex), self.squared(second, apex)
        at_apex = angle_class(gate, one, other)
        at_first = angle_class(other, one, gate)
        return at_first, max(0, 31 - at_apex - at_first), at_apex

    def normal(self, one: int, two: int, three: int) -> Vector:
        """Cross product of two - one and three - one."""
        p, q, r = self._positions[one], self._positions[two], self._positions[three]
        a = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
        b = (r[0] - p[0], r[1] - p[1], r[2] - p[2])
        return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _class_of_cosine(signed_square: float, scale: float) -> int:
    if not scale > 0.0:
        return 0
    place = int(signed_square / scale * 512 + 512)
    return ANGLE_CLASSES[min(max(place, 0), 1024)]


def angle_class(opposite: float, one: float, other: float) -> int:
    """Class of the angle between two sides of a triangle, from the squared lengths of the three."""
    double_dot = one + other - opposite
    return _class_of_cosine(double_dot * abs(double_dot) * 0.25, one * other)


def bend_class(one: Vector, other: Vector) -> int:
    """Class of the angle between two normals."""
    dot = one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
    squared = one[0] * one[0] + one[1] * one[1] + one[2] * one[2]
    other_squared = other[0] * other[0] + other[1] * other[1] + other[2] * other[2]
    return _class_of_cosine(dot * abs(dot), squared * other_squared)


def length_class(squared: float, gate_squared: float) -> int:
    """Class of a squared length in proportion to the gate's."""
    ratio = squared * (16.0 / gate_squared if gate_squared > 0.0 else 0.0)
    return LONGEST_CLASS if ratio >= len(LENGTH_CLASSES) else LENGTH_CLASSES[int(ratio)]


def short_length(squared: float) -> int:
    """Squared length in squared cells, rounded, up to 15."""
    return LONGEST_CLASS if squared >= 4 * LONGEST_CLASS else int(squared * 0.25 + 0.5)
