"""What is hosted of a folder: its streams and mesh files, and, if that is wanted, those of its subfolders.

What begins with a dot is left out. Nothing outside of the folder is ever hosted: links to folders are not followed, and
a link to a file counts only if the file lies within the folder as well.
"""

from __future__ import annotations

import logging
import os
from contextlib import suppress
from typing import TYPE_CHECKING

from meshtide_codec.mesh_files import is_mesh_path
from meshtide_codec.printable import listed_name
from meshtide_server.hosting.mesh import TIDE_SUFFIX, MeshSource
from meshtide_server.store.range_reader import FileIdentity

if TYPE_CHECKING:
    from pathlib import Path

logger = logging.getLogger("meshtide.server")

DEEPEST = 8
"""Subfolders within each other that are looked into."""
MOST_FILES = 100_000
"""Files that are hosted."""


def list_sources(directory: Path, *, recursive: bool = False) -> list[MeshSource]:
    """The streams and meshes in a folder, streams first, in the order of their places in it.

    Args:
        directory: the folder, without links in its own path.
        recursive: whether subfolders are looked into.

    Raises:
        OSError: the folder cannot be read; subfolders that cannot are left out.
    """
    sources: list[MeshSource] = []
    folders = [directory]
    while folders:
        folder = folders.pop()
        try:
            entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
        except OSError as error:
            if folder == directory:
                raise
            logger.debug("cannot look into %s: %s", folder, error.strerror or error)
            continue
        for entry in entries:
            if entry.name.startswith("."):
                continue
            path = folder / entry.name
            with suppress(OSError):  # it may vanish while we look
                if entry.is_dir(follow_symlinks=False):
                    if recursive and len(path.relative_to(directory).parts) <= DEEPEST:
                        folders.append(path)
                elif _is_hosted(path) and path.is_file() and _is_within(path, directory):
                    sources.append(MeshSource(listed_name(path), path, FileIdentity.of(path.stat())))
        if len(sources) > MOST_FILES:
            logger.warning("%s holds more than %d meshes; the others are not hosted", directory, MOST_FILES)
            break
    sources.sort(key=lambda source: (not source.is_stream, source.path))
    return sources[:MOST_FILES]


def _is_hosted(path: Path) -> bool:
    return path.suffix.lower() == TIDE_SUFFIX or is_mesh_path(path)


def _is_within(path: Path, directory: Path) -> bool:
    return not path.is_symlink() or path.resolve().is_relative_to(directory)
