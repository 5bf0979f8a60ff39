from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.errors import MeshtideError, OptionError, PacketError, PeerError, ProtocolError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.container import PREAMBLE_BYTES, fingerprint
from meshtide_codec.stream.messages import (
    LARGEST_MESSAGE,
    LARGEST_PART,
    Credit,
    Done,
    HeaderPart,
    Hello,
    PacketPart,
    decode_message,
    encode_message,
)
from meshtide_codec.stream.session import ClientSession, DoneEvent, HeaderEvent, PacketEvent, Until, error_frame
from server_end import ServerEnd
from streams import MadeUpStream

STREAM = MadeUpStream((100, 700_000, 30, 2000, 0, 5, 270_000))
COUNT = len(STREAM.packets)


def converse(
    client: ClientSession, source: MadeUpStream = STREAM, frames: int | None = None
) -> tuple[list[HeaderEvent | PacketEvent | DoneEvent], ServerEnd]:
    """Carry frames between the two ends until they are done, or until `frames` have been delivered."""
    server = ServerEnd("mesh", source)
    server.receive(client.hello())
    events = []
    while not client.finished and (frames is None or frames > 0):
        frame = server.next_frame()
        assert frame is not None
        assert len(frame) <= LARGEST_MESSAGE
        events += client.receive(frame)
        grant = client.credit_frame()
        if grant is not None:
            server.receive(grant)
        frames = None if frames is None else frames - 1
    return events, server


def packets_of(events: list[HeaderEvent | PacketEvent | DoneEvent]) -> list[int]:
    return [event.index for event in events if isinstance(event, PacketEvent)]


def test_a_whole_stream_arrives_in_order() -> None:
    client = ClientSession("mesh")
    events, server = converse(client)
    assert events[0] == HeaderEvent(STREAM.header, STREAM.header_bytes, resumed=False)
    received = [event for event in events if isinstance(event, PacketEvent)]
    assert [event.packet for event in received] == STREAM.packets
    assert [event.data for event in received] == STREAM.packet_bytes
    assert events[-1] == DoneEvent(COUNT, sum(map(len, STREAM.packet_bytes)), more=False)
    assert server.finished
    assert server.next_frame() is None
    assert client.received_bytes == server.sent_bytes


@given(st.integers(0, COUNT), st.one_of(st.integers(20_000, 1 << 21), st.just(LARGEST_PART)))
@settings(max_examples=30, deadline=None)
def test_resuming_after_any_packet_repeats_none(held: int, window: int) -> None:
    client = ClientSession("mesh", held_header=STREAM.header_bytes, held=range(held), window=window)
    events, _ = converse(client)
    assert events[0] == HeaderEvent(STREAM.header, STREAM.header_bytes, resumed=True)
    assert packets_of(events) == list(range(held, COUNT))
    assert client.received_bytes == sum(map(len, STREAM.packet_bytes[held:]))


@given(st.sets(st.integers(0, COUNT - 1)))
@settings(max_examples=30, deadline=None)
def test_any_holes_are_filled(held: set[int]) -> None:
    client = ClientSession("mesh", held_header=STREAM.header_bytes, held=held)
    events, _ = converse(client)
    assert packets_of(events) == sorted(set(range(COUNT)) - held)


@given(st.integers(1, 12))
@settings(max_examples=12, deadline=None)
def test_cut_after_any_frame_and_resumed_no_packet_comes_twice(frames: int) -> None:
    first, _ = converse(ClientSession("mesh"), frames=frames)
    held = packets_of(first)
    header = next((event.header_bytes for event in first if isinstance(event, HeaderEvent)), b"")
    second, _ = converse(ClientSession("mesh", held_header=header, held=held))
    assert held + packets_of(second) == list(range(COUNT))


