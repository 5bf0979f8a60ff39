import asyncio

import pytest

from meshtide_server import readiness
from meshtide_server.readiness import Readiness


async def fine() -> str | None:
    return None


async def waiting() -> str | None:
    return "the disk is full"


async def broken() -> str | None:
    raise ConnectionRefusedError("postgresql://tide:hunter2@db/tide")


async def silent() -> str | None:
    await asyncio.sleep(60)
    return None


async def test_every_part_says_how_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(readiness, "CHECK_SECONDS", 0.01)
    parts = Readiness(asyncio.Event())
    for check in (fine, waiting, broken, silent):
        parts.add(check.__name__, check)
    assert await parts.parts() == {
        "fine": "ok",
        "waiting": "the disk is full",
        "broken": "it cannot be used (ConnectionRefusedError)",
        "silent": "it has not answered within 0.01 s",
    }


async def test_a_server_that_drains_is_not_ready() -> None:
    draining = asyncio.Event()
    parts = Readiness(draining)
    parts.add("fine", fine)
    draining.set()
    assert (await parts.parts())["server"] == "it is shutting down"
