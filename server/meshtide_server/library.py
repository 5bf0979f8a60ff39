"""The library: all hosted meshes, found in a folder, checked, encoded where needed, and looked at again now and then.

Three tasks work side by side: one looks for new, changed and vanished files; one checks streams and finds cached
ones, in a thread; one has the remaining meshes encoded, one after the other, in the encoder's process. A mesh that
fails says so in its state and stops nobody.
"""

from __future__ import annotations

import asyncio
import logging
import tempfile
import time
from collections import Counter
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from meshtide_codec.errors import MeshtideError
from meshtide_codec.file_suffix import split_name
from meshtide_codec.printable import printable
from meshtide_codec.samples import sample_names
from meshtide_server import metrics
from meshtide_server.block_cache import BlockCache
from meshtide_server.catalogue import Catalogue
from meshtide_server.encoder_process import EncoderProcess, Job
from meshtide_server.file_names import folders_of, without_folders
from meshtide_server.folder_listing import list_sources
from meshtide_server.hosted_mesh import HostedMesh, Source, Status
from meshtide_server.hosted_stream import HostedStream, StoppedError, load_stream
from meshtide_server.identifiers import LONGEST_ID, path_id, slug, unique_id
from meshtide_server.kept_meshes import KeptMeshes
from meshtide_server.packet_index import PacketIndex, PacketPlace
from meshtide_server.publishing import collect_unused
from meshtide_server.storage import FileStorage, MemoryStorage, Storage
from meshtide_server.store import open_store
from meshtide_server.stream_cache import (
    CachePlace,
    cache_folders,
    file_digest,
    name_prefix,
    stream_key,
)
from meshtide_server.uploads import collect_orphans

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from meshtide_server.searching import Search
    from meshtide_server.settings import Settings

logger = logging.getLogger("meshtide.server")

Result = TypeVar("Result")

COLLECT_SECONDS = 600.0
"""How often streams that no mesh has, and uploads that no job needs, are looked for in the store."""
REPORT_SECONDS = 5.0
"""Progress within a stage is logged at most this often."""


