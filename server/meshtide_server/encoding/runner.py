"""The job runner: takes jobs from the catalogue, several at a time, and has each attempted with an encoder of its own.

Several servers may share a catalogue: each job is claimed by one of them, which sends heartbeats while it works. Jobs
whose owner is not heard of any more, because it was killed, are released and tried once more; so a server that is
started again goes on with what was queued or under way. Encoding happens in processes with limits of memory, of
processor time and of time: a file that brings its parser down, or keeps it busy for ever, costs one job.
"""

from __future__ import annotations

import asyncio
import logging
import time
import uuid
from contextlib import suppress
from datetime import timedelta
from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshtideError
from meshtide_server.catalogue import JobState
from meshtide_server.encoding.attempt import JobAttempt
from meshtide_server.encoding.pool import EncoderPool
from meshtide_server.encoding.process import ProcessLimits
from meshtide_server.operations import metrics

if TYPE_CHECKING:
    from meshtide_server.catalogue import Job
    from meshtide_server.hosting.published import PublishedMeshes
    from meshtide_server.settings import Settings

logger = logging.getLogger("meshtide.server")

POLL_SECONDS = 0.5
"""How often the queue is looked at, if nobody says that there is something."""
REST_SECONDS = 60.0
"""After so long without a job, the encoder processes are ended."""


class JobRunner:
    """Works on the jobs of a catalogue.

    Args:
        published: store and catalogue.
        settings: how many jobs at a time, and limits of each.
        draining: is set when no new job shall be begun.
    """

    def __init__(self, published: PublishedMeshes, settings: Settings, draining: asyncio.Event) -> None:
        self._published = published
        self._settings = settings
        self._draining = draining
        self._owner = f"server-{uuid.uuid4().hex}"
        limits = ProcessLimits(settings.job_memory, settings.job_processor_seconds)
        self._encoders = EncoderPool(settings.encoder_processes, limits)
        self._news = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._attempts: set[asyncio.Task[None]] = set()
        self._worked = time.monotonic()

    def start(self) -> None:
        """Begin to work."""
        self._task = asyncio.create_task(self._run(), name="give out jobs")

    async def stop(self) -> None:
        """End; jobs that are under way are handed back to the queue."""
        tasks = [*self._attempts, *([self._task] if self._task is not None else [])]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await self._encoders.close()
        with suppress(MeshtideError):  # without a catalogue the jobs are released when their heartbeats are missed
            await self._published.catalogue.jobs.hand_back_all(self._owner)

    def notify(self) -> None:
        """There is a new job, or an encoder for one."""
        self._news.set()

    async def _run(self) -> None:
        while True:
            self._news.clear()
            try:
                begun = await self._next()
            except MeshtideError as error:
                logger.warning("jobs cannot be worked on now: %s", error)
                begun = False
            except Exception:
                logger.exception("while jobs were given out")
                metrics.fault("jobs")
                begun = False
            if not begun:
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._news.wait(), POLL_SECONDS)

    async def _next(self) -> bool:
        """Begin with the job that has waited longest; False if there is none, or no encoder for it."""
        jobs = self._published.catalogue.jobs
        for lost in await jobs.release_lost(timedelta(seconds=self._settings.job_lost_seconds)):
            logger.warning("job %s was lost: %s; it is %s", lost.id, lost.error, lost.state.value)
        metrics.jobs_waiting((await jobs.counts())[JobState.QUEUED])
        if self._draining.is_set() or len(self._attempts) >= self._encoders.size:
            return False
        job = await jobs.claim(self._owner)
        if job is None:
            if not self._attempts and time.monotonic() - self._worked > REST_SECONDS:
                await self._encoders.rest()
            return False
        attempt = asyncio.create_task(self._attempt(job), name=f"attempt at job {job.id}")
        self._attempts.add(attempt)
        attempt.add_done_callback(self._ended)
        return True

    def _ended(self, attempt: asyncio.Task[None]) -> None:
        self._attempts.discard(attempt)
        self.notify()

    async def _attempt(self, job: Job) -> None:
        with self._encoders.taken() as encoder:
            await JobAttempt(job, self._owner, self._published, self._settings).run(encoder)
            self._worked = time.monotonic()
            try:
                await self._published.refresh()
                await self._published.catalogue.sources.collect(job.source_key, self._published.store.delete)
            except MeshtideError as error:  # both are done again later
                logger.warning("the end of job %s could not be tidied up: %s", job.id, error)
