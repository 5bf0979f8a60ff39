# ruff: noqa: ASYNC240 - the files of these tests are small
import asyncio
import json
import os
import signal
import struct
import sys
import time
from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from meshtide_codec.limits import FileLimits
from meshtide_codec.stream.container import read_container
from meshtide_server.encoding.process import EncoderProcess, EncoderTask, EncodingFailedError, ProcessLimits
from meshtide_server.encoding_options import EncodingOptions
from meshtide_server.hosting.stream_cache import file_digest

OPTIONS = EncodingOptions(bits=9)
FAULTY = (sys.executable, str(Path(__file__).parents[1] / "faulty_encoder.py"))


@pytest.fixture
async def encoder() -> AsyncIterator[EncoderProcess]:
    process = EncoderProcess()
    yield process
    await process.close()
    assert not process.running


def job(file: Path, *targets: Path) -> EncoderTask:
    return EncoderTask(file, None, file_digest(file), OPTIONS, targets)


def quiet(stage: str, fraction: float) -> None:
    assert stage
    assert 0.0 <= fraction <= 1.0


async def test_one_process_stores_streams_reports_failures_and_goes_on(
    encoder: EncoderProcess, tmp_path: Path, tetrahedron: str
) -> None:
    good, bad, changed = (tmp_path / name for name in ("good.obj", "bad.obj", "changed.obj"))
    good.write_text(tetrahedron)
    bad.write_text("this is not a mesh")
    changed.write_text(tetrahedron)

    stages: list[str] = []
    target = tmp_path / "cache" / "good.tide"
    encoded = await encoder.encode(job(good, target), lambda stage, _: stages.append(stage))
    assert (encoded.path, encoded.data, encoded.problems) == (target, b"", ())
    header, _ = read_container(target.read_bytes())
    assert (header.vertices, header.faces, header.bits) == (4, 4, 9)
    assert stages[:2] == ["load the encoder", "read the mesh"]
    assert [path.name for path in target.parent.iterdir()] == ["good.tide"]

    with pytest.raises(EncodingFailedError, match=r"bad\.obj"):
        await encoder.encode(job(bad, tmp_path / "bad.tide"), quiet)

    stale = job(changed, tmp_path / "changed.tide")
    changed.write_text(tetrahedron + "# edited\n")
    with pytest.raises(EncodingFailedError, match="was changed while it was read"):
        await encoder.encode(stale, quiet)
    assert not (tmp_path / "changed.tide").exists()

    sample = EncoderTask(None, "spot", "sample spot", OPTIONS, ())
    assert read_container((await encoder.encode(sample, quiet)).data)[0].vertices > 2000


async def test_a_file_that_wants_more_memory_than_a_job_may_have_costs_one_job(
    tmp_path: Path, tetrahedron: str
) -> None:
    greedy, good = tmp_path / "greedy.glb", tmp_path / "good.obj"
    points = 300_000
    text = json.dumps(
        {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": list(range(200))}],
            "nodes": [{"mesh": 0}] * 200,
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": points, "type": "VEC3"}],
            "bufferViews": [{"buffer": 0, "byteLength": 12 * points}],
            "buffers": [{"byteLength": 12 * points}],
        }
    ).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", 12 * points, b"BIN\0")
    greedy.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks) + 12 * points) + chunks + bytes(12 * points))
    good.write_text(tetrahedron)
    encoder = EncoderProcess(ProcessLimits(memory=2 << 30))
    try:
        with pytest.raises(EncodingFailedError, match="does not fit into memory"):
            await encoder.encode(job(greedy, tmp_path / "greedy.tide"), quiet)
        assert encoder.running
        assert (await encoder.encode(job(good, tmp_path / "good.tide"), quiet)).path == tmp_path / "good.tide"
    finally:
        await encoder.close()


async def test_what_a_stranger_sent_is_checked_before_it_is_read(
    encoder: EncoderProcess, tmp_path: Path, tetrahedron: str
) -> None:
    hostile, good = tmp_path / "hostile.off", tmp_path / "good.obj"
    hostile.write_text("OFF\n1000000000000 1 0\n")
    good.write_text(tetrahedron)
    limits = FileLimits(vertices=4, faces=4)
    with pytest.raises(EncodingFailedError, match="1000000000000 vertices; 4 are the most") as refusal:
        await encoder.encode(replace(job(hostile, tmp_path / "hostile.tide"), limits=limits), quiet)
    assert not refusal.value.by_process
    encoded = await encoder.encode(replace(job(good, tmp_path / "good.tide"), limits=limits), quiet)
    assert encoded.path == tmp_path / "good.tide"
    with pytest.raises(EncodingFailedError, match="4 vertices; 3 are the most"):
        await encoder.encode(replace(job(good), limits=FileLimits(vertices=3, faces=4)), quiet)


async def test_a_stream_that_no_folder_takes_comes_back_in_memory(
    encoder: EncoderProcess, tmp_path: Path, tetrahedron: str
) -> None:
    file = tmp_path / "a.obj"
    file.write_text(tetrahedron)
    targets = (tmp_path / "a.obj" / "a.tide", Path("/dev/full/a.tide"))
    encoded = await encoder.encode(job(file, *targets), quiet)
    assert encoded.path is None
    assert read_container(encoded.data)[0].vertices == 4
    assert [problem.split(": ")[1] for problem in encoded.problems] == ["File exists", "File exists"]
    second_choice = tmp_path / "b.tide"
    encoded = await encoder.encode(job(file, targets[0], second_choice), quiet)
    assert encoded.path == second_choice
    assert len(encoded.problems) == 1


