import asyncio
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from socket import SHUT_RDWR
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from websockets.asyncio.client import connect as connect_async
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from meshtide_codec.errors import PeerError
from meshtide_codec.stream.container import PREAMBLE_BYTES, fingerprint, preamble
from meshtide_codec.stream.messages import (
    LARGEST_MESSAGE,
    PROTOCOL_VERSION,
    Credit,
    Error,
    Hello,
    decode_message,
    encode_message,
)
from meshtide_codec.stream.session import ClientSession, DoneEvent, HeaderEvent, PacketEvent, Until, error_frame
from meshtide_server.hosting.mesh import HostedMesh, MeshSource
from meshtide_server.settings import Settings

from ..conftest import LiveServer, running
from ..made_streams import make_stream

SMALL = make_stream()
LARGE_PAYLOADS = (3000, 500, 600_000, 700_000, 50, 4_000_000)
LARGE = make_stream(1, LARGE_PAYLOADS)


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    folder = tmp_path_factory.mktemp("meshes")
    (folder / "small.tide").write_bytes(SMALL)
    (folder / "large.tide").write_bytes(LARGE)
    (folder / "broken.tide").write_bytes(SMALL[:-1])
    with running(Settings(directory=folder, rescan_seconds=0)) as server:
        yield server


def join(live: LiveServer, mesh: str, **options: Any) -> AbstractContextManager[ClientConnection]:
    return connect(f"{live.socket_url}/meshes/{mesh}/stream", compression=None, max_size=LARGEST_MESSAGE, **options)


def hello(mesh: str, *, credit: int = 1 << 20, protocol: int = PROTOCOL_VERSION) -> bytes:
    return encode_message(Hello(protocol, mesh, b"", (), None, None, None, credit))


def collect(connection: ClientConnection, session: ClientSession) -> tuple[bytes, DoneEvent]:
    """Stream to the end; returns what a file of it would hold (the packets alone when resumed)."""
    data = b""
    connection.send(session.hello())
    while True:
        for event in session.receive(connection.recv(10)):
            if isinstance(event, HeaderEvent):
                data += b"" if event.resumed else preamble(event.header_bytes)
            elif isinstance(event, PacketEvent):
                data += event.data
            else:
                return data, event
        grant = session.credit_frame()
        if grant is not None:
            with suppress(ConnectionClosed):  # the server may have sent all and closed by now; recv has what it sent
                connection.send(grant)


def refusal(connection: ClientConnection) -> tuple[Error, ConnectionClosed]:
    """The error frame and the close that follow now, whatever was sent before."""
    error: Error | None = None
    try:
        while True:
            message = decode_message(connection.recv(10))
            if isinstance(message, Error):
                error = message
    except ConnectionClosed as closed:
        assert error is not None
        return error, closed


def close_code(closed: ConnectionClosed) -> int:
    assert closed.rcvd is not None
    return closed.rcvd.code


@pytest.mark.parametrize(("mesh", "whole"), [("small", SMALL), ("large", LARGE)])
def test_a_stream_is_the_file(live: LiveServer, mesh: str, whole: bytes) -> None:
    with join(live, mesh) as connection:
        data, done = collect(connection, ClientSession(mesh))
        assert data == whole
        assert not done.more
        with pytest.raises(ConnectionClosed) as closed:
            connection.recv(5)
    assert close_code(closed.value) == 1000
    assert live.running_streams(0) == 0


def test_nothing_is_compressed_below(live: LiveServer) -> None:
    with connect(f"{live.socket_url}/meshes/small/stream") as connection:
        assert connection.protocol.extensions == []


def test_a_bound_ends_the_stream_early_and_a_second_one_takes_only_the_rest(live: LiveServer) -> None:
    with join(live, "large") as connection:
        first = ClientSession("large", until=Until(level=1))
        data, done = collect(connection, first)
    assert (done.packets, done.more) == (3, True)
    assert first.header is not None
    header_bytes = first.header.to_bytes()
    with join(live, "large") as connection:
        rest, done = collect(connection, ClientSession("large", held_header=header_bytes, held=range(3)))
    assert data + rest == LARGE
    assert done.packets == 3
    assert len(rest) == done.size


def test_a_client_with_another_stream_starts_afresh(live: LiveServer) -> None:
    other = ClientSession("large", until=Until(level=2))
    with join(live, "large") as connection:
        collect(connection, other)
    assert other.header is not None
    with join(live, "small") as connection:
        data, done = collect(connection, ClientSession("small", held_header=other.header.to_bytes(), held=[0]))
    assert data == SMALL
    assert done.packets == 6


