"""Libraries that not everybody needs: loaded when they are used, and explained where they are missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from meshtide_codec.errors import MissingLibraryError


def extra(module: str, group: str = "bench") -> Any:  # noqa: ANN401 - a module of a library that need not be there
    """The module of that name, from the libraries of the extra `group`.

    Raises:
        MissingLibraryError: it is not installed, or cannot be loaded.

    >>> extra("a_library.part")
    Traceback (most recent call last):
    meshtide_codec.errors.MissingLibraryError: this needs a_library, which is not installed:
    pip install 'meshtide[bench]'
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise missing_library(module.partition(".")[0], group, error) from error


def check_extras(*modules: str, group: str = "bench") -> None:
    """Raise MissingLibraryError unless all of these can be loaded: better before an hour of work than after it."""
    for module in modules:
        extra(module, group)


def missing_library(name: str, group: str, reason: ImportError, what: str = "this") -> MissingLibraryError:
    """The error that says what to install.

    Args:
        name: of the library.
        group: the extra of meshtide that brings it.
        reason: why it cannot be used.
        what: what needs it.
    """
    state = "is not installed" if isinstance(reason, ModuleNotFoundError) else f"cannot be loaded ({reason})"
    return MissingLibraryError(f"{what} needs {name}, which {state}: pip install 'meshtide[{group}]'")
