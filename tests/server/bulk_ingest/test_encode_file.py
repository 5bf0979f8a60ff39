# ruff: noqa: ASYNC240 - the files of these tests are small
"""The function that encodes one file, here and on clusters."""

from __future__ import annotations

import pickle
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from bulk_ingests import BITS, PROFILE, chosen, expected_stream, small_meshes
from meshtide_codec.decoder import decode
from meshtide_codec.limits import FileLimits, Limits
from meshtide_server.bulk_ingest import encode_file as module
from meshtide_server.bulk_ingest.encode_file import FileOutcome, FileTask, encode_file
from meshtide_server.bulk_ingest.idle_encoders import end_idle_encoders
from meshtide_server.catalogue import Box
from meshtide_server.encoding.process import Encoded, EncodingFailedError, ProcessLimits
from meshtide_server.encoding_options import EncodingOptions
from meshtide_server.hosting.stream_cache import codec_digest

from ..made_streams import make_stream, real_stream

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable


@pytest.fixture(name="file")
def _file(tmp_path: Path) -> Path:
    return small_meshes(tmp_path / "scans", 1)[0]


def task_for(file: Path) -> FileTask:
    options = EncodingOptions(BITS, PROFILE)
    limits, stream_limits = FileLimits(vertices=1000, faces=1000), Limits(vertices=1000)
    return FileTask(file, chosen(file).digest, options, limits, stream_limits, ProcessLimits(), 60.0, codec_digest())


def box_of(stream: bytes) -> Box:
    vertices = decode(stream).vertices
    (x0, y0, z0), (x1, y1, z1) = vertices.min(axis=0), vertices.max(axis=0)
    return Box((x0, y0, z0), (x1, y1, z1))


@pytest.fixture(name="failing")
def _failing(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[int]]:
    """Has encoders that do as they are told: raise an error or, for None, encode."""

    def use(*errors: BaseException | None) -> list[int]:
        taken: list[int] = []

        class Encoder:
            async def encode(self, _: Any, progress: Callable[[str, float], None]) -> Encoded:
                progress("levels", 0.5)
                taken.append(len(taken))
                error = errors[taken[-1]]
                if error is not None:
                    raise error
                return Encoded(None, b"stream", ())

        @asynccontextmanager
        async def encoder_taken(_: ProcessLimits) -> AsyncIterator[Encoder]:
            yield Encoder()

        monkeypatch.setattr(module, "encoder_taken", encoder_taken)
        return taken

    return use


async def test_a_file_is_encoded_where_it_lies_or_from_its_content(file: Path) -> None:
    task = task_for(file)
    assert pickle.loads(pickle.dumps(task)) == task  # noqa: S301 - our own
    expected = expected_stream(file)
    content = file.read_bytes()
    try:
        assert await encode_file(task) == FileOutcome(expected, box_of(expected))
        file.write_bytes(content + b"\n")
        assert await encode_file(task) == FileOutcome(elsewhere=True)
        file.unlink()
        assert await encode_file(task) == FileOutcome(elsewhere=True)
        assert await encode_file(task, content) == FileOutcome(expected, box_of(expected))
        changed = await encode_file(replace(task, digest="0" * 64), content)
        assert "was changed while it was read" in (changed.error or "")
        limited = await encode_file(replace(task, limits=FileLimits(vertices=8, faces=1000)), content)
        assert "9 vertices; 8 are the most" in (limited.error or "")
    finally:
        await end_idle_encoders()


async def test_a_stream_is_looked_into_and_given_back_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "a.TIDE"
    file.write_bytes(real_stream(2))
    task = task_for(file)
    try:
        assert await encode_file(task) == FileOutcome(real_stream(2), box_of(real_stream(2)))
        limited = await encode_file(replace(task, stream_limits=Limits(vertices=5)))
        assert "this decoder accepts 5" in (limited.error or "")
        file.write_bytes(make_stream(1))
        refused = await encode_file(task_for(file))
        assert refused.stream is None
        assert refused.error
    finally:
        await end_idle_encoders()


async def test_another_version_of_the_codec_is_refused(file: Path) -> None:
    outcome = await encode_file(replace(task_for(file), codec="0" * 64))
    assert outcome.stream is None
    assert "another version of meshtide" in (outcome.error or "")


async def test_a_file_whose_process_dies_is_begun_twice(file: Path, failing: Callable[..., list[int]]) -> None:
    died = EncodingFailedError("killed by SIGKILL", by_process=True)
    taken = failing(died, None)
    assert await encode_file(task_for(file)) == FileOutcome(b"stream")
    assert len(taken) == 2
    taken = failing(died, died)
    assert await encode_file(task_for(file)) == FileOutcome(error="killed by SIGKILL")
    assert len(taken) == 2


async def test_a_file_that_is_no_mesh_or_takes_too_long_is_begun_once(
    file: Path, failing: Callable[..., list[int]]
) -> None:
    taken = failing(EncodingFailedError("no mesh"))
    assert await encode_file(task_for(file)) == FileOutcome(error="no mesh")
    assert len(taken) == 1
    taken = failing(TimeoutError())
    outcome = await encode_file(task_for(file))
    assert outcome == FileOutcome(error="it took longer than 60 s (MESHTIDE_JOB_SECONDS)")
    assert len(taken) == 1
