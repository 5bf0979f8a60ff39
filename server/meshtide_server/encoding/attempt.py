"""One attempt at a job: the upload is fetched, encoded, and published, and whatever happens is noted in the catalogue.

There are three sorts of failure. What is wrong with the upload, such as a file that is not a mesh or takes longer
than a job may, fails the job for good. What may have been an accident, such as a process that died, is tried once more.
A fault of the server, such as a store that does not answer, is logged and counted as one; as long as the store is
away, the job goes back to the queue as if it had not been begun, so that no upload is lost by it.
"""

from __future__ import annotations

import asyncio
import logging
import tempfile
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshtideError
from meshtide_codec.printable import printable
from meshtide_server.catalogue import DatabaseUnavailableError, JobState, Status, UnknownJobError, UnknownMeshError
from meshtide_server.encoding.process import EncoderTask, EncodingFailedError
from meshtide_server.encoding_options import EncodingOptions
from meshtide_server.hosting.file_names import folders_of, without_folders
from meshtide_server.hosting.mesh import TIDE_SUFFIX
from meshtide_server.hosting.publishing import Publication, publish
from meshtide_server.hosting.stream_cache import file_digest
from meshtide_server.operations import metrics
from meshtide_server.operations.metrics import JobOutcome
from meshtide_server.operations.readiness import CHECK_SECONDS, check_store
from meshtide_server.store import StoreError, stream_key
from meshtide_server.store.keys import suffix_of

if TYPE_CHECKING:
    from meshtide_server.catalogue import Box, Job, MeshRecord
    from meshtide_server.encoding.process import EncoderProcess
    from meshtide_server.hosting.published import PublishedMeshes
    from meshtide_server.settings import Settings

logger = logging.getLogger("meshtide.server")

CHUNK = 1 << 22
"""Bytes of an upload that are fetched from the store at a time."""
HEARTBEATS = 8
"""Heartbeats within the time after which a job counts as lost."""
REST_SECONDS = 5.0
"""How long nothing is begun in the place of a job that went back to the queue because the store is away."""


