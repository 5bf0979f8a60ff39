"""PLY: what the header declares is held against the limits, and against the bytes that follow it."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

from meshtide_codec.file_checks import check_ply_rows, read_ply_header

if TYPE_CHECKING:
    from meshtide_server.upload_checks.limits import UploadLimits


def check_ply(file: BinaryIO, size: int, limits: UploadLimits) -> None:
    """Check an uploaded PLY file of `size` bytes.

    Raises:
        MeshFileError: it has no such header, declares too much, or more than it holds.
    """
    header = read_ply_header(file)
    limits.check_counts(header.count("vertex"), header.count("face"))
    check_ply_rows(file, size, header)
