from __future__ import annotations

from pathlib import Path

import httpx

from meshtide_server.app import create_app
from meshtide_server.settings import Settings


async def test_a_ticket_tells_its_life_and_is_not_kept(folder: Path) -> None:
    app = create_app(Settings(directory=folder, ticket_seconds=5.0))
    transport = httpx.ASGITransport(app)
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(transport=transport, base_url="http://test") as client,
    ):
        first, second = await client.post("/tickets"), await client.post("/tickets")
    assert first.status_code == 201
    assert first.json()["seconds"] == 5.0
    assert first.json()["ticket"] != second.json()["ticket"]
    assert first.headers["cache-control"] == "no-store"


async def test_only_post_gives_tickets(folder: Path) -> None:
    app = create_app(Settings(directory=folder))
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test") as client:
        answer = await client.get("/tickets")
    assert (answer.status_code, answer.headers["allow"]) == (405, "OPTIONS, POST")
