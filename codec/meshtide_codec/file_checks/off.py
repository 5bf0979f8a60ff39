"""OFF: what its first lines declare, and whether the lines that follow hold it.

Format: Geomview manual, "OFF Files": the word OFF, then the numbers of vertices, faces and edges, then a line each: the
three coordinates of a vertex; the number of corners of a face, and these.
"""

from __future__ import annotations

from itertools import islice
from typing import BinaryIO

from meshtide_codec.errors import MeshFileError
from meshtide_codec.file_checks.text_lines import filled_lines

_COORDINATES = 3


def read_off_counts(file: BinaryIO) -> tuple[int, int]:
    """The declared numbers of vertices and faces; `file` stands behind them then.

    Raises:
        MeshFileError: it is no OFF file, or does not tell them.
    """
    rows = filled_lines(file)
    first = next(rows, b"").split()
    if not first or first[0].upper() not in {b"OFF", b"COFF"}:
        raise MeshFileError("the file does not begin with OFF")
    counts = first[1:] or next(rows, b"").split()
    if len(counts) < 2 or not all(word.isdigit() and len(word) <= 18 for word in counts[:2]):
        raise MeshFileError("the OFF file does not tell its numbers of vertices and faces")
    return int(counts[0]), int(counts[1])


def check_off_rows(file: BinaryIO, vertices: int, faces: int) -> None:
    """Hold the declared numbers against the lines that follow.

    Raises:
        MeshFileError: there are fewer, or one has fewer values than it should.
    """
    rows = filled_lines(file)
    held = 0
    for held, row in enumerate(islice(rows, vertices), start=1):
        if len(row.split(None, _COORDINATES)) < _COORDINATES:
            raise MeshFileError(f"vertex {held - 1} of the OFF file has fewer than {_COORDINATES} coordinates")
    if held == vertices:
        for held, row in enumerate(islice(rows, faces), start=vertices + 1):
            words = row.split()
            if not words[0].isdigit() or len(words) <= int(words[0][:18]):
                raise MeshFileError(f"face {held - vertices - 1} of the OFF file has fewer corners than it tells")
    if held < vertices + faces:
        raise MeshFileError(f"the OFF file declares {vertices} vertices and {faces} faces, but {held} lines follow")