class JobAttempt:
    """An attempt at a job that this server has claimed.

    Args:
        job: the job.
        owner: who claimed it.
        published: store and catalogue.
        settings: limits of a job.
    """

    def __init__(self, job: Job, owner: str, published: PublishedMeshes, settings: Settings) -> None:
        self._job = job
        self._owner = owner
        self._published = published
        self._settings = settings
        self._stage = ("starting", 0.0)
        self._lost = False
        self._box: Box | None = None
        self._notes: tuple[str, ...] = ()
        self._folder = ""
        """Where the upload is on this disk, which its sender must not learn."""

    async def run(self, encoder: EncoderProcess) -> None:
        """Work until the job has ended one way or another; if this is cancelled, it is still the owner's."""
        metrics.job_started()
        started = time.monotonic()
        outcome = JobOutcome.RELEASED
        work = asyncio.create_task(self._work(encoder), name=f"job {self._job.id}")
        heart = asyncio.create_task(self._beat(work), name=f"heartbeat of job {self._job.id}")
        try:
            outcome = await self._judged(work)
        except DatabaseUnavailableError as error:
            metrics.fault("catalogue")
            logger.warning("job %s will be released, how it ended cannot be noted: %s", self._job.id, error)
        finally:
            heart.cancel()
            metrics.job_ended(outcome, time.monotonic() - started)

    async def _judged(self, work: asyncio.Task[None]) -> JobOutcome:
        """Wait for the work; whatever comes of it is noted."""
        seconds = self._settings.job_seconds
        limit = asyncio.timeout(seconds)
        try:
            async with limit:
                await work
        except asyncio.CancelledError:
            if not self._lost:
                raise
            return self._released()
        except UnknownMeshError:
            return self._released()
        except EncodingFailedError as error:
            return await self._failed(str(error), retry=error.by_process)
        except (StoreError, DatabaseUnavailableError, OSError) as error:
            if limit.expired():
                return await self._failed(f"it took longer than {seconds:g} s", retry=False)
            return await self._at_fault(error)
        except MeshtideError as error:
            return await self._failed(str(error), retry=False)
        except Exception as error:  # one job must not end the work on all others
            logger.exception("while job %s of mesh %s was worked on", self._job.id, self._job.mesh_id)
            metrics.fault("jobs")
            return await self._failed(f"internal error: {type(error).__name__}", retry=True)
        return JobOutcome.DONE

    async def _failed(self, reason: str, *, retry: bool) -> JobOutcome:
        reason = self._for_sender(reason)
        after = await self._published.catalogue.jobs.fail(self._job.id, self._owner, reason, retry=retry)
        if after is None:
            return self._released()
        logger.warning("job %s of mesh %s failed: %s", self._job.id, self._job.mesh_id, reason)
        return JobOutcome.FAILED if after.state == JobState.FAILED else JobOutcome.RETRIED

    def _for_sender(self, text: str) -> str:
        """`text` without the places where files lie here."""
        return without_folders(text, (*([Path(self._folder)] if self._folder else []), *folders_of(self._settings)))

    def _released(self) -> JobOutcome:
        logger.info("job %s is not wanted here any more: released, replaced, or its mesh deleted", self._job.id)
        return JobOutcome.RELEASED

    async def _at_fault(self, error: Exception) -> JobOutcome:
        """Something of the server's own did not work; if it is the store, the job waits until it does."""
        job = await self._as_it_is()
        if job is None or job.owner != self._owner:  # whose upload may be gone by now
            return self._released()
        faults: dict[type[Exception], str] = {StoreError: "store", DatabaseUnavailableError: "catalogue"}
        part = next((part for kind, part in faults.items() if isinstance(error, kind)), "jobs")
        metrics.fault(part)
        name = type(error).__name__
        logger.error(
            "job %s of mesh %s met a fault of the server: %s: %s", self._job.id, self._job.mesh_id, name, error
        )
        try:
            async with asyncio.timeout(CHECK_SECONDS):
                await check_store(self._published.store)
        except (StoreError, OSError):
            await self._published.catalogue.jobs.hand_back(self._job.id, self._owner)
            await asyncio.sleep(REST_SECONDS)
            return JobOutcome.RELEASED
        return await self._failed(f"a fault of the server ({name}); its operator finds more in the log", retry=True)

    async def _beat(self, work: asyncio.Task[None]) -> None:
        """Report progress to the catalogue again and again; end the work if it is not this server's any more."""
        jobs = self._published.catalogue.jobs
        while True:
            with suppress(DatabaseUnavailableError):  # one that is away for a moment misses a beat
                if not await jobs.heartbeat(self._job.id, self._owner, *self._stage):
                    job = await self._as_it_is()
                    self._lost = job is None or job.state != JobState.DONE  # which it is if it was just published
                    if self._lost:
                        work.cancel()
                    return
            await asyncio.sleep(self._settings.job_lost_seconds / HEARTBEATS)

    async def _as_it_is(self) -> Job | None:
        """The job as the catalogue knows it now, None if it is gone."""
        try:
            return await self._published.catalogue.jobs.get(self._job.id)
        except UnknownJobError:
            return None

    async def _work(self, encoder: EncoderProcess) -> None:
        """Encode what the job names, unless the same was encoded before, and publish it."""
        catalogue, store = self._published.catalogue, self._published.store
        mesh = await catalogue.meshes.get(self._job.mesh_id)
        if self._job.description is not None:  # which the mesh that it replaces does not have yet
            mesh = replace(mesh, **self._job.description._asdict())
        suffix = suffix_of(self._job.source_key)
        with tempfile.TemporaryDirectory(prefix="meshtide-job-") as folder:
            self._folder = folder
            source = Path(folder) / f"{mesh.id}{suffix}"
            stream: Path | bytes | None = None if suffix == TIDE_SUFFIX else await self._encoded_before(mesh)
            if stream is None:
                self._stage = ("read the upload", 0.0)
                await self._fetch(source)
                stream = await self._encoded(encoder, source)
            if self._notes:
                await catalogue.jobs.note(self._job.id, self._owner, self._notes)
            self._stage = ("publish", 0.0)
            publication = Publication(mesh.id, mesh.name, mesh.tags, mesh.licence, mesh.source, self._box)
            owned = (self._job.id, self._owner)
            shown = await publish(store, catalogue, stream, publication, limits=self._settings.stream_limits, job=owned)
            logger.info(
                "%s is ready: %d vertices, %d faces, %d bytes", mesh.id, shown.vertices, shown.faces, shown.size
            )

    async def _fetch(self, target: Path) -> None:
        """Copy an object of the store to a file, a piece at a time: an upload may be larger than memory."""
        store, key = self._published.store, self._job.source_key
        size = (await store.head(key)).size
        with target.open("wb") as file:
            for start in range(0, size, CHUNK):
                piece = await store.get_range(key, start, min(start + CHUNK, size))
                await asyncio.to_thread(file.write, piece)

    @property
    def _options(self) -> EncodingOptions:
        return EncodingOptions.from_plain(self._job.options)

    async def _encoded_before(self, mesh: MeshRecord) -> bytes | None:
        """The stream that another job made of the same file with the same options, if there is one."""
        catalogue = self._published.catalogue
        twin = await catalogue.meshes.find_source(mesh.source) if mesh.source is not None else None
        if twin is None or twin.stream is None or twin.state != Status.READY:
            return None
        done = await catalogue.jobs.list(mesh_id=twin.id, state=JobState.DONE, limit=1)
        if not done or done[0].source_key != self._job.source_key:
            return None
        if EncodingOptions.from_plain(done[0].options) != self._options:
            return None
        self._box = twin.box
        self._notes = done[0].notes
        return await self._published.store.get(stream_key(twin.stream))

    async def _encoded(self, encoder: EncoderProcess, source: Path) -> Path:
        """The stream of the upload, as a file in a folder beside it: encoded, or decoded to its end and found right."""
        target = source.parent / "stream" / f"{self._job.mesh_id}{TIDE_SUFFIX}"
        digest = await asyncio.to_thread(file_digest, source)
        settings = self._settings
        limits = (settings.file_limits, settings.stream_limits)
        job = EncoderTask(source, None, digest, self._options, (target,), *limits)
        encoded = await encoder.encode(job, self._advance)
        for note in encoded.notes:
            logger.info("%s: %s", self._job.mesh_id, printable(note))
        self._notes = tuple(map(self._for_sender, encoded.notes))
        self._box = encoded.box
        return target

    def _advance(self, stage: str, fraction: float) -> None:
        self._stage = (stage, fraction)
