"""The job runner: takes jobs from the catalogue, encodes the uploads in a process of its own, publishes the streams.

Several servers may share a catalogue: each job is claimed by one of them, which sends heartbeats while it works. Jobs
whose owner is not heard of any more, because it was killed, are released and tried once more; so a server that is
started again goes on with what was queued or under way. Encoding happens in `encoder_process` with a limit of memory
and of time: a file that brings its parser down, or keeps it busy for ever, costs one job.
"""

from __future__ import annotations

import asyncio
import logging
import tempfile
import time
import uuid
from contextlib import suppress
from datetime import timedelta
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshtideError
from meshtide_codec.limits import Limits
from meshtide_server import metrics
from meshtide_server.catalogue import JobState, MeshState, UnknownMeshError
from meshtide_server.encoder_process import EncoderProcess, EncodingFailedError
from meshtide_server.encoder_process import Job as EncoderJob
from meshtide_server.hosted_mesh import TIDE_SUFFIX
from meshtide_server.publishing import Publication, publish
from meshtide_server.store import stream_key
from meshtide_server.stream_cache import EncodingOptions, file_digest
from meshtide_server.upload_checks import UploadLimits

if TYPE_CHECKING:
    from meshtide_server.catalogue import Job, MeshRecord
    from meshtide_server.kept_meshes import KeptMeshes
    from meshtide_server.settings import Settings

logger = logging.getLogger("meshtide.server")

POLL_SECONDS = 0.5
"""How often the queue is looked at, if nobody says that there is something."""
CHUNK = 1 << 22
"""Bytes of an upload that are fetched from the store at a time."""
HEARTBEATS = 8
"""Heartbeats within the time after which a job counts as lost."""