def test_a_connection_lost_in_the_middle_leaves_no_stream_behind(live: LiveServer) -> None:
    with join(live, "large") as connection:
        connection.send(hello("large"))
        connection.recv(5)
        assert live.running_streams(1) == 1
        connection.socket.shutdown(SHUT_RDWR)
        assert live.running_streams(0) == 0


def test_never_more_than_the_credit_is_sent(live: LiveServer) -> None:
    with join(live, "large") as connection:
        connection.send(hello("large", credit=100_000))
        received = 0
        with pytest.raises(TimeoutError):
            while True:
                received += len(connection.recv(0.3))
        assert 100_000 <= received < 101_000
        connection.send(encode_message(Credit(1000)))
        assert 1000 <= len(connection.recv(5)) < 1100


def test_unknown_mesh(live: LiveServer) -> None:
    with join(live, "teapot") as connection:
        error, closed = refusal(connection)
    assert (error.code, close_code(closed)) == ("unknown-mesh", 1008)
    assert "'teapot'" in error.message


def test_the_client_session_raises_what_the_server_says(live: LiveServer) -> None:
    session = ClientSession("teapot")
    with join(live, "teapot") as connection, pytest.raises(PeerError, match="unknown-mesh"):
        session.receive(connection.recv(5))


def test_failed_mesh(live: LiveServer) -> None:
    with join(live, "broken") as connection:
        error, closed = refusal(connection)
    assert (error.code, close_code(closed)) == ("mesh-failed", 1011)
    assert "the file ends after" in error.message


def test_a_mesh_that_is_being_encoded_says_how_far_it_is(live: LiveServer) -> None:
    mesh = HostedMesh("later", MeshSource("later.obj"))
    mesh.advance("levels", 0.42)
    meshes = live.app.parts.library.folder._meshes
    meshes["later"] = mesh
    try:
        with join(live, "later") as connection:
            error, closed = refusal(connection)
    finally:
        del meshes["later"]
    assert (error.code, close_code(closed)) == ("not-ready", 1013)
    assert "levels, 42%" in error.message


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ("hello", "speaks binary frames"),
        ("", "speaks binary frames"),
        (b"", "not a meshtide message"),
        (b"\xc1", "not a meshtide message"),
        (b"\x00" * 100, "not a meshtide message"),
        (encode_message(Credit(5)), "Credit is not expected here"),
        (hello("large"), "asks for mesh 'large' on the connection of 'small'"),
        (hello("small", protocol=99), "protocol version 99"),
    ],
)
def test_a_first_frame_out_of_place_is_a_protocol_error(live: LiveServer, frame: bytes | str, words: str) -> None:
    with join(live, "small") as connection:
        connection.send(frame)
        error, closed = refusal(connection)
    assert (error.code, close_code(closed)) == ("protocol", 1002)
    assert words in error.message


def test_a_second_hello_is_a_protocol_error(live: LiveServer) -> None:
    with join(live, "large") as connection:
        connection.send(hello("large", credit=10))
        connection.send(hello("large", credit=10))
        error, closed = refusal(connection)
    assert (error.code, close_code(closed)) == ("protocol", 1002)


def test_an_oversized_frame_is_refused_before_it_is_read(live: LiveServer) -> None:
    with join(live, "small") as connection:
        connection.send(bytes(LARGEST_MESSAGE + 1))
        with pytest.raises(ConnectionClosed) as closed:
            connection.recv(5)
    assert close_code(closed.value) == 1009


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=300) | st.text(max_size=50) | st.binary(max_size=60).map(lambda data: hello("small") + data))
def test_garbage_is_answered_with_a_protocol_error(live: LiveServer, frame: bytes | str) -> None:
    if frame == hello("small"):
        return
    with join(live, "small") as connection:
        connection.send(frame)
        error, closed = refusal(connection)
    assert (error.code, close_code(closed)) == ("protocol", 1002)


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200))
def test_garbage_in_the_middle_of_a_stream_is_too(live: LiveServer, frame: bytes) -> None:
    with join(live, "large") as connection:
        connection.send(hello("large", credit=1000))
        connection.recv(5)
        connection.send(b"\xc1" + frame)
        error, closed = refusal(connection)
    assert (error.code, close_code(closed)) == ("protocol", 1002)


