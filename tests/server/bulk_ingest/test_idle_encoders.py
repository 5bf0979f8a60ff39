from __future__ import annotations

import asyncio
from typing import Any

import pytest

from meshtide_server.bulk_ingest import idle_encoders
from meshtide_server.bulk_ingest.idle_encoders import encoder_taken, end_idle_encoders
from meshtide_server.encoding.process import ProcessLimits


class Encoder:
    """Stands for an encoder's process."""

    def __init__(self, limits: ProcessLimits) -> None:
        self.limits = limits
        self.running = False
        self.closed = asyncio.Event()

    async def close(self) -> None:
        self.running = False
        self.closed.set()


@pytest.fixture(autouse=True)
def _encoders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(idle_encoders, "EncoderProcess", Encoder)


async def use(memory: int, *, dies: bool = False) -> Any:
    async with encoder_taken(ProcessLimits(memory)) as encoder:
        encoder.running = not dies  # type: ignore[misc]
        return encoder


async def test_an_idle_encoder_is_taken_again_by_whoever_wants_its_limit() -> None:
    first = await use(5)
    assert await use(5) is first
    assert await use(6) is not first
    five = ProcessLimits(5)
    async with encoder_taken(five) as one, encoder_taken(five) as other:
        assert one is first
        assert other is not first
    await end_idle_encoders()
    assert not first.running
    assert await use(5) is not first
    await end_idle_encoders()


async def test_one_that_died_is_not_kept() -> None:
    dead = await use(1, dies=True)
    assert await use(1) is not dead
    await end_idle_encoders()


async def test_one_that_nobody_takes_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(idle_encoders, "IDLE_SECONDS", 0.01)
    encoder = await use(1)
    await asyncio.wait_for(encoder.closed.wait(), 5)
    assert not encoder.running
    assert await use(1) is not encoder
    await end_idle_encoders()


def test_encoders_belong_to_their_event_loop() -> None:
    async def first() -> Any:
        encoder = await use(1)
        await end_idle_encoders()
        return encoder

    assert asyncio.run(first()) is not asyncio.run(first())
    asyncio.run(end_idle_encoders())
