"""How the inner kernels are compiled: like other kernels, without counting references.

The traversal hands structures of many arrays from kernel to kernel. Each time one is taken apart numba would count a
reference to every array in it up and down again, which costs more than the work itself. An inner kernel neither makes
nor keeps arrays: it borrows those that its caller holds, so there is nothing to count.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import numba

if TYPE_CHECKING:
    from collections.abc import Callable

Function = TypeVar("Function", bound="Callable[..., Any]")


def borrowing_kernel(function: Function) -> Function:
    """Compile `function`, which must not allocate arrays and must be called by kernels only."""
    options: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": False, "_nrt": False}
    compiled: Function = numba.njit(**options)(function)
    return compiled


def merged_kernel(function: Function) -> Function:
    """Like `borrowing_kernel`, for the steps of the innermost loop: merged into the machine code of each caller.

    A call would copy the descriptions of all arrays of a structure.
    """
    options: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": False, "_nrt": False}
    compiled: Function = numba.njit(forceinline=True, **options)(function)
    return compiled
