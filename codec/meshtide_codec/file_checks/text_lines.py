"""Lines of a text file that nobody vouches for: read in pieces, so that a line without end takes no memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

from meshtide_codec.errors import MeshFileError

if TYPE_CHECKING:
    from collections.abc import Iterator

LONGEST_LINE = 1 << 20
"""Bytes of one line; a polygon of a hundred thousand corners fits."""


def lines(file: BinaryIO) -> Iterator[bytes]:
    """The lines of `file` from where it stands, without what ends them.

    Raises:
        MeshFileError: a line is longer than `LONGEST_LINE`.
    """
    while line := file.readline(LONGEST_LINE + 1):
        if len(line) > LONGEST_LINE:
            raise MeshFileError(f"a line is longer than {LONGEST_LINE} bytes; this is no mesh file in text form")
        yield line.rstrip(b"\r\n")


def filled_lines(file: BinaryIO) -> Iterator[bytes]:
    """The same, without comments that start with # and lines that are empty.

    Raises:
        MeshFileError: a line is longer than `LONGEST_LINE`.
    """
    for line in lines(file):
        text = line.partition(b"#")[0].strip()
        if text:
            yield text
