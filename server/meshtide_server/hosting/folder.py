"""The meshes of the server's folder and the samples: which there are, and how far each is.

Three jobs work on them side by side: one looks for new, changed and vanished files (`scan`), one checks streams and
finds those that were encoded before (`check`), and one, in another room, has the others encoded. What one of them
leaves for the next waits in a queue here. A mesh that fails says so in its state and stops nobody.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from meshtide_codec.errors import MeshtideError
from meshtide_codec.file_suffix import split_name
from meshtide_server.hosting.file_names import without_folders
from meshtide_server.hosting.identifiers import path_id, unique_id
from meshtide_server.hosting.mesh import HostedMesh
from meshtide_server.hosting.packet_index import PacketIndex
from meshtide_server.hosting.search import chosen
from meshtide_server.hosting.stream import HostedStream, StoppedError, load_stream
from meshtide_server.operations import metrics

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterator, Sequence
    from pathlib import Path

    from meshtide_codec.stream.mesh_query import MeshQuery
    from meshtide_server.catalogue import Status
    from meshtide_server.hosting.mesh import MeshSource
    from meshtide_server.hosting.packet_index import PacketPlace
    from meshtide_server.hosting.stream_cache import CachePlace
    from meshtide_server.store.range_reader import FileReader, MemoryReader

logger = logging.getLogger("meshtide.server")

Result = TypeVar("Result")


class Unencoded(NamedTuple):
    """A mesh of which no stream was found.

    Args:
        mesh: the mesh.
        place: where its stream belongs.
        digest: of the mesh file, as the cache knows it.
    """

    mesh: HostedMesh
    place: CachePlace
    digest: str


class FolderMeshes:
    """The meshes of the folder, and the samples.

    Args:
        directory: the folder, or None if there are only samples.
        hidden: folders whose places on the disk nobody learns.
    """

    def __init__(self, directory: Path | None, hidden: Sequence[Path]) -> None:
        self._directory = directory
        self._hidden = hidden
        self._meshes: dict[str, HostedMesh] = {}
        self._packets = PacketIndex()
        self.to_check: asyncio.Queue[HostedMesh] = asyncio.Queue()
        self.to_encode: asyncio.Queue[Unencoded] = asyncio.Queue()
        self._unfinished = 0
        self._settled = asyncio.Event()
        self._settled.set()
        self.stopping = False
        """Whether the server stops: what is under way in a thread is of no more use."""

    def __contains__(self, mesh_id: object) -> bool:
        return mesh_id in self._meshes

    def __len__(self) -> int:
        return len(self._meshes)

    @property
    def meshes(self) -> Sequence[HostedMesh]:
        """All of them, in the order of their ids."""
        return sorted(self._meshes.values(), key=lambda mesh: mesh.id)

    @property
    def counts(self) -> Counter[Status]:
        """How many are in which state."""
        return Counter(mesh.status for mesh in self._meshes.values())

    def known(self, mesh_id: str) -> HostedMesh | None:
        """The mesh of that id, or None."""
        return self._meshes.get(mesh_id)

    async def find(self, mesh_id: str) -> HostedMesh | None:
        """The same: all of them are in memory."""
        return self.known(mesh_id)

    async def find_packet(self, digest: bytes) -> PacketPlace | None:
        """Where the packet whose bytes have that SHA-256 lies."""
        return self._packets.find(digest)

    async def page(self, query: MeshQuery, without: Container[str], limit: int) -> tuple[list[HostedMesh], bool]:
        """The meshes that are asked for, in the order of their ids, and whether there are more.

        Args:
            query: which ones.
            without: ids that are left out.
            limit: how many at most.
        """
        found = [mesh for mesh in chosen(query, self.meshes) if mesh.id not in without]
        return found[:limit], len(found) > limit

    async def ids(self, start: str) -> set[str]:
        """The ids that begin so."""
        return {mesh_id for mesh_id in self._meshes if mesh_id.startswith(start)}

    def add(self, source: MeshSource, mesh_id: str | None = None) -> None:
        """Host a file or a sample; it is checked next.

        Args:
            source: the file or the sample.
            mesh_id: of the mesh that it replaces; None for a new one.
        """
        mesh = HostedMesh(mesh_id or self._new_id(source), source)
        self._meshes[mesh.id] = mesh
        self._packets.remove(mesh.id)
        self._unfinished += 1
        self._settled.clear()
        self.to_check.put_nowait(mesh)

    def remove(self, mesh_id: str) -> None:
        """Host a mesh no more."""
        del self._meshes[mesh_id]
        self._packets.remove(mesh_id)

    def is_current(self, mesh: HostedMesh) -> bool:
        """Whether `mesh` has neither been removed nor replaced."""
        return self._meshes.get(mesh.id) is mesh

    def finish(self, mesh: HostedMesh, outcome: HostedStream | str | None) -> None:
        """Note the stream of `mesh`, or why there is none; None if it is not wanted any more."""
        if isinstance(outcome, HostedStream):
            mesh.succeed(outcome)
            if self.is_current(mesh):
                self._packets.add(mesh.id, outcome)
            logger.info(
                "%s is ready: %d vertices, %d faces, %d levels, %d bytes",
                mesh.id,
                outcome.header.vertices,
                outcome.header.faces,
                len(outcome.header.levels),
                outcome.size,
            )
        elif outcome is not None:
            mesh.fail(without_folders(outcome, self._hidden))
            logger.error("%s cannot be served: %s", mesh.id, outcome)
        self._unfinished -= 1
        if self.idle:
            self._settled.set()

    @contextmanager
    def failing(self, mesh: HostedMesh, doing: str) -> Iterator[None]:
        """What goes wrong in the block becomes the mesh's state, and stops no other."""
        try:
            yield
        except (MeshtideError, OSError) as error:
            self.finish(mesh, str(error))
        except Exception as error:
            logger.exception("while %s was %s", mesh.id, doing)
            metrics.fault("library")
            self.finish(mesh, f"internal error: {type(error).__name__}")

    @property
    def idle(self) -> bool:
        """Whether every mesh is ready or has failed."""
        return self._unfinished == 0

    async def settled(self) -> None:
        """Wait until every mesh that is known by then is ready or has failed."""
        await self._settled.wait()

    async def load(self, file: FileReader | MemoryReader) -> HostedStream:
        """The stream in `file`, checked in a thread; raises as `load_stream` does."""
        return await self.in_thread(lambda: load_stream(file, stopping=lambda: self.stopping))

    async def in_thread(self, work: Callable[[], Result]) -> Result:
        """What `work` returns; it is called in a thread and may raise StoppedError, which ends the task."""
        try:
            return await asyncio.to_thread(work)
        except StoppedError:
            raise asyncio.CancelledError from None

    def _new_id(self, source: MeshSource) -> str:
        path, directory = source.path, self._directory
        if path is None or directory is None:
            return unique_id(source.name, "-sample", self._meshes)
        return path_id(path.relative_to(directory).parts[:-1], *split_name(path), self._meshes)
