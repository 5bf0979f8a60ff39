"""Token bucket: bounds a rate and lets bursts pass (as in RFC 2697, without its colours). No clock of its own.

The bucket fills at a steady rate up to its capacity. `try_take` is for what can be refused, such as a request; `take`
is for what will happen anyway, such as bytes that are sent: it may leave a debt, and says how long paying it takes.
Cost: constant, and nothing runs in the background.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Callable


class TokenBucket:
    """One bucket; it is full at first.

    Args:
        rate: tokens a second.
        capacity: tokens that it holds at most.
        clock: seconds, never going back.

    Raises:
        OptionError: a rate or capacity that is not positive.

    >>> now = 0.0
    >>> bucket = TokenBucket(rate=2.0, capacity=3.0, clock=lambda: now)
    >>> [bucket.try_take(1.0) for _ in range(4)]
    [0.0, 0.0, 0.0, 0.5]
    """

    __slots__ = ("_capacity", "_clock", "_level", "_rate", "_seen")

    def __init__(self, rate: float, capacity: float, clock: Callable[[], float]) -> None:
        if not (rate > 0 and capacity > 0):
            raise OptionError(f"rate and capacity of a bucket must be positive, not {rate} and {capacity}")
        self._rate = rate
        self._capacity = capacity
        self._clock = clock
        self._level = capacity
        self._seen = clock()

    @property
    def full(self) -> bool:
        """Whether it is as it was at first."""
        self._fill()
        return self._level >= self._capacity

    def try_take(self, amount: float) -> float:
        """Take `amount` and return 0, or take nothing and return the seconds until it can be had.

        Raises:
            OptionError: more than the bucket ever holds.
        """
        if amount > self._capacity:
            raise OptionError(f"{amount} tokens are more than the bucket's {self._capacity}")
        self._fill()
        if self._level >= amount:
            self._level -= amount
            return 0.0
        return (amount - self._level) / self._rate

    def take(self, amount: float) -> float:
        """Take `amount`, however much that is, and return the seconds to wait before it counts as paid."""
        self._fill()
        self._level -= amount
        return max(-self._level, 0.0) / self._rate

    def _fill(self) -> None:
        now = self._clock()
        self._level = min(self._level + max(now - self._seen, 0.0) * self._rate, self._capacity)
        self._seen = now
