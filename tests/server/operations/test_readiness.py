import asyncio
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from meshtide_server.operations import readiness
from meshtide_server.operations.readiness import Readiness, check_store
from meshtide_server.settings import Settings
from meshtide_server.store import open_store

from ..conftest import LiveServer


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


async def test_a_store_that_answers_can_be_used() -> None:
    assert await check_store(open_store("memory:")) is None


def test_catalogue_and_store_are_asked(
    serve: Callable[[Settings], LiveServer], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = serve(Settings(data=tmp_path / "data"))
    answer = httpx.get(f"{live.url}/readyz")
    assert (answer.status_code, answer.json()["parts"]) == (200, dict.fromkeys(("library", "catalogue", "store"), "ok"))
    monkeypatch.setattr(live.app.parts.library.published.catalogue, "check", broken)
    monkeypatch.setattr(live.app.parts.library.published.store, "head", lambda _key: broken())
    answer = httpx.get(f"{live.url}/readyz")
    assert answer.status_code == 503
    for part in ("catalogue", "store"):
        assert answer.json()["parts"][part] == "it cannot be used (ConnectionRefusedError)"
    assert "hunter2" not in answer.text
