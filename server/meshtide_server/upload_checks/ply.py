"""PLY: what the header declares is held against the limits, and against the bytes that follow it.

Format: G. Turk, "The PLY Polygon File Format" (1994). A binary file that ends early would be refused by the reader
too, but one in text form would be read wrongly: rows of faces would be taken for vertices.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, BinaryIO

from meshtide_codec.errors import MeshFileError
from meshtide_server.upload_checks.text_lines import lines

if TYPE_CHECKING:
    from meshtide_server.upload_checks.limits import UploadLimits

HEADER_LINES = 1000
_BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "int32", "uint32", "float", "float32"), 4),
    **dict.fromkeys(("double", "float64", "int64", "uint64"), 8),
}


@dataclass
class Element:
    """One kind of rows that a header declares.

    Args:
        name: such as vertex or face.
        count: how many rows.
        smallest: bytes of the smallest row in binary form, where all lists are empty.
        properties: how many values a row has at least in text form.
    """

    name: str
    count: int
    smallest: int = 0
    properties: int = 0


def check_ply(file: BinaryIO, size: int, limits: UploadLimits) -> None:
    """Check an uploaded PLY file of `size` bytes.

    Raises:
        MeshFileError: it has no such header, declares too much, or more than it holds.
    """
    encoding, elements = _header(file)
    counts = {element.name: element.count for element in elements}
    limits.check_counts(counts.get("vertex", 0), counts.get("face", 0))
    if encoding == "ascii":
        _check_text(file, elements)
        return
    left = size - file.tell()
    needed = sum(element.count * element.smallest for element in elements)
    if needed > left:
        raise MeshFileError(f"the header declares at least {needed} bytes of rows, but {left} follow it")


def _header(file: BinaryIO) -> tuple[str, list[Element]]:
    encoding = ""
    elements: list[Element] = []
    for number, line in enumerate(islice(lines(file), HEADER_LINES), start=1):
        words = line.decode("ascii", "replace").split()
        match words:
            case ["end_header"] if encoding:
                return encoding, elements
            case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian") as encoding, *_]:
                pass
            case ["element", name, count] if count.isdecimal() and count.isascii():
                elements.append(Element(name, _count(count)))
            case ["property", "list", length, item, _] if elements and length in _BYTES and item in _BYTES:
                elements[-1].smallest += _BYTES[length]
                elements[-1].properties += 1
            case ["property", kind, _] if elements and kind in _BYTES:
                elements[-1].smallest += _BYTES[kind]
                elements[-1].properties += 1
            case ["ply"] if number == 1:
                pass
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise MeshFileError(f"line {number} of the PLY header is not understood: {' '.join(words)[:80]!r}")
    raise MeshFileError(f"the PLY header has no end_header, or no format, within {HEADER_LINES} lines")


def _count(text: str) -> int:
    if len(text) > 18:
        raise MeshFileError(f"the PLY header declares {text[:30]}... rows, which no file holds")
    return int(text)


def _check_text(file: BinaryIO, elements: list[Element]) -> None:
    """Every declared row has a line of its own, with as many values as it has properties, or more."""
    rows = (line for line in lines(file) if line.strip())
    for element in elements:
        if element.properties == 0:
            continue
        for index in range(element.count):
            row = next(rows, None)
            if row is None:
                raise MeshFileError(f"the file ends after {index} of the {element.count} rows of {element.name}")
            if len(row.split(None, element.properties)) < element.properties:
                raise MeshFileError(f"row {index} of {element.name} has fewer than {element.properties} values")