def test_a_changed_stream_starts_over() -> None:
    other = MadeUpStream((100, 700_000, 30), seed=9)
    client = ClientSession("mesh", held_header=other.header_bytes, held=[0, 1])
    events, _ = converse(client)
    assert events[0] == HeaderEvent(STREAM.header, STREAM.header_bytes, resumed=False)
    assert packets_of(events) == list(range(COUNT))


def test_the_server_never_sends_more_than_was_granted() -> None:
    server = ServerEnd("mesh", STREAM)
    server.receive(encode_message(Hello(1, "mesh", b"", (), None, None, None, 1000)))
    granted = 1000
    while not server.finished:
        frame = server.next_frame()
        assert server.sent_bytes <= granted
        if frame is None:
            server.receive(encode_message(Credit(50_000)))
            granted += 50_000
    assert server.sent_bytes == len(STREAM.header_bytes) + sum(map(len, STREAM.packet_bytes))


def test_a_window_of_a_few_bytes_is_slow_but_works() -> None:
    source = MadeUpStream((10, 50))
    events, server = converse(ClientSession("mesh", window=7), source)
    assert packets_of(events) == [0, 1]
    assert server.finished


def test_without_credit_nothing_is_sent() -> None:
    server = ServerEnd("mesh", STREAM)
    assert not server.greeted
    assert server.next_frame() is None
    server.receive(encode_message(Hello(1, "mesh", b"", (), None, None, None, 0)))
    assert server.greeted
    assert server.next_frame() is None
    assert not server.finished


@pytest.mark.parametrize(
    ("until", "count"),
    [
        (Until(), COUNT),
        (Until(level=0), COUNT),
        (Until(level=1), STREAM.header.entry(1).packet_count),
        (Until(level=2), 1),
        (Until(level=9), 1),
        (Until(error=0.2), STREAM.header.entry(1).packet_count),
        (Until(error=0.0), COUNT),
        (Until(size=0), 0),
        (Until(size=PREAMBLE_BYTES + len(STREAM.header_bytes) + len(STREAM.packet_bytes[0])), 1),
        (Until(size=10**9), COUNT),
        (Until(level=1, size=PREAMBLE_BYTES + len(STREAM.header_bytes) + 200), 1),
    ],
)
def test_until(until: Until, count: int) -> None:
    assert until.packet_count(STREAM.header, len(STREAM.header_bytes)) == count
    events, _ = converse(ClientSession("mesh", until=until))
    assert packets_of(events) == list(range(count))
    assert isinstance(events[-1], DoneEvent)
    assert events[-1].more == (count < COUNT)


def test_bounds_must_make_sense() -> None:
    for wrong in ({"level": -1}, {"error": -0.5}, {"error": float("nan")}, {"size": -1}):
        with pytest.raises(OptionError, match="must not be negative"):
            Until(**wrong)  # type: ignore[arg-type]
    with pytest.raises(OptionError, match="window"):
        ClientSession("mesh", window=0)


def hello(**changes: object) -> bytes:
    values = {
        "protocol": 1,
        "mesh": "mesh",
        "fingerprint": b"",
        "held": (),
        "until_level": None,
        "until_error": None,
        "until_bytes": None,
        "credit": 1 << 20,
    }
    return encode_message(Hello(**(values | changes)))  # type: ignore[arg-type]


def test_the_server_refuses_a_credit_that_grants_nothing() -> None:
    server = ServerEnd("mesh", STREAM)
    server.receive(hello(credit=0))
    assert server.next_frame() is None
    with pytest.raises(ProtocolError, match="a credit of 0 bytes"):
        server.receive(encode_message(Credit(0)))
    server.receive(encode_message(Credit(1)))
    assert server.next_frame() is not None


