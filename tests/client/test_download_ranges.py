from __future__ import annotations

import gzip
import tracemalloc
from pathlib import Path
from typing import Any

import pytest

from meshtide_client.connection.link import Link
from meshtide_client.download import file_session
from meshtide_client.download.stream import stream
from meshtide_codec.errors import (
    ContainerError,
    PacketError,
    PeerError,
    ProtocolError,
    StreamError,
    TransferError,
    TruncatedError,
)
from meshtide_codec.stream.session import Until
from streams import encoded_grid
from web_server import WebServer, web_server

ENCODED = encoded_grid()
WHOLE = ENCODED.to_bytes()
LEVELS = [row.level for row in ENCODED.header.levels]
QUICK = Link(retries=2, delay=0.001)


async def levels(url: str, **settings: Any) -> list[int]:
    return [level.level async for level in stream(url, **{"link": QUICK, **settings})]


@pytest.mark.parametrize("ranges", [True, False])
@pytest.mark.parametrize("transport", ["auto", "http", "download"])
async def test_every_level_comes_from_any_web_server(ranges: bool, transport: str, tmp_path: Path) -> None:
    path = tmp_path / "vase.tide"
    with web_server(WebServer(WHOLE, ranges=ranges)) as server:
        assert await levels(f"{server.url}/vase.tide", transport=transport, resume=path) == LEVELS
    assert path.read_bytes() == WHOLE
    assert (server.requests[0][1] is None) == (transport == "download")


async def test_only_what_is_wanted_is_read_and_only_what_is_missing_later(tmp_path: Path) -> None:
    path = tmp_path / "vase.tide"
    with web_server(WebServer(WHOLE)) as server:
        first = await levels(f"{server.url}/vase.tide", until=Until(level=LEVELS[1]), resume=path)
        held = path.stat().st_size
        assert held < len(WHOLE)
        server.requests.clear()
        assert await levels(f"{server.url}/vase.tide", resume=path) == LEVELS
    assert first == LEVELS[:2]
    assert server.requests[1] == ("/vase.tide", f"bytes={held}-{len(WHOLE) - 1}")
    assert path.read_bytes() == WHOLE


async def test_a_plain_download_stops_when_there_is_enough() -> None:
    content = WHOLE + bytes(1 << 23)  # what follows is never looked at
    with web_server(WebServer(content)) as server:
        assert await levels(f"{server.url}/v.tide", transport="download", until=Until(level=LEVELS[0])) == LEVELS[:1]
    assert server.sent < len(content)


@pytest.mark.parametrize("transport", ["http", "download"])
async def test_a_connection_that_is_cut_goes_on_where_it_was(transport: str, tmp_path: Path) -> None:
    path = tmp_path / "vase.tide"
    cuts = [len(WHOLE) // 3, len(WHOLE) // 2]
    told: list[str] = []
    with web_server(WebServer(WHOLE, cuts=cuts)) as server:
        assert await levels(f"{server.url}/v.tide", transport=transport, resume=path, notify=told.append) == LEVELS
    assert path.read_bytes() == WHOLE
    assert any("trying again" in sentence for sentence in told)


async def test_a_file_that_changes_meanwhile_is_read_anew(tmp_path: Path) -> None:
    path = tmp_path / "vase.tide"
    path.write_bytes(encoded_grid(12).to_bytes())
    told: list[str] = []
    with web_server(WebServer(WHOLE)) as server:
        assert await levels(f"{server.url}/vase.tide", resume=path, notify=told.append) == LEVELS
    assert path.read_bytes() == WHOLE
    assert any("has changed" in sentence for sentence in told)


async def test_a_file_that_changes_between_two_requests_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_session, "FIRST_BYTES", 40)
    server = WebServer(WHOLE)
    answer = server.answer

    def changing(request: Any) -> None:
        answer(request)
        server.tag = f'"{len(server.requests)}"'

    monkeypatch.setattr(server, "answer", changing)
    with web_server(server), pytest.raises(TransferError, match="has changed while it was read after 2 more attempts"):
        await levels(f"{server.url}/vase.tide", transport="http")


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"content": b"<!doctype html>" * 9}, ContainerError, "not a .tide file"),
        ({"content": WHOLE[:-1]}, TruncatedError, "ends after"),
        ({"content": WHOLE[:20]}, TruncatedError, "inside its header"),
        ({"content": WHOLE[:-1] + b"\x00\x01"}, StreamError, "damaged"),
        ({"content": WHOLE[:-1] + bytes([WHOLE[-1] ^ 1])}, PacketError, "is damaged"),
        ({"content": WHOLE, "shift": 1}, ProtocolError, "another range"),
        ({"content": WHOLE, "headers": {"Content-Encoding": "gzip"}}, ProtocolError, "compressed"),
        ({"content": WHOLE, "status": 404}, ProtocolError, "HTTP status 404; check the address"),
        ({"content": WHOLE, "status": 403}, PeerError, "may not be read"),
        ({"content": WHOLE, "status": 503}, TransferError, "not available now"),
        ({"content": WHOLE, "status": 404, "problem": b'{"error": "gone", "message": "moved"}'}, PeerError, "moved"),
    ],
)
async def test_what_is_wrong_is_told(settings: dict[str, Any], error: type[Exception], message: str) -> None:
    with web_server(WebServer(**settings)) as server, pytest.raises(error, match=message):
        await levels(f"{server.url}/vase.tide", transport="http")


