"""What the other packages of meshtide offer to this one, which must not import them: found by its entry point."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any

from meshtide_codec.errors import OptionError


def offered(group: str, name: str, *, missing: str, remedy: str) -> Any:  # noqa: ANN401 - whatever is registered
    """What is registered under `name` in a group of entry points.

    Args:
        group: the group.
        name: the entry point.
        missing: the beginning of the message where there is none, or where what it needs is not installed.
        remedy: what can be done about it, the end of that message.

    Raises:
        OptionError: nothing is registered, or the package is not installed.
    """
    for point in entry_points(group=group, name=name):
        try:
            return point.load()
        except ModuleNotFoundError as error:
            raise OptionError(f"{missing}; {error}") from error
    raise OptionError(f"{missing}; {remedy}")
