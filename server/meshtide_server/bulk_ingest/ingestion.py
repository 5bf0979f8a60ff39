"""Files on their way into store and catalogue: each is encoded by a worker and published from here.

As many files are under way as there are workers for, and a few more; the next one is taken when one is through. A file
that fails is reported and stops no other. What keeps every file from being published, such as a lost database, ends the
ingest after a few attempts: the files that are left are reported as not begun. Published is a mesh or it is not, see
`publishing`; so whatever ends this, it goes on where it stopped when it is run again.
"""

from __future__ import annotations

import asyncio
import logging
from typing import TYPE_CHECKING, Protocol

from meshtide_codec.errors import MeshFileError, MeshtideError, TransferError
from meshtide_codec.file_suffix import split_name
from meshtide_codec.printable import listed_name
from meshtide_server.bulk_ingest.encode_file import FileTask
from meshtide_server.catalogue import DatabaseUnavailableError, MeshExistsError, Status
from meshtide_server.encoding.process import ProcessLimits
from meshtide_server.encoding.uploads import checked_suffix
from meshtide_server.hosting.identifiers import unique_id
from meshtide_server.hosting.publishing import Publication, publish
from meshtide_server.hosting.stream_cache import codec_digest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from meshtide_server.bulk_ingest.encode_file import FileOutcome
    from meshtide_server.catalogue import Box, Catalogue
    from meshtide_server.settings import Settings
    from meshtide_server.store import Store

logger = logging.getLogger("meshtide.server")

PAUSES = (0.5, 2.0, 5.0)
"""Seconds between attempts to publish, while store or database do not answer."""
PUBLISHERS = 8
"""Files that are published at a time: fewer than there are connections to the database, for each holds one."""


class ChosenFile(Protocol):
    """A file that is to be published."""

    @property
    def file(self) -> Path:
        """Itself."""

    @property
    def digest(self) -> str:
        """SHA-256 of its content, in hexadecimal."""

    @property
    def mesh(self) -> str | None:
        """Id of the mesh that it replaces, or None for a new one."""


class Encoders(Protocol):
    """Whoever encodes."""

    @property
    def capacity(self) -> int:
        """How many files may be under way."""

    async def encode(self, task: FileTask) -> FileOutcome:
        """Encode a file.

        Raises:
            TransferError: nobody can, now or for the files that follow.
        """


