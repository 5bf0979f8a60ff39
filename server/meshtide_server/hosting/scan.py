"""The job that looks for files: those that are new in the folder, have changed or are gone."""

from __future__ import annotations

import asyncio
import logging
from typing import TYPE_CHECKING

from meshtide_server.hosting.folder_listing import list_sources

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from meshtide_server.hosting.folder import FolderMeshes
    from meshtide_server.hosting.mesh import HostedMesh, MeshSource

logger = logging.getLogger("meshtide.server")

LONGEST_PAUSE = 1.0
"""Seconds between two looks at a new file, which show whether it is still being written; shorter if scans are."""


class Scan:
    """Looks at the folder again and again.

    Args:
        folder: what is known of it.
        directory: the folder.
        recursive: whether its subfolders are looked into.
        seconds: how often; 0: once, by `look`.
    """

    def __init__(self, folder: FolderMeshes, directory: Path, *, recursive: bool, seconds: float) -> None:
        self._folder = folder
        self._directory = directory
        self._recursive = recursive
        self._seconds = seconds

    async def run(self) -> None:
        """Look again and again; never returns unless it is to look only once."""
        while self._seconds > 0:
            await asyncio.sleep(self._seconds)
            await self.look(settle=True)

    async def look(self, *, settle: bool) -> None:
        """Compare the folder with what is known.

        Args:
            settle: whether files are left alone that are still being written.
        """
        try:
            await self._compare(settle=settle)
        except OSError as error:
            logger.warning("cannot look into %s: %s", self._directory, error.strerror or error)

    async def _compare(self, *, settle: bool) -> None:
        known = {mesh.source.path: mesh for mesh in self._folder.meshes}
        found, growing = await self._list(), set[object]()
        if settle and any(_is_news(source, known) for source in found):
            before = {source.path: source.identity for source in found}
            await asyncio.sleep(min(LONGEST_PAUSE, self._seconds))
            found = await self._list()
            growing = {source.path for source in found if before.get(source.path) != source.identity}
        for path in known.keys() - {source.path for source in found} - {None}:
            logger.info("%s is gone", known[path].id)
            self._folder.remove(known[path].id)
        for source in found:
            if source.path not in growing and _is_news(source, known):
                mesh = known.get(source.path)
                self._folder.add(source, mesh.id if mesh else None)

    async def _list(self) -> list[MeshSource]:
        return await asyncio.to_thread(list_sources, self._directory, recursive=self._recursive)


def _is_news(source: MeshSource, known: Mapping[Path | None, HostedMesh]) -> bool:
    """Whether a file is new or changed, or the stream that was made of it is gone."""
    mesh = known.get(source.path)
    if mesh is None:
        return True
    lost = mesh.stream is not None and not mesh.stream.reader.unchanged()
    return mesh.source.identity != source.identity or lost