async def test_a_process_that_is_killed_fails_its_job_only(
    encoder: EncoderProcess, tmp_path: Path, tetrahedron: str
) -> None:
    file = tmp_path / "a.obj"
    file.write_text(tetrahedron)

    def kill(stage: str, _: float) -> None:
        if stage == "load the encoder":
            assert encoder._process is not None
            os.kill(encoder._process.pid, signal.SIGKILL)

    with pytest.raises(EncodingFailedError, match=r"killed by SIGKILL; there may be too little memory"):
        await encoder.encode(job(file, tmp_path / "a.tide"), kill)
    assert not encoder.running
    await encoder.encode(job(file, tmp_path / "a.tide"), quiet)
    assert (tmp_path / "a.tide").is_file()


async def test_a_cancelled_job_ends_the_process(encoder: EncoderProcess, tmp_path: Path, tetrahedron: str) -> None:
    file = tmp_path / "a.obj"
    file.write_text(tetrahedron)
    begun = asyncio.Event()
    task = asyncio.create_task(encoder.encode(job(file, tmp_path / "a.tide"), lambda *_: begun.set()))
    await asyncio.wait_for(begun.wait(), 30)
    assert encoder.running
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task
    assert not encoder.running
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.obj"]


@pytest.fixture
def faulty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshtide_server.encoding.process.PROGRAM", FAULTY)


def job_named(folder: Path, name: str) -> EncoderTask:
    """A job in which the faulty encoder does what the name says."""
    file = folder / f"{name}.obj"
    file.write_text("v 0 0 0")
    return job(file, folder / f"{name}.tide")


def gone(pid: int, seconds: float = 10.0) -> bool:
    """Whether a process ends within that time."""
    deadline = time.monotonic() + seconds
    while psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE:
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


@pytest.mark.usefixtures("faulty")
async def test_a_job_that_uses_up_its_processor_time_fails_for_good(tmp_path: Path) -> None:
    encoder = EncoderProcess(ProcessLimits(processor_seconds=1))
    try:
        with pytest.raises(EncodingFailedError, match="took more than 1 s of processor time") as failure:
            await encoder.encode(job_named(tmp_path, "spin"), quiet)
        assert not failure.value.by_process
        assert not encoder.running
        pids = set()
        for turn in range(3):  # three times 0.6 s: what counts is the time of each
            assert (await encoder.encode(job_named(tmp_path, f"burn-{turn}"), quiet)).path is not None
            assert encoder._process is not None
            pids.add(encoder._process.pid)
        assert len(pids) == 1
    finally:
        await encoder.close()


@pytest.mark.usefixtures("faulty")
@pytest.mark.parametrize(
    ("name", "message"),
    [("die", "with exit code 3"), ("crash", "killed by SIGSEGV"), ("garbage", "killed by SIGTERM")],
)
async def test_a_process_that_ends_or_talks_nonsense_may_do_better_next_time(
    encoder: EncoderProcess, tmp_path: Path, name: str, message: str
) -> None:
    with pytest.raises(EncodingFailedError, match=f"ended early, {message}") as failure:
        await encoder.encode(job_named(tmp_path, name), quiet)
    assert failure.value.by_process
    assert not encoder.running
    assert (await encoder.encode(job_named(tmp_path, "quick"), quiet)).path == tmp_path / "quick.tide"


@pytest.mark.usefixtures("faulty")
async def test_a_job_that_is_cancelled_while_the_end_of_its_process_is_awaited_leaves_none(
    encoder: EncoderProcess, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("meshtide_server.encoding.process.END_SECONDS", 30.0)
    task = asyncio.create_task(encoder.encode(job_named(tmp_path, "garbage"), quiet))
    await asyncio.sleep(1.5)  # it has talked nonsense, and does not end by itself
    assert encoder.running
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert not encoder.running


@pytest.mark.usefixtures("faulty")
async def test_a_long_reason_is_cut_and_the_process_goes_on(encoder: EncoderProcess, tmp_path: Path) -> None:
    with pytest.raises(EncodingFailedError, match="^(no )+") as failure:
        await encoder.encode(job_named(tmp_path, "wordy"), quiet)
    assert len(str(failure.value)) == 2000
    assert encoder.running
    assert (await encoder.encode(job_named(tmp_path, "quick"), quiet)).path == tmp_path / "quick.tide"


@pytest.mark.usefixtures("faulty")
async def test_a_process_ends_in_the_middle_of_a_job_when_its_server_is_gone(
    encoder: EncoderProcess, tmp_path: Path
) -> None:
    def leave(*_: object) -> None:
        assert encoder._process is not None
        assert encoder._process.stdin is not None
        encoder._process.stdin.close()

    with pytest.raises(EncodingFailedError, match="ended early, with exit code 0"):
        await encoder.encode(job_named(tmp_path, "sleep"), leave)


@pytest.mark.usefixtures("faulty")
async def test_what_a_process_has_started_ends_with_it(encoder: EncoderProcess, tmp_path: Path) -> None:
    children: list[int] = []
    begun = asyncio.Event()

    def note(stage: str, _: float) -> None:
        if stage.startswith("child "):
            children.append(int(stage.removeprefix("child ")))
            begun.set()

    with pytest.raises(EncodingFailedError, match="ended early, with exit code 0"):
        await encoder.encode(job_named(tmp_path, "orphan"), note)
    begun.clear()
    task = asyncio.create_task(encoder.encode(job_named(tmp_path, "parent"), note))
    await asyncio.wait_for(begun.wait(), 30)
    assert psutil.pid_exists(children[1])
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert [gone(child) for child in children] == [True, True]
    assert not encoder.running
