"""Mesh files and streams in folders, and what in them has such a name but cannot be read as a file."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable


class Skipped(NamedTuple):
    """Something in a folder that is passed over, and why, as the end of a sentence that begins with its name.

    Attributes:
        path: of it.
        reason: why.
        failed: whether files may be missing by it, as in a folder that cannot be read.
    """

    path: Path
    reason: str
    failed: bool = False


def oddity(path: Path) -> str | None:
    """Why `path` cannot be read as a file or a folder; None if it can be tried.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     link = Path(folder) / "a.ply"
    ...     link.symlink_to("gone.ply")
    ...     oddity(link), oddity(Path(folder))
    ('is a link that leads nowhere', None)
    """
    try:
        mode = path.stat().st_mode
    except OSError as error:
        return "is a link that leads nowhere" if path.is_symlink() else f"cannot be looked at: {error.strerror}"
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):
        return None
    return "is a pipe, no file" if stat.S_ISFIFO(mode) else "is a device or a socket, no file"


def found_below(folder: Path, wanted: Callable[[Path], bool]) -> tuple[list[Path], list[Skipped]]:
    """The files below a folder, at any depth, sorted, and what is passed over.

    Args:
        folder: where to look; folders in it are entered, links to folders are not, and are reported.
        wanted: whether a file of that name is.
    """
    files: list[Path] = []
    skipped: list[Skipped] = []

    def unread(error: OSError) -> None:
        skipped.append(Skipped(Path(error.filename), f"cannot be read: {error.strerror}", failed=True))

    for place, folders, names in os.walk(folder, onerror=unread):
        links = [path for path in (Path(place, name) for name in folders) if path.is_symlink()]
        skipped += [Skipped(path, "is a link to a folder, which is not followed; name it to have it") for path in links]
        for path in (Path(place, name) for name in names):
            if wanted(path):
                reason = oddity(path)
                if reason is None:
                    files.append(path)
                else:
                    skipped.append(Skipped(path, reason))
    return sorted(files), sorted(skipped)
