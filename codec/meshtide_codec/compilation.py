"""How kernels are compiled: one decorator for all of them, and a way to tell a waiting person about it.

Kernels are compiled by numba on first use and cached on disk, so only the first run after an installation
pays for it. numba reports each compilation as an event; `announced_compilation` passes that on.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, cast

import numba

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

Integer: TypeAlias = Any
"""An integer inside a kernel: numba infers its width, which neither int nor a numpy type would tell."""

Function = TypeVar("Function", bound="Callable[..., Any]")


def kernel(function: Function) -> Function:
    """Compile `function` with the options that all kernels share.

    No fastmath (its results differ between machines), no bounds checks (kernels check untrusted input
    themselves), C-like division, cached on disk.
    """
    return _compiled(function)


def inlined_kernel(function: Function) -> Function:
    """Like `kernel`, for the few lines in innermost loops that are worth copying into each caller."""
    return _compiled(function, inline="always")


def borrowing_kernel(function: Function) -> Function:
    """Compile an inner kernel that neither makes nor keeps arrays, without counting references to them.

    Structures of many arrays are handed from kernel to kernel in the innermost loops. Each time one is taken apart
    numba would count a reference to every array in it up and down again, which costs more than the work itself. A
    borrowing kernel must not allocate arrays, and only kernels may call it.
    """
    return _compiled(function, _nrt=False)


def merged_kernel(function: Function) -> Function:
    """Like `borrowing_kernel`, for the steps of the innermost loop: merged into the machine code of each caller.

    A call would copy the descriptions of all arrays of a structure.
    """
    return _compiled(function, _nrt=False, forceinline=True)


def _compiled(function: Function, **options: Any) -> Function:  # noqa: ANN401 - numba's options
    options |= {"error_model": "numpy", "fastmath": False}
    try:
        return cast("Function", numba.njit(cache=True, **options)(function))
    except RuntimeError:  # no folder can be written, so there can be no cache; each process compiles for itself
        return cast("Function", numba.njit(**options)(function))


@contextmanager
def announced_compilation(announce: Callable[[], None]) -> Iterator[None]:
    """Call `announce` once when a kernel has to be compiled inside the block (not when it is loaded from the cache).

    >>> with announced_compilation(lambda: print("compiling")):
    ...     pass
    """
    from numba.core import event  # noqa: PLC0415 - heavy, and only needed where somebody waits

    class Listener(event.Listener):
        announced = False

        def on_start(self, event: Any) -> None:  # noqa: ANN401, ARG002 - numba's signature
            if not self.announced:
                self.announced = True
                announce()

        def on_end(self, event: Any) -> None:  # noqa: ANN401 - numba's signature
            """Only the start is of interest."""

    with event.install_listener("numba:compile", Listener()):
        yield
