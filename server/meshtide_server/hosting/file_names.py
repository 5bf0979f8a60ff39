"""Words for clients name files as those who look at a server know them, never where on its disk they lie.

Reasons why a mesh cannot be served come from readers, from the system and from libraries, and quote paths. What lies in
one of the server's folders is named by its place within that folder.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from meshtide_server.settings import Settings


def without_folders(text: str, folders: Iterable[Path]) -> str:
    """`text` in which files within `folders` are named by their places there, and the folders by their names.

    >>> without_folders("/srv/meshes/a/vase.obj: bad; /srv/meshes: full", [Path("/srv/meshes")])
    'a/vase.obj: bad; meshes: full'
    """
    spellings = {str(way) for folder in folders for way in (folder, folder.absolute(), folder.resolve())}
    for spelling in sorted(spellings - {os.sep, ".", ""}, key=len, reverse=True):
        text = text.replace(f"{spelling}{os.sep}", "").replace(spelling, Path(spelling).name)
    return text


def folders_of(settings: Settings) -> tuple[Path, ...]:
    """The folders in which a server reads and writes."""
    chosen = (settings.directory, settings.cache, settings.data, Path(settings.store) if settings.store else None)
    return tuple(folder for folder in (*chosen, Path(tempfile.gettempdir())) if folder is not None)
