"""OFF: the declared counts against the limits, and against the lines that follow them.

Format: Geomview manual, "OFF Files": the word OFF, then the numbers of vertices, faces and edges, then a line each.
"""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING, BinaryIO

from meshtide_codec.errors import MeshFileError
from meshtide_server.upload_checks.text_lines import filled_lines

if TYPE_CHECKING:
    from meshtide_server.upload_checks.limits import UploadLimits

_COUNTS = ("vertices", "faces")


def check_off(file: BinaryIO, limits: UploadLimits) -> None:
    """Check an uploaded OFF file.

    Raises:
        MeshFileError: it is none, declares too much, or more than it holds.
    """
    rows = filled_lines(file)
    first = next(rows, b"").split()
    if not first or first[0].upper() not in {b"OFF", b"COFF"}:
        raise MeshFileError("the file does not begin with OFF")
    counts = first[1:] or next(rows, b"").split()
    if len(counts) < len(_COUNTS) or not all(word.isdigit() and len(word) <= 18 for word in counts[:2]):
        raise MeshFileError("the OFF file does not tell its numbers of vertices and faces")
    vertices, faces = int(counts[0]), int(counts[1])
    limits.check_counts(vertices, faces)
    held = sum(1 for _ in islice(rows, vertices + faces))
    if held < vertices + faces:
        raise MeshFileError(f"the OFF file declares {vertices} vertices and {faces} faces, but {held} lines follow")