class Library:
    """The meshes of one server.

    Args:
        settings: what is hosted and how.

    Call `start` and, at the end, `stop`; between the two, meshes appear and their states advance by themselves.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._options = settings.encoding
        self._meshes: dict[str, HostedMesh] = {}
        self._packets = PacketIndex()
        self.kept: KeptMeshes | None = None
        """Store and catalogue, where meshes are published; None if there are none."""
        self._to_check: asyncio.Queue[HostedMesh] = asyncio.Queue()
        self._to_encode: asyncio.Queue[tuple[HostedMesh, CachePlace, str]] = asyncio.Queue()
        self._unfinished = 0
        self._settled = asyncio.Event()
        self.looked_through = False
        """Whether everything that was found at the start has been looked at: what is ready then can be served."""
        self._tasks: list[asyncio.Task[None]] = []
        self._encoder = EncoderProcess()
        self._hidden = folders_of(settings)
        self._stopping = False
        self._scratch = ExitStack()
        self._folders: dict[Path | None, tuple[Path, ...]] = {}

    @property
    def meshes(self) -> Sequence[HostedMesh]:
        """Those of the folder and the samples, in the order of their ids."""
        return sorted(self._meshes.values(), key=lambda mesh: mesh.id)

    @property
    def counts(self) -> Counter[Status]:
        """How many meshes are in which state, those of the catalogue a few seconds ago."""
        counts = Counter(mesh.status for mesh in self._meshes.values())
        for state, count in self.kept.counts.items() if self.kept is not None else ():
            counts[Status(state.value)] += count
        return counts

    def find(self, identifier: str) -> HostedMesh | None:
        """The mesh with that id, if it is in memory; one of the folder before one of the catalogue."""
        found = self._meshes.get(identifier)
        return self.kept.known(identifier) if found is None and self.kept is not None else found

    async def look_up(self, identifier: str) -> HostedMesh | None:
        """The mesh with that id, wherever it is.

        Raises:
            DatabaseUnavailableError: the catalogue does not answer.
            StoreError, OSError: the stream cannot be had.
        """
        found = self.find(identifier)
        return await self.kept.find(identifier) if found is None and self.kept is not None else found

    async def look_up_packet(self, digest: bytes) -> PacketPlace | None:
        """Where the packet whose bytes have that SHA-256 lies; raises as `look_up` does."""
        found = self._packets.find(digest)
        return await self.kept.find_packet(digest) if found is None and self.kept is not None else found

    async def page(self, search: Search, limit: int) -> tuple[list[HostedMesh], bool]:
        """The meshes that are asked for, in the order of their ids, and whether more may follow.

        Args:
            search: which ones.
            limit: how many at most.

        Raises:
            DatabaseUnavailableError: the catalogue does not answer.
        """
        found = search.chosen(self.meshes)
        kept, more = await self.kept.page(search, self._meshes, limit) if self.kept is not None else ([], False)
        merged = sorted([*found[:limit], *kept], key=lambda mesh: mesh.id)
        return merged[:limit], more or len(found) > limit or len(merged) > limit

    async def taken_ids(self, name: str) -> set[str]:
        """The ids in use that a file of that name, without its suffix, could be given as well."""
        start = slug(name)[: LONGEST_ID // 2]
        return {*self._meshes, *(await self.kept.catalogue.meshes.ids(start) if self.kept is not None else ())}

    async def start(self) -> None:
        """Find the meshes and begin to work on them."""
        for name in sample_names() if self._settings.samples else ():
            self._add(Source(name))
        await self._scan_safely(settle=False)
        if self._settings.keeps_meshes:
            await self._open_kept()
        if not self._meshes and self.kept is None:
            logger.warning("there are no meshes in %s", self._settings.directory)
        self._tasks = [
            asyncio.create_task(self._check_all(), name="check streams"),
            asyncio.create_task(self._encode_all(), name="encode meshes"),
        ]
        if self._settings.directory is not None and self._settings.rescan_seconds > 0:
            self._tasks.append(asyncio.create_task(self._rescan(), name="look for files"))
        if self.kept is not None:
            self._tasks.append(asyncio.create_task(self._follow_catalogue(self.kept), name="follow the catalogue"))
        self.looked_through = not self._meshes
        self._note_if_settled()

    async def stop(self) -> None:
        """End what is under way; nothing half done is left on the disk."""
        self._stopping = True
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._encoder.close()
        if self.kept is not None:
            await self.kept.close()
        await asyncio.to_thread(self._scratch.close)

    async def reason_to_wait(self) -> str | None:
        """Why not all that could be served is served yet, or None; meshes that wait to be encoded are no reason."""
        return None if self.looked_through else "the meshes are being looked through"

    async def settled(self) -> None:
        """Wait until every mesh that is known by then is ready or has failed."""
        await self._settled.wait()

    def _add(self, source: Source, identifier: str | None = None) -> None:
        mesh = HostedMesh(identifier or self._new_id(source), source)
        self._meshes[mesh.id] = mesh
        self._packets.remove(mesh.id)
        self._unfinished += 1
        self._settled.clear()
        self._to_check.put_nowait(mesh)

    def _new_id(self, source: Source) -> str:
        path, directory = source.path, self._settings.directory
        if path is None or directory is None:
            return unique_id(source.name, "-sample", self._meshes)
        return path_id(path.relative_to(directory).parts[:-1], *split_name(path), self._meshes)

    def _note_if_settled(self) -> None:
        if self._unfinished == 0:
            self._settled.set()

    def _finish(self, mesh: HostedMesh, outcome: HostedStream | str) -> None:
        """Note the stream of `mesh`, or why there is none."""
        if isinstance(outcome, HostedStream):
            mesh.succeed(outcome)
            if self._meshes.get(mesh.id) is mesh:
                self._packets.add(mesh.id, outcome)
            logger.info(
                "%s is ready: %d vertices, %d faces, %d levels, %d bytes",
                mesh.id,
                outcome.header.vertices,
                outcome.header.faces,
                len(outcome.header.levels),
                outcome.size,
            )
        else:
            mesh.fail(without_folders(outcome, self._hidden))
            logger.error("%s cannot be served: %s", mesh.id, outcome)
        self._unfinished -= 1
        self._note_if_settled()

    @contextmanager
    def _failing(self, mesh: HostedMesh, doing: str) -> Iterator[None]:
        """What goes wrong in the block becomes the mesh's state, and stops no other."""
        try:
            yield
        except (MeshtideError, OSError) as error:
            self._finish(mesh, str(error))
        except Exception as error:
            logger.exception("while %s was %s", mesh.id, doing)
            metrics.fault("library")
            self._finish(mesh, f"internal error: {type(error).__name__}")

    # Meshes of store and catalogue

    async def _open_kept(self) -> None:
        store = await asyncio.to_thread(open_store, self._settings.store_url)
        catalogue = await Catalogue.open(self._settings.database_url)
        self.kept = KeptMeshes(store, catalogue, BlockCache(self._settings.store_cache_mib << 20))
        await self.kept.refresh()

    async def _follow_catalogue(self, kept: KeptMeshes) -> None:
        collected: float | None = None
        while True:
            await asyncio.sleep(self._settings.catalogue_seconds)
            try:
                await kept.refresh()
                if collected is None or time.monotonic() - collected > COLLECT_SECONDS:
                    collected = time.monotonic()
                    for sha256 in await collect_unused(kept.store, kept.catalogue):
                        logger.info("deleted stream %s, which no mesh has", sha256)
                    for key in await collect_orphans(kept.store, kept.catalogue):
                        logger.info("deleted upload %s, which no job needs", key)
            except MeshtideError as error:
                logger.warning("the catalogue cannot be followed: %s", error)
            except Exception:
                logger.exception("while the catalogue was followed")
                metrics.fault("library")

    # Looking for files

    async def _rescan(self) -> None:
        while True:
            await asyncio.sleep(self._settings.rescan_seconds)
            await self._scan_safely(settle=True)

    async def _scan_safely(self, *, settle: bool) -> None:
        try:
            await self._scan(settle=settle)
        except OSError as error:
            logger.warning("cannot look into %s: %s", self._settings.directory, error.strerror or error)

    async def _scan(self, *, settle: bool) -> None:
        """Compare the folder with what is known; with `settle`, leave files alone that are still being written."""
        directory = self._settings.directory
        if directory is None:
            return
        recursive = self._settings.recursive
        found = await asyncio.to_thread(list_sources, directory, recursive=recursive)
        known = {mesh.source.path: mesh for mesh in self._meshes.values()}
        if settle and any(_is_news(source, known) for source in found):
            await asyncio.sleep(min(1.0, self._settings.rescan_seconds))
            before = {source.path: source.identity for source in found}
            again = await asyncio.to_thread(list_sources, directory, recursive=recursive)
            growing = {source.path for source in again if before.get(source.path) != source.identity}
        else:
            again, growing = found, set()
        for path in known.keys() - {source.path for source in again} - {None}:
            logger.info("%s is gone", known[path].id)
            del self._meshes[known[path].id]
            self._packets.remove(known[path].id)
        for source in again:
            if source.path not in growing and _is_news(source, known):
                mesh = known.get(source.path)
                self._add(source, mesh.id if mesh else None)

    # Checking streams

    async def _check_all(self) -> None:
        while True:
            mesh = await self._to_check.get()
            mesh.advance("check")
            with self._failing(mesh, "checked"):
                await self._check(mesh)
            self.looked_through |= self._to_check.empty()

    async def _check(self, mesh: HostedMesh) -> None:
        path = mesh.source.path
        if mesh.source.is_stream and path is not None:
            self._finish(mesh, await self._in_thread(lambda: self._load(FileStorage(path))))
            return
        place, digest = await self._in_thread(lambda: self._cache_place(mesh.source))
        stream = await self._in_thread(lambda: self._from_cache(place))
        if stream is not None:
            await self._in_thread(place.prune)
            self._finish(mesh, stream)
        else:
            mesh.advance("waiting")
            self._to_encode.put_nowait((mesh, place, digest))

    def _load(self, storage: Storage) -> HostedStream:
        return load_stream(storage, stopping=lambda: self._stopping)

    def _cache_place(self, source: Source) -> tuple[CachePlace, str]:
        digest = file_digest(source.path, lambda: self._stopping) if source.path else f"sample {source.name}"
        directory = self._settings.directory if source.path else None
        if directory not in self._folders:
            self._folders[directory] = cache_folders(directory, self._settings.cache, self._make_scratch)
        place = CachePlace(
            self._folders[directory], name_prefix(source.name, self._options), stream_key(digest, self._options)
        )
        return place, digest

    def _make_scratch(self) -> Path:
        return Path(self._scratch.enter_context(tempfile.TemporaryDirectory(prefix="meshtide-")))

    def _from_cache(self, place: CachePlace) -> HostedStream | None:
        path = place.find()
        if path is None:
            return None
        try:
            return self._load(FileStorage(path))
        except (MeshtideError, OSError) as error:
            logger.warning("%s is damaged and will be made anew: %s", path, error)
            with suppress(OSError):
                path.unlink()
            return None

    async def _in_thread(self, work: Callable[[], Result]) -> Result:
        try:
            return await asyncio.to_thread(work)
        except StoppedError:
            raise asyncio.CancelledError from None

    # Encoding

    async def _encode_all(self) -> None:
        while True:
            mesh, place, digest = await self._to_encode.get()
            if self._meshes.get(mesh.id) is not mesh:  # removed or replaced while it waited
                self._unfinished -= 1
                self._note_if_settled()
                continue
            with self._failing(mesh, "encoded"):
                await self._encode(mesh, place, digest)
            if self._unfinished == 0:
                await self._encoder.close()  # it holds memory, and there is nothing for it to do

    async def _encode(self, mesh: HostedMesh, place: CachePlace, digest: str) -> None:
        source = mesh.source
        job = Job(source.path, None if source.path else source.name, digest, self._options, place.paths)
        started = time.monotonic()
        encoded = await self._encoder.encode(job, _ProgressLog(mesh))
        logger.info("%s was encoded in %.1f s", mesh.id, time.monotonic() - started)
        for note in encoded.notes:
            logger.info("%s: %s", mesh.id, printable(note))
        for problem in encoded.problems:
            logger.warning("the stream of %s cannot be stored in %s", mesh.id, problem)
        if encoded.path is None:
            logger.warning("the stream of %s is kept in memory until the server stops, then lost", mesh.id)
        storage = FileStorage(encoded.path) if encoded.path else MemoryStorage(encoded.data)
        stream = await self._in_thread(lambda: self._load(storage))
        await self._in_thread(place.prune)
        self._finish(mesh, stream)


class _ProgressLog:
    """Notes progress in a mesh's state, and the stages of it in the log."""

    def __init__(self, mesh: HostedMesh) -> None:
        self._mesh = mesh
        self._logged = 0.0

    def __call__(self, stage: str, fraction: float) -> None:
        now = time.monotonic()
        if stage != self._mesh.stage or now - self._logged >= REPORT_SECONDS:
            self._logged = now
            logger.info("%s is being encoded: %s, %.0f %%", self._mesh.id, stage, 100 * fraction)
        self._mesh.advance(stage, fraction)


def _is_news(source: Source, known: Mapping[Path | None, HostedMesh]) -> bool:
    """Whether a file is new or changed, or the stream that was made of it is gone."""
    mesh = known.get(source.path)
    if mesh is None:
        return True
    lost = mesh.stream is not None and not mesh.stream.storage.unchanged()
    return mesh.source.identity != source.identity or lost
