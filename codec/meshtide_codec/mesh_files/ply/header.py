"""The header of a PLY file: which elements it declares, of which properties, and in which encoding.

Format: G. Turk, "The PLY Polygon File Format" (1994), and what programs have made of it since: lines that end in LF, CR
LF or CR, blank lines, a byte order mark, names and words in any case, text in any encoding, 64-bit integers.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.encodings import CONTROL

if TYPE_CHECKING:
    from collections.abc import Iterator

LONGEST_HEADER = 1 << 20
"""Bytes: some twenty thousand lines, where known files have fewer than a hundred."""
LONGEST_COUNT = 18
"""Digits of a number of rows: more than any file holds, and within 64 bits."""
_MARK = b"\xef\xbb\xbf"
_SHOWN = 80
_BLANKS = "\t\n\v\f\r "
_COMMENT = re.compile(r"(comment|obj_info)([\t-\r ]|\Z)", re.IGNORECASE)
_LINE_END = re.compile(rb"\r\n?|\n")
_CARRIAGE_RETURN = re.compile(rb"\r")
ByteOrder = Literal["=", "<", ">"]
_ORDERS: dict[str, ByteOrder] = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}

TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
"""numpy's names of the types."""


@dataclass(frozen=True, slots=True)
class PlyProperty:
    """A value of each row of an element, or a list of values with its length before it.

    Args:
        name: as the file has it.
        item: the type of the value, or of each value of the list.
        length: the type of the list's length; None for a single value.
    """

    name: str
    item: np.dtype[Any]
    length: np.dtype[Any] | None = None

    @property
    def smallest(self) -> int:
        """Bytes of the value, or of an empty list."""
        return (self.length or self.item).itemsize


@dataclass(slots=True)
class PlyElement:
    """One kind of rows.

    Args:
        name: as the file has it, such as vertex or face.
        count: how many rows.
        properties: of each row, in the order of its values.
    """

    name: str
    count: int
    properties: list[PlyProperty] = field(default_factory=list)

    @property
    def smallest(self) -> int:
        """Bytes of the smallest row in binary form, where all lists are empty."""
        return sum(one.smallest for one in self.properties)


@dataclass(frozen=True, slots=True)
class PlyHeader:
    """A header.

    Args:
        order: of the bytes of binary rows, as numpy writes it (``<``, ``>``); ``=`` for rows of text.
        elements: in the order of their rows.
        comments: the lines that begin with comment, without that word, and those that begin with obj_info, with it.
        body: where the rows begin, in bytes.
        notes: what a person should know of it, a line each.
    """

    order: ByteOrder
    elements: tuple[PlyElement, ...]
    comments: tuple[str, ...]
    body: int
    notes: tuple[str, ...]

    @property
    def is_text(self) -> bool:
        """Whether the rows are words."""
        return self.order == "="

    def element(self, name: str) -> PlyElement | None:
        """The element of that name, in lower case; None if there is none."""
        return next((one for one in self.elements if one.name.lower() == name), None)


def read_header(data: bytes | memoryview) -> PlyHeader:
    r"""The header at the begin of a file.

    Raises:
        MeshFileError: there is none, a line of it is not understood, or it has no end.

    >>> header = read_header(b"ply\rformat ascii 1.0\relement Vertex 2\rproperty float X\rend_header\r")
    >>> header.elements[0].count, header.elements[0].properties[0].name, header.body
    (2, 'X', 66)
    """
    order: ByteOrder | None = None
    elements: list[PlyElement] = []
    comments: list[str] = []
    notes: list[str] = []
    for number, end, line in _lines(data):
        words = line.split()
        if CONTROL.search(line.encode()) and _COMMENT.match(line) is None:
            raise MeshFileError(f"line {number} of the PLY header has a control byte: {line[:_SHOWN]!r}")
        match [words[0].lower(), *words[1:]] if words else []:
            case ["ply"] if number == 1:
                pass
            case _ if number == 1:
                raise MeshFileError("it does not begin with the word ply: not a PLY file")
            case ["end_header"]:
                if order is None:
                    raise MeshFileError("the PLY header does not name a format: ascii or binary")
                _check_names(elements)
                return PlyHeader(order, tuple(elements), tuple(comments), end, tuple(notes))
            case ["format", encoding, *_] if order is None and encoding.lower() in _ORDERS:
                order = _ORDERS[encoding.lower()]
            case ["element" | "property" as word, *rest] if _declared(word, rest, elements):
                pass
            case ["format" | "element" | "property", *_]:
                raise MeshFileError(f"line {number} of the PLY header is not understood: {line[:_SHOWN]!r}")
            case _:
                comments += _comment(line, number, notes)
    raise MeshFileError(f"the PLY header has no end_header within its first {LONGEST_HEADER} bytes")