def test_a_client_that_gives_up_is_not_argued_with(live: LiveServer) -> None:
    with join(live, "large") as connection:
        connection.send(hello("large", credit=10))
        connection.send(error_frame("full-disk", "no more room"))
        with pytest.raises(ConnectionClosed) as closed:
            while True:
                connection.recv(5)
    assert close_code(closed.value) == 1000


def test_pages_of_foreign_origins_are_refused(live: LiveServer) -> None:
    with pytest.raises(InvalidStatus) as refused:
        join(live, "small", origin="https://elsewhere.example")
    assert refused.value.response.status_code == 403
    with join(live, "small", origin=live.url) as connection:
        assert collect(connection, ClientSession("small"))[0] == SMALL


def test_no_hello_in_time(serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    live = serve(Settings(directory=folder, hello_timeout=0.2))
    started = time.monotonic()
    with join(live, "small") as connection:
        error, closed = refusal(connection)
    assert (error.code, close_code(closed)) == ("timeout", 1008)
    assert "no hello within 0.2 s" in error.message
    assert time.monotonic() - started < 3


def test_no_credit_in_time(serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    live = serve(Settings(directory=folder, stall_timeout=0.3))
    with join(live, "small") as connection:
        connection.send(hello("small", credit=100))
        for _ in range(3):
            time.sleep(0.05)
            connection.ping()  # talk without credit does not count
        error, closed = refusal(connection)
    assert (error.code, close_code(closed)) == ("timeout", 1008)
    assert "no credit" in error.message


def test_a_client_that_does_not_read_is_dropped(serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    (folder / "large.tide").write_bytes(make_stream(2, (10, 10, 10, 10, 10, 30_000_000)))
    live = serve(Settings(directory=folder, stall_timeout=0.3))
    with join(live, "large", max_queue=1) as connection:
        connection.send(hello("large", credit=1 << 40))
        assert live.running_streams(1) == 1
        assert live.running_streams(0) == 0
        connection.socket.shutdown(SHUT_RDWR)


def test_a_file_cut_short_ends_its_streams_only(serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    (folder / "large.tide").write_bytes(LARGE)
    live = serve(Settings(directory=folder, rescan_seconds=0))
    with join(live, "large") as connection:
        connection.send(hello("large", credit=10))
        connection.recv(5)
        with (folder / "large.tide").open("r+b") as file:
            file.truncate(PREAMBLE_BYTES + 1)
        connection.send(encode_message(Credit(1 << 30)))
        error, closed = refusal(connection)
    assert (error.code, close_code(closed)) == ("not-ready", 1013)
    with join(live, "small") as connection:
        assert collect(connection, ClientSession("small"))[0] == SMALL


def test_shutting_down_tells_running_streams(serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    live = serve(Settings(directory=folder))
    with join(live, "small") as waiting, join(live, "small") as silent:
        waiting.send(hello("small", credit=10))
        waiting.recv(5)
        assert live.running_streams(2) == 2
        live.stop()
        for connection in (waiting, silent):
            error, closed = refusal(connection)
            assert (error.code, close_code(closed)) == ("shutting-down", 1012)
            assert closed.rcvd is not None
            assert "shutting down" in closed.rcvd.reason


def test_fifty_clients_at_once(live: LiveServer) -> None:
    async def fetch() -> bytes:
        session = ClientSession("large", window=LARGEST_MESSAGE)
        data = b""
        async with connect_async(
            f"{live.socket_url}/meshes/large/stream", compression=None, max_size=LARGEST_MESSAGE
        ) as connection:
            await connection.send(session.hello())
            async for frame in connection:
                for event in session.receive(frame):
                    if isinstance(event, HeaderEvent):
                        data += preamble(event.header_bytes)
                    elif isinstance(event, PacketEvent):
                        data += event.data
                grant = session.credit_frame()
                if grant is not None:
                    with suppress(ConnectionClosed):
                        await connection.send(grant)
        return data

    async def fetch_all() -> list[bytes]:
        return await asyncio.gather(*(fetch() for _ in range(50)))

    assert all(data == LARGE for data in asyncio.run(fetch_all()))
    assert live.running_streams(0) == 0


def test_the_fingerprint_is_that_of_the_file(live: LiveServer) -> None:
    session = ClientSession("small")
    with join(live, "small") as connection:
        collect(connection, session)
    (length,) = struct.unpack_from("<I", SMALL, 10)
    assert session.header is not None
    assert fingerprint(session.header.to_bytes()) == fingerprint(SMALL[PREAMBLE_BYTES : PREAMBLE_BYTES + length])
