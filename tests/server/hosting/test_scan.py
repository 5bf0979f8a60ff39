# ruff: noqa: ASYNC240 - the files of these tests are small
"""The job that looks for files."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import pytest

from meshtide_codec.stream.container import read_container
from meshtide_server.catalogue import Status

from ..libraries import FakeEncoder, eventually, opened, settled
from ..made_streams import make_stream


@pytest.mark.usefixtures("encoders")
async def test_new_changed_and_vanished_files_are_noticed(folder: Path) -> None:
    async with opened(directory=folder, rescan_seconds=0.05) as library:
        assert set(await settled(library)) == {"small"}
        first = library.known("small")
        (folder / "new.obj").touch()
        await eventually(lambda: library.known("new") is not None)
        assert (await settled(library))["new"] == Status.READY
        replacement = folder / ".small.part"
        replacement.write_bytes(make_stream(5))
        replacement.replace(folder / "small.tide")
        await eventually(lambda: library.known("small") is not first)
        await settled(library)
        mesh = library.known("small")
        assert mesh is not None
        assert mesh.stream is not None
        assert mesh.stream.header == read_container(make_stream(5))[0]
        (folder / "new.obj").unlink()
        await eventually(lambda: library.known("new") is None)


async def test_a_cached_stream_that_vanishes_is_made_again(folder: Path, encoders: list[FakeEncoder]) -> None:
    (folder / "a.obj").touch()
    async with opened(directory=folder, rescan_seconds=0.05) as library:
        await settled(library)
        for path in (folder / ".meshtide").iterdir():
            path.unlink()
        await eventually(lambda: len(encoders[0].jobs) == 2)
        assert (await settled(library))["a"] == Status.READY


@pytest.mark.usefixtures("encoders")
async def test_a_file_that_is_still_being_copied_is_left_alone(folder: Path) -> None:
    whole = make_stream(9)
    async with opened(directory=folder, rescan_seconds=0.2) as library:
        await settled(library)
        with (folder / "copy.tide").open("wb") as file:
            for start in range(0, len(whole), 1000):
                file.write(whole[start : start + 1000])
                file.flush()
                os.utime(file.fileno())
                await asyncio.sleep(0.06)
                mesh = library.known("copy")
                assert mesh is None or mesh.status != Status.FAILED
        await eventually(lambda: library.known("copy") is not None)
        assert (await settled(library))["copy"] == Status.READY


@pytest.mark.usefixtures("encoders")
async def test_a_folder_that_vanishes_is_told_and_survived(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with opened(directory=folder, rescan_seconds=0.05) as library:
        await settled(library)
        folder.rename(folder.parent / "elsewhere")
        await eventually(lambda: "cannot look into" in caplog.text)
        assert library.known("small") is not None
        (folder.parent / "elsewhere").rename(folder)
