"""Arguments of the wrong type, refused in a sentence where they are given and not where they are used first."""

from __future__ import annotations


def check_type(what: str, value: object, *kinds: type, remedy: str = "") -> None:
    """Raise TypeError unless an argument is of one of these types.

    Args:
        what: what it should be, as a noun with its article.
        value: the argument.
        kinds: types that it may have.
        remedy: where the right thing comes from.

    >>> check_type("a packet", None, int, remedy="ContainerReader.feed returns them")
    Traceback (most recent call last):
    TypeError: a packet must be of type int, not NoneType; ContainerReader.feed returns them
    """
    if not isinstance(value, kinds):
        names = " or ".join(kind.__name__ for kind in kinds)
        ending = f"; {remedy}" if remedy else ""
        raise TypeError(f"{what} must be of type {names}, not {type(value).__name__}{ending}")
