"""PLY: what its header declares, and whether the bytes that follow hold it.

Format: G. Turk, "The PLY Polygon File Format" (1994). In text form each row has a line of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import islice
from typing import BinaryIO

from meshtide_codec.errors import MeshFileError
from meshtide_codec.file_checks.text_lines import lines

HEADER_LINES = 1000
_BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "int32", "uint32", "float", "float32"), 4),
    **dict.fromkeys(("double", "float64", "int64", "uint64"), 8),
}


@dataclass
class PlyElement:
    """One kind of rows that a header declares.

    Args:
        name: such as vertex or face.
        count: how many rows.
        smallest: bytes of the smallest row in binary form, where all lists are empty.
        lists: of each value of a row, whether it is a list, which its length precedes.
    """

    name: str
    count: int
    smallest: int = 0
    lists: list[bool] = field(default_factory=list)


@dataclass(frozen=True)
class PlyHeader:
    """A header.

    Args:
        encoding: ascii, binary_little_endian or binary_big_endian.
        elements: in the order of their rows.
    """

    encoding: str
    elements: tuple[PlyElement, ...]

    def count(self, name: str) -> int:
        """How many rows of that name there are to be."""
        return sum(element.count for element in self.elements if element.name == name)


def read_ply_header(file: BinaryIO) -> PlyHeader:
    """The header; `file` stands behind it then.

    Raises:
        MeshFileError: there is none, or it is not understood.
    """
    encoding = ""
    elements: list[PlyElement] = []
    for number, line in enumerate(islice(lines(file), HEADER_LINES), start=1):
        words = line.decode("ascii", "replace").split()
        match words:
            case ["end_header"] if encoding:
                return PlyHeader(encoding, tuple(elements))
            case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian") as encoding, *_]:
                pass
            case ["element", name, count] if count.isdecimal() and count.isascii():
                elements.append(PlyElement(name, _count(count)))
            case ["property", "list", length, item, _] if elements and length in _BYTES and item in _BYTES:
                elements[-1].smallest += _BYTES[length]
                elements[-1].lists.append(True)
            case ["property", kind, _] if elements and kind in _BYTES:
                elements[-1].smallest += _BYTES[kind]
                elements[-1].lists.append(False)
            case ["ply"] if number == 1:
                pass
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise MeshFileError(f"line {number} of the PLY header is not understood: {' '.join(words)[:80]!r}")
    raise MeshFileError(f"the PLY header has no end_header, or no format, within {HEADER_LINES} lines")


def check_ply_rows(file: BinaryIO, size: int, header: PlyHeader) -> None:
    """Hold what a header declares against what follows it.

    Args:
        file: stands behind the header.
        size: of the file in bytes.
        header: of the file.

    Raises:
        MeshFileError: it is less.
    """
    if header.encoding == "ascii":
        _check_text(file, header)
        return
    left = size - file.tell()
    needed = sum(element.count * element.smallest for element in header.elements)
    if needed > left:
        raise MeshFileError(f"the header declares at least {needed} bytes of rows, but {left} follow it")


def _count(text: str) -> int:
    if len(text) > 18:
        raise MeshFileError(f"the PLY header declares {text[:30]}... rows, which no file holds")
    return int(text)


def _check_text(file: BinaryIO, header: PlyHeader) -> None:
    """Every declared row has a line of its own, with as many values as it has properties, or more."""
    rows = (line for line in lines(file) if line.strip())
    for element in header.elements:
        if not element.lists:
            continue
        held = 0
        for held, row in enumerate(islice(rows, element.count), start=1):
            if not _holds(row, element.lists):
                raise MeshFileError(f"row {held - 1} of {element.name} has fewer values than it should have")
        if held < element.count:
            raise MeshFileError(f"the file ends after {held} of the {element.count} rows of {element.name}")


def _holds(row: bytes, lists: list[bool]) -> bool:
    """Whether a line has all values of a row; those of a list are as many as the value before them tells."""
    if True not in lists:
        return len(row.split(None, len(lists))) >= len(lists)
    words = row.split()
    needed = 0
    for is_list in lists:
        needed += 1
        if needed > len(words):
            return False
        if is_list:
            length = words[needed - 1]
            if not length.isdigit():
                return False
            needed += int(length[:18])
    return needed <= len(words)
