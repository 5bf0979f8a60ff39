"""The job that has the folder's meshes encoded."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from meshtide_server.catalogue import Status

from ..libraries import FakeEncoder, eventually, opened, settled


@pytest.mark.usefixtures("encoders")
async def test_a_stream_that_can_be_stored_nowhere_is_served_from_memory(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (folder / "homeless.obj").touch()
    async with opened(directory=folder) as library:
        assert (await settled(library))["homeless"] == Status.READY
        mesh = library.known("homeless")
        assert mesh is not None
        assert mesh.stream is not None
        assert len(await mesh.stream.open().read(0, mesh.stream.size)) == mesh.stream.size
    assert "No space left on device" in caplog.text
    assert "kept in memory" in caplog.text


async def test_progress_is_told_while_a_mesh_is_encoded(folder: Path, encoders: list[FakeEncoder]) -> None:
    for name in ("a.obj", "b.obj"):
        (folder / name).touch()
    async with opened(directory=folder) as library:
        encoders[0].hold.clear()
        await eventually(lambda: bool(encoders[0].jobs))
        first, second, small = library.folder.meshes
        await eventually(lambda: small.status == Status.READY)
        assert (first.status, first.stage, first.progress) == (Status.ENCODING, "levels", 0.5)
        assert (second.status, second.stage) == (Status.ENCODING, "waiting")
        encoders[0].hold.set()
        await settled(library)


async def test_stopping_in_the_middle_is_quick(folder: Path, encoders: list[FakeEncoder]) -> None:
    (folder / "a.obj").touch()
    async with AsyncExitStack() as stack:
        await stack.enter_async_context(opened(directory=folder))
        encoders[0].hold.clear()
        await eventually(lambda: bool(encoders[0].jobs))
        async with asyncio.timeout(2):
            await stack.aclose()
    assert encoders[0].closed