class Ingestion:
    """Publishes files, many at a time.

    Args:
        store: takes the streams.
        catalogue: takes the meshes.
        encoders: make the streams.
        settings: limits of a file, and how it is encoded.
        tags: of all meshes.
        licence: the text of their terms.
        taken: ids that are not free.
        report: called for each file that is through: itself, its mesh, "done", "kept", "failed" or "left", why, and
            what of it is not kept.
    """

    def __init__(
        self,
        store: Store,
        catalogue: Catalogue,
        encoders: Encoders,
        settings: Settings,
        *,
        tags: tuple[str, ...],
        licence: str,
        taken: set[str],
        report: Callable[[Path, str | None, str, str | None, tuple[str, ...]], None],
    ) -> None:
        self._store = store
        self._catalogue = catalogue
        self._encoders = encoders
        self._settings = settings
        self._tags = tags
        self._licence = licence
        self._taken = taken
        self._report = report
        self._publishers = asyncio.Semaphore(PUBLISHERS)
        self._stopped: str | None = None

    async def run(self, files: Iterable[ChosenFile]) -> None:
        """Publish `files`, which are taken one by one, in another thread."""
        waiting = iter(files)
        running: set[asyncio.Task[None]] = set()
        chosen: ChosenFile | None
        more = True
        try:
            while more or running:
                while more and len(running) < self._encoders.capacity:
                    chosen = await asyncio.to_thread(next, waiting, None)
                    if chosen is None:
                        more = False
                    else:
                        mesh_id = chosen.mesh or self._free_id(chosen.file)
                        running.add(asyncio.create_task(self._ingest(chosen, mesh_id)))
                if running:
                    _, running = await asyncio.wait(running, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in running:
                task.cancel()
            await asyncio.gather(*running, return_exceptions=True)

    async def _ingest(self, chosen: ChosenFile, mesh_id: str) -> None:
        """Publish a file, and report what became of it."""
        if self._stopped is not None:
            self._report(chosen.file, None, "left", f"not begun: {self._stopped}", ())
            return
        try:
            found, state, notes = await self._published(chosen, mesh_id)
        except (TransferError, DatabaseUnavailableError) as error:
            self._stopped = self._stopped or str(error)
            self._report(chosen.file, None, "failed", str(error), ())
        except (MeshtideError, OSError) as error:
            self._report(chosen.file, None, "failed", str(error), ())
        except Exception as error:  # one file must not end the work on all others
            logger.exception("while %s was ingested", chosen.file)
            self._report(chosen.file, None, "failed", f"internal error: {type(error).__name__}", ())
        else:
            self._report(chosen.file, found, state, None, notes)

    async def _published(self, chosen: ChosenFile, mesh_id: str) -> tuple[str, str, tuple[str, ...]]:
        """The id under which the file's mesh is in the catalogue, whether it was "kept" or is "done", and the notes."""
        checked_suffix(chosen.file.name)
        size = (await asyncio.to_thread(chosen.file.stat)).st_size
        if size > self._settings.max_upload:
            most = self._settings.max_upload
            raise MeshFileError(f"{chosen.file} has {size} bytes; {most} are taken (MESHTIDE_MAX_UPLOAD)")
        if chosen.mesh is None and (twin := await self._ready_twin(chosen)) is not None:
            return twin, "kept", ()
        stream, box, notes = await self._encoded(chosen)
        for pause in PAUSES:
            try:
                async with self._publishers:
                    return *await self._show(chosen, mesh_id, stream, box), notes
            except (TransferError, DatabaseUnavailableError) as error:
                logger.warning("%s cannot be published now: %s", chosen.file, error)
                await asyncio.sleep(pause)
        async with self._publishers:
            return *await self._show(chosen, mesh_id, stream, box), notes

    async def _encoded(self, chosen: ChosenFile) -> tuple[bytes, Box | None, tuple[str, ...]]:
        settings = self._settings
        task = FileTask(
            chosen.file.absolute(),
            chosen.digest,
            settings.encoding,
            settings.file_limits,
            settings.stream_limits,
            ProcessLimits(settings.job_memory, settings.job_processor_seconds),
            settings.job_seconds,
            codec_digest(),
        )
        outcome = await self._encoders.encode(task)
        if outcome.stream is None:
            raise MeshFileError(outcome.error or _changed(chosen))
        return outcome.stream, outcome.box, outcome.notes

    async def _show(self, chosen: ChosenFile, mesh_id: str, stream: bytes, box: Box | None) -> tuple[str, str]:
        """Publish a stream; under another id, if somebody else has taken this one meanwhile."""
        limits = self._settings.stream_limits
        while True:
            publication = Publication(mesh_id, listed_name(chosen.file), self._tags, self._licence, chosen.digest, box)
            try:
                await publish(
                    self._store, self._catalogue, stream, publication, overwrite=chosen.mesh is not None, limits=limits
                )
            except MeshExistsError:
                twin = await self._ready_twin(chosen)  # by a second ingest of these files, or by our own last attempt
                if twin is not None:
                    return twin, "done"
                mesh_id = self._free_id(chosen.file)
            else:
                return mesh_id, "done"

    async def _ready_twin(self, chosen: ChosenFile) -> str | None:
        """The id of a mesh that was made of the same content."""
        twin = await self._catalogue.meshes.find_source(chosen.digest)
        return twin.id if twin is not None and twin.state == Status.READY else None

    def _free_id(self, file: Path) -> str:
        found = unique_id(*split_name(file), self._taken)
        self._taken.add(found)
        return found


def _changed(chosen: ChosenFile) -> str:
    return f"{chosen.file} was changed while it was ingested; run it again"