def test_the_server_refuses_what_is_out_of_turn() -> None:
    server = ServerEnd("mesh", STREAM)
    with pytest.raises(ProtocolError, match="Credit is not expected"):
        server.receive(encode_message(Credit(1)))
    with pytest.raises(ProtocolError, match="protocol version 2"):
        server.receive(hello(protocol=2))
    with pytest.raises(ProtocolError, match="asks for mesh 'other'"):
        server.receive(hello(mesh="other"))
    server.receive(hello())
    with pytest.raises(ProtocolError, match="Hello is not expected"):
        server.receive(hello())
    with pytest.raises(ProtocolError, match="PacketPart is not expected"):
        server.receive(encode_message(PacketPart(0, 0, b"x")))
    with pytest.raises(PeerError, match="I give up"):
        server.receive(error_frame("gone", "I give up"))


MARK = b"m" * 32


@pytest.mark.parametrize(
    "frames",
    [
        [PacketPart(0, 0, b"x")],
        [Done(0, 0, more=False)],
        [Credit(5)],
        [HeaderPart(MARK, 10, 0, b"")],
        [HeaderPart(MARK, 10, 5, b"abc")],
        [HeaderPart(MARK, 10, 0, b"x" * 11)],
        [HeaderPart(MARK, 1 << 40, 0, b"x")],
        [HeaderPart(MARK, 10, 0, b"12345"), HeaderPart(b"n" * 32, 10, 5, b"67890")],
        [HeaderPart(MARK, 10, 0, b"1234567890")],
    ],
    ids=str,
)
def test_the_client_refuses_what_is_out_of_turn(frames: list[PacketPart]) -> None:
    client = ClientSession("mesh")
    with pytest.raises(ProtocolError):
        for frame in frames:
            client.receive(encode_message(frame))


def greeted_client(held: tuple[int, ...] = ()) -> ClientSession:
    client = ClientSession("mesh", held_header=STREAM.header_bytes, held=held)
    converse(client, frames=1)
    return client


@pytest.mark.parametrize(
    "part",
    [
        PacketPart(COUNT, 0, b"x"),
        PacketPart(0, 0, b""),
        PacketPart(0, 1, b"x"),
        PacketPart(0, 0, bytes(5000)),
        PacketPart(3, 0, b"x"),
    ],
    ids=lambda part: f"{part.index} at {part.offset}",
)
def test_the_client_refuses_parts_that_do_not_fit(part: PacketPart) -> None:
    with pytest.raises(ProtocolError):
        greeted_client(held=(3,)).receive(encode_message(part))


def test_parts_of_two_packets_must_not_mix() -> None:
    client = greeted_client()
    client.receive(encode_message(PacketPart(1, 0, STREAM.packet_bytes[1][:100])))
    with pytest.raises(ProtocolError, match="do not follow"):
        client.receive(encode_message(PacketPart(0, 100, b"x")))
    with pytest.raises(ProtocolError, match=f"{COUNT} of {COUNT} packets are missing"):
        client.receive(encode_message(Done(0, 0, more=False)))


def test_a_server_that_says_done_before_anything_is_not_believed() -> None:
    with pytest.raises(ProtocolError, match="all is sent before the header was"):
        ClientSession("mesh").receive(encode_message(Done(COUNT, 5, more=False)))


@pytest.mark.parametrize("until", [Until(), Until(level=1), Until(error=0.2), Until(size=2000), Until(level=9)])
@pytest.mark.parametrize("claimed", [0, COUNT])
def test_done_is_checked_against_header_and_bound(until: Until, claimed: int) -> None:
    wanted = until.packet_count(STREAM.header, len(STREAM.header_bytes))
    for sent in range(wanted):
        client = ClientSession("mesh", until=until)
        server = ServerEnd("mesh", STREAM)
        server.receive(client.hello())
        events: list[object] = []
        while sum(isinstance(event, PacketEvent) for event in events) < sent or client.header is None:
            frame = server.next_frame()
            assert frame is not None
            events += client.receive(frame)
            if (grant := client.credit_frame()) is not None:
                server.receive(grant)
        with pytest.raises(ProtocolError, match=f"{wanted - sent} of {wanted} packets are missing") as caught:
            client.receive(encode_message(Done(claimed, 10**9, more=False)))
        assert STREAM.header.packets[sent].kind.label in str(caught.value)
        assert not client.finished


