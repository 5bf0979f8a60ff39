"""The job that looks at each mesh: what is encoded before is found again, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from meshtide_server.catalogue import Status

from ..libraries import FakeEncoder, opened, settled


async def test_a_stream_is_encoded_once(folder: Path, encoders: list[FakeEncoder]) -> None:
    (folder / "a.obj").write_text("v 0 0 0")
    for _ in range(2):
        async with opened(directory=folder) as library:
            assert (await settled(library))["a"] == Status.READY
    assert [len(encoder.jobs) for encoder in encoders] == [1, 0]
    (folder / "a.obj").write_text("v 0 0 1")
    async with opened(directory=folder) as library:
        await settled(library)
    assert len(encoders[2].jobs) == 1
    assert len(list((folder / ".meshtide").iterdir())) == 1  # the stale stream is gone


async def test_other_options_make_another_stream_beside_the_first(folder: Path, encoders: list[FakeEncoder]) -> None:
    (folder / "a.obj").write_text("v 0 0 0")
    for bits in (12, 10, 12, 10):
        async with opened(directory=folder, bits=bits) as library:
            await settled(library)
    assert [len(encoder.jobs) for encoder in encoders] == [1, 1, 0, 0]


async def test_a_damaged_cache_is_made_anew(
    folder: Path, encoders: list[FakeEncoder], caplog: pytest.LogCaptureFixture
) -> None:
    (folder / "a.obj").write_text("v 0 0 0")
    async with opened(directory=folder) as library:
        await settled(library)
    (cached,) = (folder / ".meshtide").iterdir()
    cached.write_bytes(cached.read_bytes()[:-1])
    async with opened(directory=folder) as library:
        assert (await settled(library))["a"] == Status.READY
    assert len(encoders[1].jobs) == 1
    assert "is damaged and will be made anew" in caplog.text


@pytest.mark.usefixtures("encoders")
async def test_the_cache_can_be_elsewhere(folder: Path, tmp_path: Path) -> None:
    (folder / "a.obj").touch()
    async with opened(directory=folder, cache=tmp_path / "cache") as library:
        await settled(library)
    assert len(list((tmp_path / "cache").rglob("*.tide"))) == 1
    assert not (folder / ".meshtide").exists()


async def test_a_cache_that_cannot_be_written_loses_nothing_while_the_server_runs(
    folder: Path, encoders: list[FakeEncoder], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (folder / "a.obj").touch()
    (tmp_path / "file").touch()
    async with opened(directory=folder, cache=tmp_path / "file") as library:
        assert (await settled(library))["a"] == Status.READY
        scratch = encoders[0].jobs[0].targets[0].parent
        assert scratch.is_dir()
    assert not scratch.exists()
    assert "then lost" in caplog.text
