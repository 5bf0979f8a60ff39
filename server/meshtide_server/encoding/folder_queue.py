"""The job that has the folder's meshes encoded, one after the other, in a process of its own."""

from __future__ import annotations

import asyncio
import logging
import time
from contextlib import suppress
from typing import TYPE_CHECKING

from meshtide_codec.printable import printable
from meshtide_server.encoding.process import EncoderProcess, EncoderTask
from meshtide_server.store.range_reader import FileReader, MemoryReader

if TYPE_CHECKING:
    from meshtide_server.encoding_options import EncodingOptions
    from meshtide_server.hosting.folder import FolderMeshes, Unencoded
    from meshtide_server.hosting.mesh import HostedMesh

logger = logging.getLogger("meshtide.server")

REPORT_SECONDS = 5.0
"""Progress within a stage is logged at most this often."""


class FolderQueue:
    """Has the meshes encoded that wait for it.

    Args:
        folder: the meshes.
        options: how they are encoded.
    """

    def __init__(self, folder: FolderMeshes, options: EncodingOptions) -> None:
        self._folder = folder
        self._options = options
        self._encoder = EncoderProcess()
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to work."""
        self._task = asyncio.create_task(self._run(), name="encode meshes")

    async def stop(self) -> None:
        """End, and with it what is being encoded."""
        self._folder.stopping = True
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task
        await self._encoder.close()

    async def _run(self) -> None:
        while True:
            waiting = await self._folder.to_encode.get()
            if not self._folder.is_current(waiting.mesh):  # removed or replaced while it waited
                self._folder.finish(waiting.mesh, None)
                continue
            with self._folder.failing(waiting.mesh, "encoded"):
                await self._encode(waiting)
            if self._folder.idle:
                await self._encoder.close()  # it holds memory, and there is nothing for it to do

    async def _encode(self, waiting: Unencoded) -> None:
        mesh, place, digest = waiting
        source = mesh.source
        job = EncoderTask(source.path, None if source.path else source.name, digest, self._options, place.paths)
        started = time.monotonic()
        encoded = await self._encoder.encode(job, _ProgressLog(mesh))
        logger.info("%s was encoded in %.1f s", mesh.id, time.monotonic() - started)
        for note in encoded.notes:
            logger.info("%s: %s", mesh.id, printable(note))
        for problem in encoded.problems:
            logger.warning("the stream of %s cannot be stored in %s", mesh.id, problem)
        if encoded.path is None:
            logger.warning("the stream of %s is kept in memory until the server stops, then lost", mesh.id)
        file = FileReader(encoded.path) if encoded.path else MemoryReader(encoded.data)
        stream = await self._folder.load(file)
        await asyncio.to_thread(place.prune)
        self._folder.finish(mesh, stream)


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
