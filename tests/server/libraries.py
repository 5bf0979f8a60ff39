# ruff: noqa: ASYNC110 - tests may poll
"""A library at work for tests, with an encoder that answers at once."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest

from meshtide_server.catalogue import Status
from meshtide_server.encoding import folder_queue
from meshtide_server.encoding.folder_queue import FolderQueue
from meshtide_server.encoding.process import Encoded, EncoderTask, EncodingFailedError
from meshtide_server.hosting.library import Library
from meshtide_server.settings import Settings

from .made_streams import make_stream


class FakeEncoder:
    """Takes the place of the encoder's process: the stream of a mesh is random bytes made from its digest."""

    jobs: list[EncoderTask]

    def __init__(self) -> None:
        self.jobs = []
        self.closed = False
        self.hold = asyncio.Event()
        self.hold.set()

    async def encode(self, job: EncoderTask, progress: Callable[[str, float], None]) -> Encoded:
        self.jobs.append(job)
        progress("levels", 0.5)
        await self.hold.wait()
        name = job.file.name if job.file else job.sample
        if name == "bad.obj":
            raise EncodingFailedError("bad.obj: face 3 names vertex 99 of 8")
        data = make_stream(sum(job.digest.encode()))
        if name == "homeless.obj":
            return Encoded(None, data, ("/full: No space left on device",))
        job.targets[0].write_bytes(data)
        return Encoded(job.targets[0], b"", ())

    async def close(self) -> None:
        self.closed = True


@pytest.fixture
def encoders(monkeypatch: pytest.MonkeyPatch) -> list[FakeEncoder]:
    made: list[FakeEncoder] = []

    def make() -> FakeEncoder:
        made.append(FakeEncoder())
        return made[-1]

    monkeypatch.setattr(folder_queue, "EncoderProcess", make)
    return made


@asynccontextmanager
async def opened(**settings: object) -> AsyncIterator[Library]:
    """A library at work, and the job that has its meshes encoded."""
    chosen = Settings.model_validate({"rescan_seconds": 0, **settings})
    library = Library(chosen)
    queue = FolderQueue(library.folder, chosen.encoding)
    await library.start()
    queue.start()
    try:
        yield library
    finally:
        await queue.stop()
        await library.stop()


async def settled(library: Library) -> dict[str, Status]:
    await asyncio.wait_for(library.folder.settled(), 10)
    return {mesh.id: mesh.status for mesh in library.folder.meshes}


async def eventually(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(10):
        while not condition():
            await asyncio.sleep(0.01)
