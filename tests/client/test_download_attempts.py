from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager
from http import HTTPStatus
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from websockets.asyncio.server import serve
from websockets.datastructures import Headers
from websockets.http11 import Response

from arriving import events_of
from meshtide_client.connection.address import MeshAddress
from meshtide_client.connection.link import Link
from meshtide_client.download.attempts import Attempts
from meshtide_client.download.holding import Holding
from meshtide_client.download.partial_file import PartialFile
from meshtide_codec.errors import PeerError, ProtocolError, StreamError, TransferError
from meshtide_codec.stream.container import write_container
from meshtide_codec.stream.messages import Done, Hello, PacketPart, encode_message
from meshtide_codec.stream.session import DoneEvent, PacketEvent, Until, error_frame
from server_end import ServerEnd
from streams import MadeUpStream

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable
    from pathlib import Path

    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request

STREAM = MadeUpStream((400, 900, 20, 300, 700, 10, 2000))
WHOLE = write_container(STREAM.header, STREAM.packet_bytes)
WINDOW = 256  # so small that most packets come in several parts
LINK = Link(window=WINDOW, retries=2, delay=0.001, timeout=5.0)


async def receive(
    server: Any, holding: Holding, *, link: Link = LINK, until: Until | None = None, transport: str = "auto"
) -> tuple[list[int], list[str]]:
    """Receive everything; returns the indices of the packets that came, and what was told."""
    sentences: list[str] = []
    attempts = Attempts(
        server.address, holding, until=until or Until(), link=link, notify=sentences.append, transport=transport
    )
    events = [event async for event in events_of(attempts)]
    assert isinstance(events[-1], DoneEvent)
    return [event.index for event in events if isinstance(event, PacketEvent)], sentences


