"""Wire messages between a streaming client and a server: what is said, and how it is written.

Every message is one msgpack array [type, fields...] of at most 256 KiB, sent as one binary websocket frame.
The client opens with Hello and grants Credit as it goes; the server answers with HeaderPart, PacketPart and,
at the end, Done; either side may send Error and close.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar

from meshtide_codec.errors import ProtocolError
from meshtide_codec.packets import LARGEST_LEVEL
from meshtide_codec.stream import plain_values

PROTOCOL_VERSION = 1
LARGEST_MESSAGE = 256 * 1024
LARGEST_PART = LARGEST_MESSAGE - 64
"""Payload bytes of one part; the rest of the message is framing."""
LONGEST_MESH_ID = 200
LONGEST_TEXT = 1000
FINGERPRINT_BYTES = 32
MAXIMUM_RANGES = 4096


@dataclass(frozen=True, slots=True)
class Hello:
    """The client's first message.

    Args:
        protocol: version of the wire protocol.
        mesh: id of the mesh.
        fingerprint: of the stream that the client holds packets of, or empty.
        held: what it holds, as [first, end) pairs of packet indices, ascending.
        until_level: send no more than what this level needs.
        until_error: stop at the first state whose RMS distance is at most this fraction of the diagonal.
        until_bytes: stop before the file so far (preamble, header, packets) would be longer than this.
        credit: bytes of parts that the server may send for a start.
    """

    protocol: int
    mesh: str
    fingerprint: bytes
    held: tuple[tuple[int, int], ...]
    until_level: int | None
    until_error: float | None
    until_bytes: int | None
    credit: int


@dataclass(frozen=True, slots=True)
class Credit:
    """The client allows the server so many more bytes of parts."""

    size: int


@dataclass(frozen=True, slots=True)
class HeaderPart:
    """A part of the stream header.

    Args:
        fingerprint: of the whole header; a client that holds it already is sent one part without data.
        total: length of the header.
        offset: where the part belongs.
        data: the part.
    """

    fingerprint: bytes
    total: int
    offset: int
    data: bytes


@dataclass(frozen=True, slots=True)
class PacketPart:
    """A part of packet `index`, which starts at byte `offset` of it."""

    index: int
    offset: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Done:
    """All that was asked for has been sent: so many packets and bytes, and whether the stream goes on after them."""

    packets: int
    size: int
    more: bool


@dataclass(frozen=True, slots=True)
class Error:
    """The sender gives up: a short code for programs, a sentence for people."""

    code: str
    message: str


Message = Hello | Credit | HeaderPart | PacketPart | Done | Error


class _Types:
    BY_NUMBER: ClassVar[dict[int, type[Message]]] = {
        0: Hello,
        1: Credit,
        2: HeaderPart,
        3: PacketPart,
        4: Done,
        5: Error,
    }
    NUMBERS: ClassVar[dict[type[Message], tuple[int, tuple[str, ...]]]] = {
        message: (number, tuple(field.name for field in fields(message))) for number, message in BY_NUMBER.items()
    }


def encode_message(message: Message) -> bytes:
    """`message` as one frame.

    >>> decode_message(encode_message(Credit(1024)))
    Credit(size=1024)
    """
    number, names = _Types.NUMBERS[type(message)]
    return plain_values.pack([number, *[getattr(message, name) for name in names]])


def decode_message(frame: bytes | str) -> Message:
    """The message in one frame, every field checked.

    Raises:
        ProtocolError: text, an oversized frame, or anything that is not a message of this protocol.
    """
    if isinstance(frame, str):
        raise ProtocolError("a text frame arrived; meshtide speaks binary frames")
    if len(frame) > LARGEST_MESSAGE:
        raise ProtocolError(f"a frame of {len(frame)} bytes arrived; the protocol allows {LARGEST_MESSAGE}")
    try:
        value = plain_values.array(plain_values.unpack(frame, LARGEST_MESSAGE), "a message")
        if not value:
            raise plain_values.BadValueError("the array is empty")
        number = plain_values.integer(value[0], "message type")
        if number not in _Types.BY_NUMBER:
            raise plain_values.BadValueError(f"there is no message type {number}")
        message = _Types.BY_NUMBER[number]
        names = [field.name for field in fields(message)]
        arguments = plain_values.array(list(value[1:]), message.__name__, len(names))
        return message(**{name: _READERS[name](value, name) for name, value in zip(names, arguments, strict=True)})
    except plain_values.BadValueError as error:
        raise ProtocolError(f"not a meshtide message: {error}") from error


def _held_ranges(value: object, name: str) -> tuple[tuple[int, int], ...]:
    ranges = plain_values.array(value, name)
    if len(ranges) > MAXIMUM_RANGES:
        raise plain_values.BadValueError(f"{name} has {len(ranges)} ranges, more than {MAXIMUM_RANGES}")
    result = []
    smallest = 0
    for pair in ranges:
        first, end = plain_values.array(pair, f"a range of {name}", 2)
        first = plain_values.integer(first, "start of a range", smallest)
        smallest = plain_values.integer(end, "end of a range", first + 1)
        result.append((first, smallest))
    return tuple(result)


def _fingerprint(value: object, name: str) -> bytes:
    data = plain_values.binary(value, name, FINGERPRINT_BYTES)
    if len(data) not in (0, FINGERPRINT_BYTES):
        raise plain_values.BadValueError(f"{name} must be empty or {FINGERPRINT_BYTES} bytes, not {len(data)}")
    return data


def _truth(value: object, name: str) -> bool:
    if not isinstance(value, bool):
        raise plain_values.BadValueError(f"{name} must be true or false, not {plain_values.shown(value)}")
    return value


def _part(value: object, name: str) -> bytes:
    return plain_values.binary(value, name, LARGEST_PART)


def _optional_level(value: object, name: str) -> int | None:
    return None if value is None else plain_values.integer(value, name, 0, LARGEST_LEVEL)


def _optional_error(value: object, name: str) -> float | None:
    return None if value is None else plain_values.number(value, name, 0.0)


def _optional_size(value: object, name: str) -> int | None:
    return None if value is None else plain_values.integer(value, name)


def _short_text(value: object, name: str) -> str:
    return plain_values.text(value, name, LONGEST_TEXT)


_READERS: dict[str, Any] = {
    "protocol": plain_values.integer,
    "mesh": lambda value, name: plain_values.text(value, name, LONGEST_MESH_ID),
    "fingerprint": _fingerprint,
    "held": _held_ranges,
    "until_level": _optional_level,
    "until_error": _optional_error,
    "until_bytes": _optional_size,
    "credit": plain_values.integer,
    "size": plain_values.integer,
    "total": plain_values.integer,
    "offset": plain_values.integer,
    "data": _part,
    "index": plain_values.integer,
    "packets": plain_values.integer,
    "more": _truth,
    "code": _short_text,
    "message": _short_text,
}
