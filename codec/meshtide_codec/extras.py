"""Libraries that only measurements need: loaded when they are used, and explained where they are missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from meshtide_codec.errors import MeshtideError


def extra(module: str, group: str = "bench") -> Any:  # noqa: ANN401 - a module of a library that need not be there
    """The module of that name, from the libraries of the extra `group`.

    Raises:
        MeshtideError: it is not installed.

    >>> extra("a_library_that_is_missing.part")
    Traceback (most recent call last):
    meshtide_codec.errors.MeshtideError: this needs a_library_that_is_missing: pip install 'meshtide[bench]'
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise MeshtideError(f"this needs {module.partition('.')[0]}: pip install 'meshtide[{group}]'") from error


def check_extras(*modules: str, group: str = "bench") -> None:
    """Raise MeshtideError unless all of these can be loaded: one wants to know before an hour's work, not after it."""
    for module in modules:
        extra(module, group)