async def test_a_whole_stream_arrives(serving: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    async with serving(STREAM) as server:
        file = PartialFile(path)
        indices, sentences = await receive(server, file)
        file.close()
    assert indices == list(range(len(STREAM.packets)))
    assert sentences == []
    assert path.read_bytes() == WHOLE
    assert server.paths == ["/meshes/vase/stream"]


async def test_cut_after_every_frame_no_packet_is_sent_twice(serving: Callable[..., Any], tmp_path: Path) -> None:
    cut = 0
    mid_packet = 0
    while True:
        path = tmp_path / f"{cut}.tide"
        async with serving(STREAM, cuts=[cut]) as server:
            file = PartialFile(path)
            await receive(server, file)
            mid_packet += 0 < file.size < len(WHOLE)
            file.close()
        assert server.finished_packets == list(range(len(STREAM.packets)))
        assert path.read_bytes() == WHOLE
        if server.connections == 1:
            break
        cut += 1
    assert cut > 20


@hypothesis_settings(max_examples=25)
@given(cuts=st.lists(st.integers(2, 12), max_size=6), restarts=st.sets(st.integers(0, 5)))
def test_however_often_it_is_cut_no_packet_is_sent_twice(
    serving_function: Callable[..., Any],
    tmp_path_factory: pytest.TempPathFactory,
    cuts: list[int],
    restarts: set[int],
) -> None:
    """Connections are cut after random frames; after some of them the client is a new process with the same file."""
    path = tmp_path_factory.mktemp("cuts") / "a.tide"

    async def run() -> list[int]:
        async with serving_function(STREAM, cuts=list(cuts)) as server:
            done = False
            while not done:
                retries = 0 if server.connections in restarts else 20
                file = PartialFile(path)
                try:
                    await receive(server, file, link=Link(window=WINDOW, retries=retries, delay=0.001))
                    done = True
                except TransferError as error:
                    assert "was lost" in str(error)
                file.close()
            return list(server.finished_packets)

    assert asyncio.run(run()) == list(range(len(STREAM.packets)))
    assert path.read_bytes() == WHOLE


async def test_giving_up_tells_what_is_held(serving: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    file = PartialFile(path)
    async with serving(STREAM, cuts=[8, 1, 1, 1]) as server:
        with pytest.raises(TransferError) as caught:
            await receive(server, file)
    file.close()
    message = str(caught.value)
    assert "the connection to http://127.0.0.1" in message
    assert "after 2 more attempts" in message
    assert "is complete" in message
    assert str(path) in message
    assert server.connections == 3


async def test_packets_that_arrive_reset_the_count_of_retries(serving: Callable[..., Any]) -> None:
    stream = MadeUpStream((100,) * 8)
    async with serving(stream, cuts=[7, 2, 2, 2, 2]) as server:
        holding = Holding()
        await receive(server, holding)
    assert holding.count == len(stream.packets)
    assert server.connections == 6


async def test_each_retry_is_told(serving: Callable[..., Any]) -> None:
    async with serving(STREAM, cuts=[5]) as server:
        _, sentences = await receive(server, Holding())
    assert len(sentences) == 1
    assert "trying again in" in sentences[0]
    assert "(1 of 2)" in sentences[0]


async def test_no_first_connection_is_not_retried(serving: Callable[..., Any]) -> None:
    async with serving(STREAM) as server:
        pass
    with pytest.raises(TransferError, match="Connection refused; no level is complete yet"):
        await receive(server, Holding())


@pytest.mark.parametrize("code", ["not-ready", "shutting-down", "timeout"])
async def test_a_passing_refusal_is_retried(serving: Callable[..., Any], code: str) -> None:
    async with serving(STREAM, refusals=[(code, "later")]) as server:
        indices, sentences = await receive(server, Holding())
    assert len(indices) == len(STREAM.packets)
    assert "later" in sentences[0]


async def test_a_passing_refusal_that_does_not_pass_is_raised(serving: Callable[..., Any]) -> None:
    async with serving(STREAM, refusals=[("not-ready", "later")] * 9) as server:
        with pytest.raises(PeerError, match="later after 2 more attempts") as caught:
            await receive(server, Holding())
    assert caught.value.code == "not-ready"
    assert server.connections == 3


async def test_a_lasting_refusal_is_raised_at_once(serving: Callable[..., Any]) -> None:
    async with serving(STREAM, refusals=[("unknown-mesh", "there is no such mesh")]) as server:
        with pytest.raises(PeerError, match="there is no such mesh"):
            await receive(server, Holding())
    assert server.connections == 1


async def test_a_stream_that_has_changed_starts_over(serving: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "a.tide"
    other = MadeUpStream((300, 900, 20, 300), seed=7)
    file = PartialFile(path)
    file.begin(STREAM.header, STREAM.header_bytes)
    file.append(0, STREAM.packet_bytes[0])
    async with serving(other) as server:
        indices, sentences = await receive(server, file)
    file.close()
    assert indices == list(range(len(other.packets)))
    assert "has changed on the server" in sentences[0]
    assert path.read_bytes() == write_container(other.header, other.packet_bytes)


async def test_only_what_is_wanted_arrives(serving: Callable[..., Any]) -> None:
    async with serving(STREAM) as server:
        holding = Holding()
        indices, _ = await receive(server, holding, until=Until(level=1))
    assert indices == list(range(STREAM.header.entry(1).packet_count))


async def test_bytes_are_counted_over_all_connections(serving: Callable[..., Any]) -> None:
    async with serving(STREAM, cuts=[6]) as server:
        attempts = Attempts(server.address, Holding(), until=Until(), link=LINK, notify=lambda _: None)
        async for _ in events_of(attempts):
            pass
    expected = len(STREAM.header_bytes) + sum(len(data) for data in STREAM.packet_bytes)
    assert expected <= attempts.received_bytes <= expected + max(len(data) for data in STREAM.packet_bytes)


@pytest.fixture(name="serving_function", scope="module")
def _serving_function(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """`serving` for tests that run many examples."""
    plugin = request.config.pluginmanager.get_plugin(str(request.path.parent / "conftest.py"))
    return plugin.serving  # type: ignore[union-attr, no-any-return]


@asynccontextmanager
async def dying_websockets(frames: int, *, file: bytes | None = WHOLE) -> AsyncIterator[tuple[MeshAddress, list[str]]]:
    """A server whose first websocket is closed after so many frames, later ones at once; it has the file, too."""
    asked: list[str] = []

    def answer(connection: ServerConnection, request: Request) -> Response | None:
        asked.append(request.path)
        if not request.path.endswith(".tide"):
            return None
        if file is None:
            return connection.respond(HTTPStatus.NOT_FOUND, "no such file")
        headers = Headers({"Content-Length": str(len(file)), "Connection": "close"})
        return Response(HTTPStatus.OK, "OK", headers, file)

    async def handle(socket: ServerConnection) -> None:
        session = ServerEnd("vase", STREAM)
        session.receive(await socket.recv())
        for _ in range(frames if asked.count("/meshes/vase/stream") == 1 else 0):
            if (frame := session.next_frame()) is not None:
                await socket.send(frame)

    async with serve(handle, "127.0.0.1", 0, compression=None, process_request=answer) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        yield MeshAddress.parse(f"http://127.0.0.1:{port}/meshes/vase"), asked


async def arrive(address: MeshAddress, holding: Holding, transport: str = "auto") -> tuple[Attempts, list[str]]:
    told: list[str] = []
    attempts = Attempts(
        address,
        holding,
        until=Until(),
        link=Link(retries=1, delay=0.001, timeout=5.0),
        notify=told.append,
        transport=transport,
    )
    async for _ in events_of(attempts):
        pass
    return attempts, told


@pytest.mark.parametrize("frames", [0, 1, 3])
async def test_where_websockets_die_another_transport_goes_on_with_what_came(frames: int, tmp_path: Path) -> None:
    path = tmp_path / "vase.tide"
    file = PartialFile(path)
    async with dying_websockets(frames) as (address, asked):
        attempts, told = await arrive(address, file)
    file.close()
    assert path.read_bytes() == WHOLE
    assert attempts.transport == "download"  # this server knows no ranges
    assert asked[-1] == "/meshes/vase.tide"
    assert told[-1].endswith("reading by download instead")
    assert "was lost" in told[-1]


async def test_a_transport_that_was_chosen_is_the_only_one() -> None:
    async with dying_websockets(1) as (address, asked):
        with pytest.raises(TransferError, match="was lost"):
            await arrive(address, Holding(), "websocket")
        assert set(asked) == {"/meshes/vase/stream"}
        asked.clear()
        attempts, told = await arrive(address, Holding(), "download")
        assert asked == ["/meshes/vase.tide"]
    assert (attempts.transport, told) == ("download", [])


async def test_why_the_first_transport_failed_is_told_in_the_end() -> None:
    async with dying_websockets(0, file=None) as (address, _):
        with pytest.raises(TransferError, match=r"was lost .* by download: .* HTTP status 404"):
            await arrive(address, Holding())


def frames_of(source: MadeUpStream, count: int, *, credit: int = 1 << 20) -> list[bytes]:
    """The first frames of an honest server: the header, then one packet a frame."""
    session = ServerEnd("vase", source)
    session.receive(encode_message(Hello(1, "vase", b"", (), None, None, None, credit)))
    return [frame for frame in (session.next_frame() for _ in range(count)) if frame is not None]


SMALL = MadeUpStream((30, 50, 20, 40))
DONE = encode_message(Done(99, 10**6, more=False))
LIES: dict[str, tuple[list[bytes], type[Exception], str]] = {
    "done early": (
        [*frames_of(SMALL, 3), DONE],
        ProtocolError,
        "says that all is sent, but 2 of 4 packets are missing",
    ),
    "done at once": ([*frames_of(SMALL, 1), DONE], ProtocolError, "4 of 4 packets are missing"),
    "done first": ([DONE], ProtocolError, "all is sent before the header was"),
    "repeats a packet": ([*frames_of(SMALL, 3), frames_of(SMALL, 3)[2]], ProtocolError, "packet 1 was not asked for"),
    "leaves one out": (
        [*frames_of(SMALL, 2), frames_of(SMALL, 4)[3]],
        ProtocolError,
        "packet 2 arrived where packet 1",
    ),
    "says nothing": ([*frames_of(SMALL, 3), b"wait"], TransferError, "nothing came from"),
    "closes cleanly": (frames_of(SMALL, 3), TransferError, "the connection to .* was lost"),
    "gives up": ([*frames_of(SMALL, 3), error_frame("gone", "no more")], PeerError, "no more"),
    "sends other bytes": (
        [*frames_of(SMALL, 3), encode_message(PacketPart(2, 0, bytes(20)))],
        StreamError,
        "checksum is",
    ),
}


@asynccontextmanager
async def lying(listening: Callable[..., Any], script: list[bytes]) -> AsyncIterator[tuple[MeshAddress, list[bytes]]]:
    """A server that says the same to everybody; b"wait" lets it fall silent. Yields what it was asked, too."""
    hellos: list[bytes] = []

    async def handle(socket: ServerConnection) -> None:
        hellos.append(bytes(await socket.recv()))  # type: ignore[arg-type]
        for frame in script:
            await (socket.wait_closed() if frame == b"wait" else socket.send(frame))

    async with listening(handle) as address:
        yield address, hellos


@pytest.mark.parametrize("name", LIES)
async def test_a_part_is_never_passed_off_as_the_whole(
    name: str, listening: Callable[..., Any], tmp_path: Path
) -> None:
    script, kind, message = LIES[name]
    file = PartialFile(tmp_path / "vase.tide")
    link = Link(retries=0, delay=0.001, timeout=0.2)
    async with lying(listening, script) as (address, _):
        attempts = Attempts(address, file, until=Until(), link=link, notify=lambda _: None, transport="websocket")
        with pytest.raises(kind, match=message) as caught:
            async for _ in events_of(attempts):
                pass
    held = file.count
    file.close()
    told = str(caught.value)
    if name == "done first":
        assert held == 0
        return
    left = [entry.kind.label for entry in SMALL.header.packets[held:]]
    assert f"{len(left)} of 4 packets are missing ({sum(map(len, SMALL.packet_bytes[held:]))} bytes" in told
    assert f"from level {SMALL.header.packets[held].level} on" in told
    assert all(f"{left.count(kind)} {kind}" in told for kind in left)
    assert told.count("packets are missing") == 1
    if held:
        assert "is kept in" in told
    whole = write_container(SMALL.header, SMALL.packet_bytes)
    assert (tmp_path / "vase.tide").read_bytes() == whole[: len(whole) - sum(map(len, SMALL.packet_bytes[held:]))]


@pytest.mark.parametrize("frames", [1, 2, 3])
async def test_the_same_bytes_again_and_again_are_no_progress(frames: int, listening: Callable[..., Any]) -> None:
    """Whatever the client says that it holds, this server begins at the beginning, and drops the connection."""
    async with lying(listening, frames_of(SMALL, frames)) as (address, hellos):
        holding = Holding()
        with pytest.raises((TransferError, ProtocolError)):
            await receive(SimpleNamespace(address=address), holding, transport="websocket")
    assert len(hellos) <= 1 + LINK.retries
    assert holding.count == frames - 1


async def test_a_stream_that_changes_again_and_again_is_given_up(listening: Callable[..., Any]) -> None:
    streams = [SMALL, MadeUpStream((30, 50, 20, 40), seed=5)]
    asked = 0

    async def handle(socket: ServerConnection) -> None:
        nonlocal asked
        await socket.recv()
        asked += 1
        for frame in frames_of(streams[asked % 2], 3):
            await socket.send(frame)

    async with listening(handle) as address:
        with pytest.raises(ProtocolError, match="has changed on the server 4 times"):
            await receive(SimpleNamespace(address=address), Holding(), transport="websocket")
    assert asked == LINK.retries + 3


async def test_the_waits_between_attempts_are_as_many_as_the_retries(
    listening: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    pauses: list[float] = []
    link = Link(retries=4, delay=1.0, longest_delay=3.0)

    async def sleep(seconds: float) -> None:
        pauses.append(seconds)

    monkeypatch.setattr("meshtide_client.download.attempts.asyncio", SimpleNamespace(sleep=sleep))
    async with lying(listening, frames_of(SMALL, 2)) as (address, hellos):
        with pytest.raises(ProtocolError, match="packet 0 was not asked for"):
            await receive(SimpleNamespace(address=address), Holding(), link=link, transport="websocket")
        assert (len(hellos), len(pauses)) == (2, 1)
    async with lying(listening, frames_of(SMALL, 1)) as (address, hellos):
        with pytest.raises(TransferError, match="after 4 more attempts"):
            await receive(SimpleNamespace(address=address), Holding(), link=link, transport="websocket")
    assert (len(hellos), len(pauses)) == (5, 5)
    assert all(pause <= 3.0 * 1.25 for pause in pauses)