async def test_wrong_ranges_are_answered_by_a_plain_download() -> None:
    told: list[str] = []
    with web_server(WebServer(WHOLE, shift=1)) as server:
        assert await levels(f"{server.url}/vase.tide", notify=told.append) == LEVELS
    assert len(told) == 1
    assert "answers with another range" in told[0]
    assert told[0].endswith("; reading by download instead")


async def test_a_host_without_websockets_is_read_over_http() -> None:
    told: list[str] = []
    with web_server(WebServer(WHOLE)) as server:
        assert await levels(f"{server.url}/meshes/vase", notify=told.append) == LEVELS
    assert [path for path, _ in server.requests] == ["/meshes/vase/stream"] + ["/meshes/vase.tide"] * (
        len(server.requests) - 1
    )
    assert len(told) == 1
    assert "reading by http instead" in told[0]


async def test_the_token_goes_to_servers_of_meshtide_only() -> None:
    link = Link(retries=0, token="my-own-token")  # noqa: S106
    with web_server(WebServer(WHOLE)) as server:
        await levels(f"{server.url}/vase.tide", link=link)
        assert set(server.authorizations) == {None}
        server.authorizations.clear()
        await levels(f"{server.url}/meshes/vase", link=link)
        assert set(server.authorizations) == {"Bearer my-own-token"}


async def test_local_files_are_read(tmp_path: Path) -> None:
    path = tmp_path / "vase.tide"
    path.write_bytes(WHOLE)
    assert await levels(str(path)) == LEVELS
    assert await levels(path.as_uri(), until=Until(level=LEVELS[0])) == LEVELS[:1]
    with pytest.raises(FileNotFoundError):
        await levels(str(tmp_path / "missing.tide"))


async def test_no_server_is_told() -> None:
    with pytest.raises(TransferError, match="cannot read http://127.0.0.1:9/vase.tide"):
        await levels("http://127.0.0.1:9/vase.tide")


COUNT = len(ENCODED.header.packets)
HEADER_END = len(WHOLE) - sum(entry.length for entry in ENCODED.header.packets)


@pytest.mark.parametrize("transport", ["http", "download", "local"])
@pytest.mark.parametrize("held", [0, 1, COUNT - 1])
@pytest.mark.parametrize("unframed", [False, True])
async def test_a_file_that_ends_early_is_told_with_what_is_missing(
    transport: str, held: int, unframed: bool, tmp_path: Path
) -> None:
    offsets = HEADER_END + ENCODED.header.packet_offsets
    part = WHOLE[: int(offsets[held]) + 1]
    path = tmp_path / "kept.tide"
    with web_server(WebServer(part, unframed=unframed)) as server:
        url = f"{server.url}/vase.tide"
        if transport == "local":
            (tmp_path / "vase.tide").write_bytes(part)
            url, transport = str(tmp_path / "vase.tide"), "auto"
        with pytest.raises(TruncatedError, match=f"ends after {len(part)} bytes") as caught:
            await levels(url, transport=transport, resume=path)
    entry = ENCODED.header.packets[held]
    left = len(WHOLE) - int(offsets[held])
    assert f"{COUNT - held} of {COUNT} packets are missing ({left} bytes, from level {entry.level} on" in str(
        caught.value
    )
    assert (caught.value.level, caught.value.packet) == (entry.level, entry.kind.label)
    assert "is kept in" in str(caught.value)
    assert path.read_bytes() == part[:-1]


