from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import AsyncIterator
from http import HTTPStatus
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import Depends
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from meshtide_codec.errors import OptionError
from meshtide_codec.stream.session import ClientSession
from meshtide_server.app import create_app
from meshtide_server.http.dependencies import require_write
from meshtide_server.refusals import RefusedError
from meshtide_server.security.access import Access
from meshtide_server.settings import Settings

READ, WRITE = "token-for-reading-0", "token-for-writing-0"


@pytest.fixture
def guarded(folder: Path) -> Settings:
    return Settings(directory=folder, rescan_seconds=0, read_tokens=READ, write_tokens=f"another-for-writing,{WRITE}")


@pytest.fixture
async def client(guarded: Settings) -> AsyncIterator[httpx.AsyncClient]:
    app = create_app(guarded)

    @app.post("/written", dependencies=[Depends(require_write)])
    async def written() -> str:
        return "yes"

    async with app.router.lifespan_context(app):
        await app.parts.library.folder.settled()
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test") as made:
            yield made


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


@pytest.mark.parametrize("path", ["/meshes", "/meshes/small", "/meshes/small.tide", "/meshes/unknown"])
async def test_reading_takes_a_token_where_there_is_one(client: httpx.AsyncClient, path: str) -> None:
    for headers in ({}, bearer("wrong"), {"Authorization": f"Basic {READ}"}, {"Authorization": READ}):
        answer = await client.get(path, headers=headers)
        assert answer.status_code == 401
        assert answer.json()["error"] == "unauthorized"
        assert answer.headers["www-authenticate"].startswith("Bearer")
        assert "wrong" not in answer.text
    for token in (READ, WRITE, "another-for-writing"):
        assert (await client.get(path, headers=bearer(token))).status_code in {200, 404}
    assert (await client.head("/meshes/small.tide")).status_code == 401
    assert (await client.get("/healthz")).status_code == 200


async def test_writing_takes_a_write_token(client: httpx.AsyncClient) -> None:
    assert (await client.post("/written")).status_code == 401
    assert (await client.post("/written", headers=bearer("wrong"))).status_code == 401
    reader = await client.post("/written", headers=bearer(READ))
    assert (reader.status_code, reader.json()["error"]) == (403, "read-only")
    assert (await client.post("/written", headers=bearer(WRITE))).status_code == 200


async def test_tickets_are_for_readers(client: httpx.AsyncClient) -> None:
    assert (await client.post("/tickets")).status_code == 401
    answer = await client.post("/tickets", headers=bearer(READ))
    assert answer.status_code == 201
    assert answer.headers["cache-control"] == "no-store"
    assert answer.json()["seconds"] == 30.0


def test_without_tokens_all_read_and_nobody_writes() -> None:
    access = Access(Settings(samples=True))
    access.check_read(None)
    access.check_stream(None, "whatever")
    assert access.readable_by_all
    assert not access.writable
    for token in (None, "", WRITE):
        with pytest.raises(RefusedError, match="takes no uploads") as caught:
            access.check_write(token)
        assert caught.value.status == HTTPStatus.FORBIDDEN


def test_settings_with_bad_tokens_are_refused(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="MESHTIDE_WRITE_TOKENS, token 2"):
        create_app(Settings(samples=True, write_tokens=f"{WRITE}, short"))
    with pytest.raises(OptionError, match="cannot be read"):
        create_app(Settings(samples=True, read_tokens_file=tmp_path / "missing"))


def test_tokens_are_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MESHTIDE_WRITE_TOKENS", WRITE)
    settings = Settings(samples=True)
    assert [token.get_secret_value() for token in settings.write_tokens] == [WRITE]
    assert WRITE not in repr(settings) + str(settings) + settings.model_dump_json()
    with pytest.raises(ValueError, match="write_tokens") as caught:
        Settings(samples=True, write_tokens={WRITE: 1})
    assert WRITE not in str(caught.value)


def greeted(url: str, **settings: Any) -> bool:
    """Whether a stream answers a hello."""
    with connect(url, **settings) as socket:
        socket.send(ClientSession("small").hello())
        return len(socket.recv()) > 100


def test_streams_take_a_token_or_a_ticket(guarded: Settings, serve: Any) -> None:
    server = serve(guarded)
    url = f"{server.socket_url}/meshes/small/stream"
    assert greeted(url, additional_headers=bearer(READ))
    ticket = httpx.post(f"{server.url}/tickets", headers=bearer(READ)).json()["ticket"]
    assert greeted(f"{url}?ticket={ticket}")
    for refused in (url, f"{url}?ticket={ticket}", f"{url}?ticket="):
        with pytest.raises(InvalidStatus) as caught:
            connect(refused)
        assert caught.value.response.status_code == 401
        assert "bad-ticket" in str(caught.value.response.body) or "?" not in refused
    assert server.running_streams(0) == 0


def test_a_real_server_logs_no_secret(folder: Path, tmp_path: Path) -> None:
    log, ready = tmp_path / "log", tmp_path / "ready"
    command = [
        sys.executable,
        "-m",
        "meshtide_server",
        str(folder),
        "--port",
        "0",
        "--announce",
        "--log-level",
        "debug",
    ]
    environment = {**os.environ, "MESHTIDE_READ_TOKENS": READ, "MESHTIDE_WRITE_TOKENS_FILE": str(ready)}
    ready.write_text(WRITE)
    with (
        log.open("wb") as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, env=environment) as process,
    ):
        assert process.stdout is not None
        url = process.stdout.readline().decode().split('"')[3]
        stream = f"{url.replace('http', 'ws', 1)}/meshes/small/stream"
        for token in (READ, WRITE, "wrong-" + READ):
            httpx.get(f"{url}/meshes", headers=bearer(token))
        ticket = httpx.post(f"{url}/tickets", headers=bearer(READ)).json()["ticket"]
        assert greeted(f"{stream}?ticket={ticket}")
        assert greeted(stream, additional_headers=bearer(WRITE))
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
    text = log.read_text()
    assert "/stream" in text
    assert "[struck out]" in text
    for secret in (READ, WRITE, ticket):
        assert secret not in text
