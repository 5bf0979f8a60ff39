"""The library: all meshes that a server hosts, those of its folder and those that are published, as one.

It answers what is where, and keeps the jobs running that look for files (`scan`), check streams (`check`) and follow
the catalogue (`following`). A queue of the folder holds the meshes that have to be encoded.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from typing import TYPE_CHECKING, Protocol

from meshtide_codec.samples import sample_names
from meshtide_server.catalogue import Status
from meshtide_server.hosting.check import Check
from meshtide_server.hosting.file_names import folders_of
from meshtide_server.hosting.folder import FolderMeshes
from meshtide_server.hosting.following import follow
from meshtide_server.hosting.identifiers import LONGEST_ID, slug
from meshtide_server.hosting.mesh import MeshSource
from meshtide_server.hosting.published import open_published
from meshtide_server.hosting.scan import Scan

if TYPE_CHECKING:
    from collections.abc import Container, Coroutine, Mapping
    from typing import Any

    from meshtide_codec.stream.mesh_query import MeshQuery
    from meshtide_server.hosting.mesh import HostedMesh
    from meshtide_server.hosting.packet_index import PacketPlace
    from meshtide_server.hosting.published import PublishedMeshes
    from meshtide_server.settings import Settings

logger = logging.getLogger("meshtide.server")


class Shelf(Protocol):
    """Some of the meshes that are hosted. What looks something up may raise StoreError and CatalogueError."""

    @property
    def counts(self) -> Mapping[Status, int]:
        """How many are in which state."""

    def known(self, mesh_id: str) -> HostedMesh | None:
        """The mesh of that id, if it is in memory."""

    async def find(self, mesh_id: str) -> HostedMesh | None:
        """The mesh of that id, wherever it is."""

    async def find_packet(self, digest: bytes) -> PacketPlace | None:
        """Where the packet whose bytes have that SHA-256 lies."""

    async def page(self, query: MeshQuery, without: Container[str], limit: int) -> tuple[list[HostedMesh], bool]:
        """The meshes that are asked for, without those ids, in the order of ids, and whether there are more."""

    async def ids(self, start: str) -> set[str]:
        """The ids that begin so."""


class Library:
    """The meshes of one server.

    Args:
        settings: what is hosted and how.

    Call `start` and, at the end, `stop`; between the two, meshes appear and their states advance by themselves.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.folder = FolderMeshes(settings.directory, folders_of(settings))
        """The meshes of the folder, and the samples."""
        self.published: PublishedMeshes | None = None
        """Those of store and catalogue; None if there are none."""
        self._check = Check(self.folder, settings)
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def shelves(self) -> tuple[Shelf, ...]:
        """Where meshes are, the folder first: what it has hides what is published under the same id."""
        return (self.folder,) if self.published is None else (self.folder, self.published)

    @property
    def counts(self) -> Counter[Status]:
        """How many meshes are in which state, those of the catalogue a few seconds ago."""
        return sum((Counter(shelf.counts) for shelf in self.shelves), Counter[Status]())

    def known(self, mesh_id: str) -> HostedMesh | None:
        """The mesh of that id, if it is in memory."""
        return next((mesh for shelf in self.shelves if (mesh := shelf.known(mesh_id)) is not None), None)

    async def find(self, mesh_id: str) -> HostedMesh | None:
        """The mesh of that id, wherever it is.

        Raises:
            DatabaseUnavailableError: the catalogue does not answer.
            StoreError, OSError: the stream cannot be had.
        """
        for shelf in self.shelves:
            if (mesh := await shelf.find(mesh_id)) is not None:
                return mesh
        return None

    async def find_packet(self, digest: bytes) -> PacketPlace | None:
        """Where the packet whose bytes have that SHA-256 lies; raises as `find` does."""
        for shelf in self.shelves:
            if (place := await shelf.find_packet(digest)) is not None:
                return place
        return None

    async def page(self, query: MeshQuery, limit: int) -> tuple[list[HostedMesh], bool]:
        """The meshes that are asked for, in the order of their ids, and whether more may follow.

        Args:
            query: which ones.
            limit: how many at most.

        Raises:
            DatabaseUnavailableError: the catalogue does not answer.
        """
        merged: list[HostedMesh] = []
        more = False
        for shelf in self.shelves:
            found, further = await shelf.page(query, () if shelf is self.folder else self.folder, limit)
            merged += found
            more |= further
        return sorted(merged, key=lambda mesh: mesh.id)[:limit], more or len(merged) > limit

    async def taken_ids(self, name: str) -> set[str]:
        """The ids in use that a file of that name, without its suffix, could be given as well."""
        start = slug(name)[: LONGEST_ID // 2]
        return {mesh_id for shelf in self.shelves for mesh_id in await shelf.ids(start)}

    async def start(self) -> None:
        """Find the meshes and begin to work on them."""
        settings = self._settings
        for name in sample_names() if settings.samples else ():
            self.folder.add(MeshSource(name))
        if settings.directory is not None:
            scan = Scan(self.folder, settings.directory, recursive=settings.recursive, seconds=settings.rescan_seconds)
            await scan.look(settle=False)
            self._begin(scan.run(), "look for files")
        if settings.keeps_meshes:
            self.published = await open_published(settings)
            self._begin(follow(self.published, settings.catalogue_seconds), "follow the catalogue")
        elif not self.folder:
            logger.warning("there are no meshes in %s", settings.directory)
        self._check.looked_through = not self.folder
        self._begin(self._check.run(), "check streams")

    async def stop(self) -> None:
        """End what is under way; nothing half done is left on the disk."""
        self.folder.stopping = True
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        if self.published is not None:
            await self.published.close()
        await self._check.close()

    async def reason_to_wait(self) -> str | None:
        """Why not all that could be served is served yet, or None; meshes that wait to be encoded are no reason."""
        return None if self._check.looked_through else "the meshes are being looked through"

    def _begin(self, work: Coroutine[Any, Any, None], name: str) -> None:
        self._tasks.append(asyncio.create_task(work, name=name))
