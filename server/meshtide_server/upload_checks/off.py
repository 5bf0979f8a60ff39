"""OFF: the declared counts against the limits, and against the lines that follow them."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

from meshtide_codec.file_checks import check_off_rows, read_off_counts

if TYPE_CHECKING:
    from meshtide_server.upload_checks.limits import UploadLimits


def check_off(file: BinaryIO, limits: UploadLimits) -> None:
    """Check an uploaded OFF file.

    Raises:
        MeshFileError: it is none, declares too much, or more than it holds.
    """
    vertices, faces = read_off_counts(file)
    limits.check_counts(vertices, faces)
    check_off_rows(file, vertices, faces)
