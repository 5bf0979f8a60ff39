"""Reading plain msgpack values that came from a stranger: every type, range and length is checked on the way in."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import msgpack

from meshtide_codec.errors import MeshtideError

if TYPE_CHECKING:
    from collections.abc import Sequence

LARGEST_INTEGER = (1 << 63) - 1


class BadValueError(MeshtideError):
    """A value that is not what its place demands; callers turn it into the error of their layer."""


def unpack(data: bytes | memoryview, largest_item: int) -> Any:  # noqa: ANN401 - anything may come
    """The one msgpack value in `data`, whose strings, arrays and maps may have `largest_item` entries at most.

    Raises:
        BadValueError: not msgpack, or bytes left over.
    """
    try:
        return msgpack.unpackb(
            data,
            raw=False,
            strict_map_key=False,
            max_str_len=largest_item,
            max_bin_len=largest_item,
            max_array_len=largest_item,
            max_map_len=largest_item,
            max_ext_len=0,
        )
    except (ValueError, TypeError, RecursionError, OverflowError, msgpack.UnpackException) as error:
        raise BadValueError(f"not a msgpack value: {_fault(error)}") from error


def _fault(error: Exception) -> str:
    """What is wrong with bytes that msgpack refused, in words of this program."""
    match error:
        case UnicodeDecodeError():
            return "a string in it is not UTF-8"
        case msgpack.ExtraData():
            return f"{len(error.extra)} bytes follow it"
        case msgpack.StackError() | RecursionError():
            return "it is nested too deeply"
        case msgpack.FormatError() | TypeError():
            return "a byte begins no value, or a map has a key that cannot be one"
        case _:
            return "it ends early, or an item is longer than is taken"


def fault_of(error: Exception) -> str:
    """What is wrong with a value that was read by its members: the words of `BadValueError`, or that one is missing.

    >>> fault_of(BadValueError("size must be an integer")), fault_of(KeyError("id"))
    ('size must be an integer', 'a member is missing, or of another kind')
    """
    return str(error) if isinstance(error, BadValueError) else "a member is missing, or of another kind"


def pack(value: Any) -> bytes:  # noqa: ANN401 - anything plain
    """`value` in msgpack."""
    packed: bytes = msgpack.packb(value, use_bin_type=True)
    return packed


def integer(value: object, name: str, smallest: int = 0, largest: int = LARGEST_INTEGER) -> int:
    """`value` as an integer between `smallest` and `largest`."""
    if isinstance(value, bool) or not isinstance(value, int) or not smallest <= value <= largest:
        raise BadValueError(f"{name} must be an integer in {smallest}..{largest}, not {shown(value)}")
    return value


def number(value: object, name: str, smallest: float = -math.inf, largest: float = math.inf) -> float:
    """`value` as a finite float between `smallest` and `largest`."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadValueError(f"{name} must be a number, not {shown(value)}")
    if not math.isfinite(value) or not smallest <= value <= largest:
        raise BadValueError(f"{name} must be a finite number in {smallest}..{largest}, not {shown(value)}")
    return float(value)


def text(value: object, name: str, longest: int) -> str:
    """`value` as a string of at most `longest` characters."""
    if not isinstance(value, str) or len(value) > longest:
        raise BadValueError(f"{name} must be a string of at most {longest} characters, not {shown(value)}")
    return value


def binary(value: object, name: str, longest: int, shortest: int = 0) -> bytes:
    """`value` as bytes whose length lies between `shortest` and `longest`."""
    if not isinstance(value, bytes) or not shortest <= len(value) <= longest:
        raise BadValueError(f"{name} must be {shortest}..{longest} bytes, not {shown(value)}")
    return value


def array(value: object, name: str, length: int | None = None) -> Sequence[Any]:
    """`value` as an array, of exactly `length` entries if that is given."""
    if not isinstance(value, list) or (length is not None and len(value) != length):
        wanted = "an array" if length is None else f"an array of {length}"
        raise BadValueError(f"{name} must be {wanted}, not {shown(value)}")
    return value


def shown(value: object, longest: int = 60) -> str:
    """A short printable form of a value that may be hostile."""
    kind = type(value).__name__
    if isinstance(value, bytes | list | dict):
        return f"{kind} of {len(value)}"
    if isinstance(value, int) and value.bit_length() > 200:
        return "a huge integer"
    if isinstance(value, str):
        value = value[:longest]
    return f"{value!r}"[:longest]
