"""Checks of mesh files that their readers do not make: whether a file holds the rows that it declares.

trimesh's readers of PLY and OFF in text form take what lines there are: of a file that was cut off, or whose header is
wrong, they make another mesh, without a word. `check_rows` refuses such a file before it is read.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.file_checks.off import check_off_rows, read_off_counts
from meshtide_codec.file_checks.ply import check_ply_rows, read_ply_header

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["check_off_rows", "check_ply_rows", "check_rows", "read_off_counts", "read_ply_header"]


def check_rows(path: Path) -> None:
    """Refuse a file that declares more than it holds; formats whose readers see to that themselves pass unread.

    Raises:
        MeshFileError: it has no header that can be read, or fewer rows, or fewer values in one, than declared.
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        match path.suffix.lower():
            case ".ply":
                check_ply_rows(file, path.stat().st_size, read_ply_header(file))
            case ".off":
                check_off_rows(file, *read_off_counts(file))