async def test_ranges_with_other_bytes_are_refused_and_what_came_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "kept.tide"
    start = HEADER_END + int(ENCODED.header.packet_offsets[2])
    wrong = WHOLE[:start] + bytes(len(WHOLE) - start)
    with web_server(WebServer(wrong)) as server:
        with pytest.raises(PacketError, match="packets are missing"):
            await levels(f"{server.url}/vase.tide", transport="http", resume=path)
        assert path.read_bytes() == WHOLE[:start]
        server.content = WHOLE
        assert await levels(f"{server.url}/vase.tide", transport="http", resume=path) == LEVELS


async def test_a_stream_that_changes_for_ever_is_given_up(tmp_path: Path) -> None:
    """Each answer is cut after some packets, and the next one is of another stream."""
    contents = [WHOLE, encoded_grid(12).to_bytes()]
    server = WebServer(WHOLE, cuts=[len(contents[1]) // 2] * 99)
    answer = server.answer

    def changing(request: Any) -> None:
        server.content = contents[len(server.requests) % 2]
        server.tag = f'"{len(server.requests) % 2}"'
        answer(request)

    server.answer = changing  # type: ignore[method-assign]
    with web_server(server), pytest.raises(ProtocolError, match="has changed on the server"):
        await levels(f"{server.url}/vase.tide", transport="download", resume=tmp_path / "kept.tide")
    assert len(server.requests) <= 2 * (QUICK.retries + 2)


@pytest.mark.parametrize(
    ("transport", "cut", "message"), [("http", 50, "no level is"), ("download", HEADER_END + 5, "packets are missing")]
)
async def test_attempts_without_new_bytes_are_counted(transport: str, cut: int, message: str) -> None:
    failing = pytest.raises(TransferError, match=f"after 2 more attempts; .*{message}")
    with web_server(WebServer(WHOLE, cuts=[cut] * 99)) as server, failing:
        await levels(f"{server.url}/vase.tide", transport=transport)
    assert len(server.requests) == 1 + QUICK.retries


@pytest.mark.parametrize("coding", ["gzip", "deflate"])
async def test_a_proxy_that_compresses_is_understood(coding: str, tmp_path: Path) -> None:
    path = tmp_path / "kept.tide"
    told: list[str] = []
    with web_server(WebServer(WHOLE, coding=coding)) as server:
        assert await levels(f"{server.url}/vase.tide", transport="download", resume=path) == LEVELS
        assert path.read_bytes() == WHOLE
        path.write_bytes(WHOLE[:-5])
        assert await levels(f"{server.url}/vase.tide", notify=told.append, resume=path) == LEVELS
        assert path.read_bytes() == WHOLE
        assert set(server.accepted) == {"identity"}
    assert len(told) == 1  # compressed ranges may mean either of two things
    assert told[0].endswith("reading by download instead")


async def test_a_compressed_download_that_is_cut_is_told() -> None:
    failing = pytest.raises(TruncatedError, match=f"ends after {len(WHOLE) - 9} bytes.* 1 of {COUNT} packets")
    with web_server(WebServer(WHOLE[:-9], coding="gzip")) as server, failing:
        await levels(f"{server.url}/vase.tide", transport="download")
    packed = gzip.compress(WHOLE)
    failing = pytest.raises(TransferError, match="ended inside of its compression")
    with web_server(WebServer(packed[:-12], headers={"Content-Encoding": "gzip"})) as server, failing:
        await levels(f"{server.url}/vase.tide", transport="download")


async def test_a_bomb_is_not_expanded() -> None:
    bomb = gzip.compress(WHOLE + bytes(1 << 28))
    tracemalloc.start()
    failing = pytest.raises(ContainerError, match="bytes follow the last packet")
    with web_server(WebServer(bomb, headers={"Content-Encoding": "gzip"})) as server, failing:
        await levels(f"{server.url}/vase.tide", transport="download")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1 << 25
