"""Encoders for several jobs at a time."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from meshtide_server.encoding.pool import EncoderPool
from meshtide_server.encoding.process import EncoderProcess, EncodingFailedError, ProcessLimits

from ..encoding.test_process import FAULTY, job_named, quiet


@pytest.fixture
async def pool(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[EncoderPool]:
    monkeypatch.setattr("meshtide_server.encoding.process.PROGRAM", FAULTY)
    made = EncoderPool(2, ProcessLimits())
    yield made
    await made.close()
    assert made.running == 0


def pid(encoder: EncoderProcess) -> int:
    assert encoder._process is not None
    return encoder._process.pid


async def work(pool: EncoderPool, folder: Path, name: str) -> int:
    """Do a job; returns the process that did it."""
    with pool.taken() as encoder:
        await encoder.encode(job_named(folder, name), quiet)
        return pid(encoder)


async def test_a_process_is_started_when_it_is_needed_and_taken_again(pool: EncoderPool, tmp_path: Path) -> None:
    assert pool.running == 0
    first = await work(pool, tmp_path, "quick-1")
    assert await work(pool, tmp_path, "quick-2") == first
    assert pool.running == 1
    both = await asyncio.gather(work(pool, tmp_path, "burn-1"), work(pool, tmp_path, "burn-2"))
    assert first in both
    assert len(set(both)) == pool.running == 2


async def test_idle_processes_rest_and_busy_ones_do_not(pool: EncoderPool, tmp_path: Path) -> None:
    idle = await work(pool, tmp_path, "quick-1")
    with pool.taken() as encoder, pool.taken() as other:
        assert pid(encoder) == idle
        await other.encode(job_named(tmp_path, "quick-2"), quiet)
        await pool.rest()
        assert pool.running == 2
    await pool.rest()
    assert pool.running == 0
    assert await work(pool, tmp_path, "quick-3") != idle


async def test_closing_ends_what_is_worked_on(pool: EncoderPool, tmp_path: Path) -> None:
    begun = asyncio.Event()
    with pool.taken() as encoder:
        task = asyncio.create_task(encoder.encode(job_named(tmp_path, "sleep"), lambda *_: begun.set()))
        await asyncio.wait_for(begun.wait(), 30)
        await pool.close()
        assert not encoder.running
        with pytest.raises(EncodingFailedError, match="ended early"):
            await task