class JobRunner:
    """Works on the jobs of a catalogue, one after the other.

    Args:
        kept: store and catalogue.
        settings: limits of a job.
        draining: is set when no new job shall be begun.
    """

    def __init__(self, kept: KeptMeshes, settings: Settings, draining: asyncio.Event) -> None:
        self._kept = kept
        self._settings = settings
        self._draining = draining
        self._owner = f"server-{uuid.uuid4().hex}"
        self._encoder = EncoderProcess(memory=settings.job_memory)
        self._news = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._job: Job | None = None
        self._stage = ("starting", 0.0)

    def start(self) -> None:
        """Begin to work."""
        self._task = asyncio.create_task(self._run(), name="work on jobs")

    async def stop(self) -> None:
        """End; a job that is under way is handed back to the queue."""
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task
        await self._encoder.close()
        if self._job is not None:
            with suppress(MeshtideError):  # without a catalogue the job is released when its heartbeats are missed
                await self._kept.catalogue.jobs.hand_back(self._job.id, self._owner)
            metrics.job_ended(metrics.JobOutcome.RELEASED, 0.0)

    def notify(self) -> None:
        """There is a new job."""
        self._news.set()

    async def _run(self) -> None:
        while True:
            self._news.clear()
            try:
                worked = await self._next()
            except MeshtideError as error:
                logger.warning("jobs cannot be worked on now: %s", error)
                worked = False
            if not worked:
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._news.wait(), POLL_SECONDS)

    async def _next(self) -> bool:
        """Work on the job that has waited longest; False if there is none."""
        jobs = self._kept.catalogue.jobs
        for lost in await jobs.release_lost(timedelta(seconds=self._settings.job_lost_seconds)):
            logger.warning("job %s was lost: %s; it is %s", lost.id, lost.error, lost.state.value)
        metrics.jobs_waiting((await jobs.counts())[JobState.QUEUED])
        if self._draining.is_set():
            return False
        job = await jobs.claim(self._owner)
        if job is None:
            return False
        self._job = job
        metrics.job_started()
        started = time.monotonic()
        heart = asyncio.create_task(self._beat(job), name="heartbeat")
        try:
            async with asyncio.timeout(self._settings.job_seconds):
                await self._work(job)
            outcome = metrics.JobOutcome.DONE
        except TimeoutError:
            outcome = await self._failed(job, f"it took longer than {self._settings.job_seconds:g} s", retry=False)
        except UnknownMeshError:
            outcome = metrics.JobOutcome.RELEASED
            logger.info("job %s is not wanted any more", job.id)
        except EncodingFailedError as error:
            outcome = await self._failed(job, str(error), retry=error.by_process)
        except (MeshtideError, OSError) as error:
            outcome = await self._failed(job, str(error), retry=not isinstance(error, MeshtideError))
        except Exception as error:  # one job must not end the work on all others
            logger.exception("while job %s of mesh %s was worked on", job.id, job.mesh_id)
            outcome = await self._failed(job, f"internal error: {type(error).__name__}", retry=True)
        finally:
            heart.cancel()
        self._job = None
        metrics.job_ended(outcome, time.monotonic() - started)
        await self._kept.refresh()
        return True

    async def _failed(self, job: Job, reason: str, *, retry: bool) -> metrics.JobOutcome:
        after = await self._kept.catalogue.jobs.fail(job.id, self._owner, reason, retry=retry)
        logger.warning("job %s of mesh %s failed: %s", job.id, job.mesh_id, reason)
        if after is not None and after.state == JobState.FAILED:
            return metrics.JobOutcome.FAILED
        return metrics.JobOutcome.RETRIED

    async def _beat(self, job: Job) -> None:
        """Tell the catalogue again and again how far the job is."""
        while True:
            with suppress(MeshtideError):  # a database that is away for a moment misses a beat
                await self._kept.catalogue.jobs.heartbeat(job.id, self._owner, *self._stage)
            await asyncio.sleep(self._settings.job_lost_seconds / HEARTBEATS)

    async def _work(self, job: Job) -> None:
        """Encode what the job names, unless the same was encoded before, and publish it."""
        catalogue, store = self._kept.catalogue, self._kept.store
        mesh = await catalogue.meshes.get(job.mesh_id)
        suffix = PurePosixPath(job.source_key).suffix
        with tempfile.TemporaryDirectory(prefix="meshtide-job-") as folder:
            source = Path(folder) / f"{mesh.id}{suffix}"
            self._stage = ("read the upload", 0.0)
            await self._fetch(job.source_key, source)
            stream: Path | bytes = source
            if suffix != TIDE_SUFFIX:
                stream = await self._encoded_before(job, mesh) or await self._encoded(job, source)
            self._stage = ("publish", 0.0)
            limits = Limits(
                vertices=self._settings.max_vertices,
                faces=self._settings.max_faces,
                memory=self._settings.max_decode_memory,
            )
            await publish(store, catalogue, stream, _publication(mesh), limits=limits, job=(job.id, self._owner))

    async def _fetch(self, key: str, target: Path) -> None:
        """Copy an object of the store to a file, a piece at a time: an upload may be larger than memory."""
        store = self._kept.store
        size = (await store.head(key)).size
        with target.open("wb") as file:
            for start in range(0, size, CHUNK):
                piece = await store.get_range(key, start, min(start + CHUNK, size))
                await asyncio.to_thread(file.write, piece)

    async def _encoded_before(self, job: Job, mesh: MeshRecord) -> bytes | None:
        """The stream that another job made of the same file with the same options, if there is one."""
        catalogue = self._kept.catalogue
        twin = await catalogue.meshes.find_source(mesh.source) if mesh.source is not None else None
        if twin is None or twin.stream is None or twin.state != MeshState.READY:
            return None
        done = await catalogue.jobs.list(mesh_id=twin.id, state=JobState.DONE, limit=1)
        if not done or (done[0].source_key, done[0].options) != (job.source_key, job.options):
            return None
        return await self._kept.store.get(stream_key(twin.stream))

    async def _encoded(self, job: Job, source: Path) -> Path:
        """The stream of the upload, as a file beside it."""
        target = source.with_suffix(TIDE_SUFFIX)
        options = EncodingOptions(bits=int(job.options["bits"]), profile=str(job.options["profile"]))
        digest = await asyncio.to_thread(file_digest, source)
        limits = UploadLimits(self._settings.max_vertices, self._settings.max_faces)
        await self._encoder.encode(EncoderJob(source, None, digest, options, (target,), limits), self._advance)
        return target

    def _advance(self, stage: str, fraction: float) -> None:
        self._stage = (stage, fraction)


def _publication(mesh: MeshRecord) -> Publication:
    return Publication(mesh.id, mesh.name, mesh.tags, mesh.licence, mesh.source, mesh.box)
