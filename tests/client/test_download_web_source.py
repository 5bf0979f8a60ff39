from __future__ import annotations

import socket
import threading
from typing import Any

import pytest

from meshtide_client.connection.link import Link
from meshtide_client.download.web_source import WebSource
from meshtide_codec.errors import PeerError, ProtocolError, TransferError, TruncatedError
from web_server import WebServer, web_server

CONTENT = bytes(range(256)) * 40


def source(url: str, *, ranges: bool = True, timeout: float = 5.0) -> WebSource:
    return WebSource(url, url, Link(timeout=timeout, token=None), ranges=ranges, local=True)


async def read(made: WebSource, start: int, end: int | None) -> tuple[bytes, Any]:
    async with made.read(start, end) as reading:
        return b"".join([piece async for piece in reading.pieces]), reading


@pytest.mark.parametrize(("start", "end"), [(0, 10), (100, 101), (5, None), (10_000, 20_000)])
async def test_ranges_are_read(start: int, end: int | None) -> None:
    with web_server(WebServer(CONTENT)) as server:
        made = source(server.url)
        data, reading = await read(made, start, end)
        await made.close()
    assert data == CONTENT[start:end]
    assert (reading.start, reading.ranged, reading.size, made.name) == (start, True, len(CONTENT), "http")


@pytest.mark.parametrize("ranges", [True, False])
async def test_a_server_without_ranges_gives_the_whole(ranges: bool) -> None:
    with web_server(WebServer(CONTENT, ranges=False)) as server:
        made = source(server.url, ranges=ranges)
        data, reading = await read(made, 500, 600)
        await made.close()
    assert data == CONTENT
    assert (reading.start, reading.ranged, made.name) == (0, False, "download")
    assert server.requests == [("/", "bytes=500-599" if ranges else None)]


@pytest.mark.parametrize("heedless", [False, True])  # a server that passes over If-Match is found out
async def test_a_file_that_has_changed_is_noticed_by_its_tag(heedless: bool) -> None:
    with web_server(WebServer(CONTENT, heedless=heedless)) as server:
        made = source(server.url)
        await read(made, 0, 10)
        server.tag = '"second"'
        with pytest.raises(TransferError, match="has changed while it was read"):
            await read(made, 10, 20)
        assert (await read(made, 10, 20))[0] == CONTENT[10:20]
        await made.close()


async def test_a_file_whose_size_changes_is_found_out_without_tags() -> None:
    with web_server(WebServer(CONTENT, tag="")) as server:
        made = source(server.url)
        await read(made, 0, 10)
        server.content = CONTENT[:-1]
        with pytest.raises(TransferError, match="has changed while it was read"):
            await read(made, 10, 20)
        assert (await read(made, 10, 20))[0] == CONTENT[10:20]
        await made.close()


@pytest.mark.parametrize(
    "place", ["bytes 0-9/5", "bytes 9-0/100", "bytes 0-9/9", "bytes 0-99/*", "bytes */5", "0-9/100"]
)
async def test_ranges_that_cannot_be_are_refused(place: str) -> None:
    with web_server(WebServer(CONTENT, headers={"Content-Range": place})) as server:
        made = source(server.url)
        with pytest.raises(ProtocolError, match="another range"):
            await read(made, 0, 10)
        await made.close()


async def test_weak_tags_are_not_relied_on() -> None:
    with web_server(WebServer(CONTENT, tag='W/"first"')) as server:
        made = source(server.url)
        await read(made, 0, 10)
        server.tag = 'W/"second"'
        assert (await read(made, 10, 20))[0] == CONTENT[10:20]
        await made.close()


@pytest.mark.parametrize(
    ("settings", "start", "error", "message"),
    [
        ({}, 20_000, TruncatedError, "ends before byte 20000"),
        ({"shift": -1}, 100, ProtocolError, "another range"),
        ({"status": 401}, 0, PeerError, "may not be read"),
        ({"status": 429}, 0, TransferError, "not available now"),
        ({"status": 410}, 0, ProtocolError, "HTTP status 410"),
        ({"cuts": [4]}, 0, TransferError, "was lost"),
        ({"status": 302}, 0, ProtocolError, "HTTP status 302"),
    ],
)
async def test_what_is_wrong_is_told(
    settings: dict[str, Any], start: int, error: type[Exception], message: str
) -> None:
    with web_server(WebServer(CONTENT, **settings)) as server:
        made = source(server.url)
        with pytest.raises(error, match=message):
            await read(made, start, start + 10)
        await made.close()


async def test_silence_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        accepted: list[socket.socket] = []
        thread = threading.Thread(target=lambda: accepted.append(listener.accept()[0]))
        thread.start()
        made = source(f"http://127.0.0.1:{listener.getsockname()[1]}", timeout=0.1)
        with pytest.raises(TransferError, match=r"nothing came from .* for 0.1 seconds"):
            await read(made, 0, 10)
        await made.close()
        thread.join()
        for connection in accepted:
            connection.close()