@given(st.integers(0, 1 << 60), st.integers(0, 1 << 60), st.booleans())
def test_what_done_claims_is_not_believed(packets: int, size: int, more: bool) -> None:
    source = MadeUpStream((10, 50, 5, 7))
    until = Until(level=1)
    wanted = until.packet_count(source.header, len(source.header_bytes))
    client = ClientSession("mesh", until=until, held_header=source.header_bytes, held=[0])
    mark = fingerprint(source.header_bytes)
    client.receive(encode_message(HeaderPart(mark, len(source.header_bytes), 0, b"")))
    for index in range(1, wanted):
        client.receive(encode_message(PacketPart(index, 0, source.packet_bytes[index])))
    events = client.receive(encode_message(Done(packets, size, more)))
    assert events == [DoneEvent(wanted - 1, sum(map(len, source.packet_bytes[1:wanted])), more=True)]


def test_packets_outside_of_the_bound_are_refused() -> None:
    client = ClientSession("mesh", until=Until(level=1), held_header=STREAM.header_bytes, held=range(COUNT - 3))
    wanted = STREAM.header.entry(1).packet_count
    mark = fingerprint(STREAM.header_bytes)
    client.receive(encode_message(HeaderPart(mark, len(STREAM.header_bytes), 0, b"")))
    with pytest.raises(ProtocolError, match=f"packet {COUNT - 1} was not asked for"):
        client.receive(encode_message(PacketPart(COUNT - 1, 0, STREAM.packet_bytes[COUNT - 1][:5])))
    assert wanted < COUNT


def test_a_header_that_comes_again_does_not_cost_what_is_held() -> None:
    client = ClientSession("mesh", held_header=STREAM.header_bytes, held=[0, 2])
    mark = fingerprint(STREAM.header_bytes)
    part = HeaderPart(mark, len(STREAM.header_bytes), 0, STREAM.header_bytes)
    events = client.receive(encode_message(part))
    assert events == [HeaderEvent(STREAM.header, STREAM.header_bytes, resumed=True)]
    with pytest.raises(ProtocolError, match="packet 0 was not asked for"):
        client.receive(encode_message(PacketPart(0, 0, STREAM.packet_bytes[0])))


def test_a_damaged_packet_is_noticed() -> None:
    damaged = bytearray(STREAM.packet_bytes[0])
    damaged[-1] ^= 1
    with pytest.raises(PacketError, match="checksum"):
        greeted_client().receive(encode_message(PacketPart(0, 0, bytes(damaged))))


def test_a_refusal_of_the_server_is_passed_on() -> None:
    with pytest.raises(PeerError, match="no such mesh") as caught:
        ClientSession("mesh").receive(error_frame("unknown-mesh", "no such mesh"))
    assert caught.value.code == "unknown-mesh"


def test_nothing_may_follow_the_end() -> None:
    client = ClientSession("mesh", until=Until(size=0))
    converse(client)
    with pytest.raises(ProtocolError, match="after the end"):
        client.receive(encode_message(Credit(1)))


def test_a_header_over_the_limits_is_refused() -> None:
    with pytest.raises(ProtocolError, match="header of"):
        converse(ClientSession("mesh", limits=Limits(header_bytes=20)))


def test_long_explanations_are_cut() -> None:
    assert len(decode_message(error_frame("x", "y" * 5000)).message) == 1000  # type: ignore[union-attr]


@given(st.lists(st.binary(max_size=60), max_size=5))
def test_foreign_frames_raise_from_the_tree_only(frames: list[bytes]) -> None:
    for session in (ServerEnd("mesh", STREAM), ClientSession("mesh")):
        try:
            for frame in frames:
                session.receive(frame)
        except MeshtideError as error:
            assert isinstance(error, ProtocolError)
