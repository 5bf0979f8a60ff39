"""Small classes for measured quantities, looked up as floor(32 |value|) (docs/format.md, section 8.5)."""

from __future__ import annotations

STEPS = 32


class SaturatingClasses:
    """Classes floor(count v / (v + knee)) of v = |value|, the knee given doubled.

    >>> [SaturatingClasses(8, 2)(value) for value in (0.0, 0.25, -1.0, 99.0)]
    [0, 1, 4, 7]
    """

    def __init__(self, count: int, twice_knee: int) -> None:
        self._table = [min(2 * count * i // (2 * i + STEPS * twice_knee), count - 1) for i in range(512)]

    def __call__(self, value: float) -> int:
        """The class of a value."""
        return self._table[min(int(abs(value) * STEPS), 511)]


def _half_octaves() -> list[int]:
    table = []
    for i in range(2048):
        scaled = ((100 * i + 64) ** 2 << 24) // 3200**2
        table.append(min(max(scaled.bit_length() - 25 + 12, 0), 23))
    return table


_HALF_OCTAVES = _half_octaves()


def error_class(error: float) -> int:
    """Half octaves of an error that is not negative, 0 to 23.

    >>> error_class(0.0), error_class(1.0), error_class(99.0)
    (0, 12, 23)
    """
    return _HALF_OCTAVES[min(int(error * STEPS), 2047)]
