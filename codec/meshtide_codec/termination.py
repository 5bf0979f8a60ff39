"""SIGTERM and SIGHUP as an exception, so that every block is left in order.

A process that dies of the signal itself leaves temporary files, child processes and half a line on the terminal.
"""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

ENDING_SIGNALS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that ask a process to end, and that do so at once where nobody listens."""
_OF_SIGNALS = 128
"""Added to a signal's number by shells, for the exit code of what it has ended."""


class Terminated(SystemExit):
    """A signal asked this process to end; its exit code is that of the signal.

    Args:
        number: of the signal.

    >>> Terminated(signal.SIGTERM).code
    143
    """

    def __init__(self, number: int) -> None:
        super().__init__(_OF_SIGNALS + number)


@contextmanager
def terminable() -> Iterator[None]:
    """Inside, SIGTERM and SIGHUP raise `Terminated` in the main thread; a second one ends the process at once.

    Whoever handles these signals already goes on doing so; outside of the main thread nothing is changed.
    """
    taken = []
    if threading.current_thread() is threading.main_thread():
        taken = [number for number in ENDING_SIGNALS if signal.getsignal(number) is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, _terminate)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


def _terminate(number: int, _frame: FrameType | None) -> NoReturn:
    for each in ENDING_SIGNALS:
        if signal.getsignal(each) is _terminate:
            signal.signal(each, signal.SIG_DFL)
    if "multiprocessing" in sys.modules:  # a pool would wait for the work of its processes
        for child in sys.modules["multiprocessing"].active_children():
            child.terminate()
    raise Terminated(number)