def _lines(data: bytes | memoryview) -> Iterator[tuple[int, int, str]]:
    """Lines of the header: their numbers from 1, where the next one begins, and their text.

    Where the first line ends in CR alone all do, so that a binary row after it may begin with the byte of LF.
    """
    start = len(_MARK) if data[: len(_MARK)] == _MARK else 0
    head = bytes(data[: start + LONGEST_HEADER])
    ends = _LINE_END
    number = 0
    while (found := ends.search(head, start)) is not None:
        number += 1
        if number == 1 and found.group() == b"\r":
            ends = _CARRIAGE_RETURN
        yield number, found.end(), _text(head[start : found.start()]).strip(_BLANKS)
        start = found.end()
    if len(head) == len(data) and start < len(head):  # rows of nothing may follow a last line without an end
        yield number + 1, len(head), _text(head[start:]).strip(_BLANKS)


def _text(line: bytes) -> str:
    try:
        return line.decode()
    except UnicodeDecodeError:
        return line.decode("latin-1")


def _comment(line: str, number: int, notes: list[str]) -> list[str]:
    """What a line that declares nothing says; one without its first word is reported."""
    word = line.split(maxsplit=1)[:1]
    if not word:
        return []
    if word[0].lower() == "comment":
        return [line[len("comment") :].strip()]
    if word[0].lower() != "obj_info":
        notes.append(f"line {number} of the header is not a comment, but read as one: {line[:_SHOWN]!r}")
    return [line]


def _declared(word: str, words: list[str], elements: list[PlyElement]) -> bool:
    """Add an element, or a property of the last one; False if the words are none."""
    match word, words:
        case "element", [name, count] if count.isdecimal() and count.isascii():
            elements.append(PlyElement(name, _count(count)))
        case "property", [*kinds, name] if elements and (one := _property(kinds, name)) is not None:
            elements[-1].properties.append(one)
        case _:
            return False
    return True


def _count(text: str) -> int:
    if len(text) > LONGEST_COUNT:
        raise MeshFileError(f"the PLY header declares {text[:30]}... rows, which no file holds")
    return int(text)


def _property(kinds: list[str], name: str) -> PlyProperty | None:
    """The property of those types, or None if they are not types."""
    types = [TYPES.get(kind.lower()) for kind in kinds]
    match kinds, types:
        case [[_], [str(item)]]:
            return PlyProperty(name, np.dtype(item))
        case [[word, _, _], [_, str(length), str(item)]] if word.lower() == "list" and length[0] in "iu":
            return PlyProperty(name, np.dtype(item), np.dtype(length))
    return None


def _check_names(elements: list[PlyElement]) -> None:
    seen: set[str] = set()
    for element in elements:
        if element.name.lower() in seen:
            raise MeshFileError(f"the PLY header declares the element {element.name[:_SHOWN]!r} twice")
        seen.add(element.name.lower())
        names: set[str] = set()
        for one in element.properties:
            if one.name in names:
                raise MeshFileError(f"the PLY header declares {one.name[:_SHOWN]!r} of {element.name[:_SHOWN]} twice")
            names.add(one.name)
