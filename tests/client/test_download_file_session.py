from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_client.download import file_session
from meshtide_client.download.file_session import FileSession
from meshtide_codec.errors import ContainerError, LimitError, PacketError, TruncatedError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.container import PREAMBLE_BYTES, preamble
from meshtide_codec.stream.session import DoneEvent, Event, HeaderEvent, PacketEvent, Until
from streams import MadeUpStream

STREAM = MadeUpStream((100, 5000, 20, 900, 0, 7))
COUNT = len(STREAM.packets)
WHOLE = preamble(STREAM.header_bytes) + b"".join(STREAM.packet_bytes)


def by_ranges(session: FileSession, whole: bytes = WHOLE) -> tuple[list[Event], list[tuple[int, int]]]:
    """Answer what the session asks for, as a server that knows ranges."""
    events: list[Event] = []
    ranges = []
    while not session.finished:
        session.skip()
        start, end = session.wanted()
        ranges.append((start, end))
        assert len(ranges) < 5
        if start >= len(whole) > 0 and start < end:
            session.end(len(whole))
        events += session.feed(whole[start:end])
    return events, ranges


def indices(events: list[Event]) -> list[int]:
    return [event.index for event in events if isinstance(event, PacketEvent)]


@given(st.lists(st.integers(1, 3000), max_size=20), st.integers(0, COUNT), st.integers(0, 3))
def test_pieces_of_any_size_give_what_is_not_held(sizes: list[int], held: int, level: int) -> None:
    until = Until(level=level)
    session = FileSession(until=until, held_header=STREAM.header_bytes, held=held)
    events: list[Event] = []
    position = 0
    for size in [*sizes, len(WHOLE)]:
        events += session.feed(WHOLE[position : position + size])
        position += size
    assert session.finished
    wanted = until.packet_count(STREAM.header, len(STREAM.header_bytes))
    assert indices(events) == list(range(held, wanted))
    assert [event.data for event in events if isinstance(event, PacketEvent)] == STREAM.packet_bytes[held:wanted]
    assert isinstance(events[0], HeaderEvent)
    assert events[0].resumed
    sent = STREAM.packet_bytes[held:wanted]
    assert events[-1] == DoneEvent(len(sent), sum(map(len, sent)), more=wanted < COUNT)


@pytest.mark.parametrize("held", [0, 1, COUNT - 1, COUNT])
def test_ranges_bring_the_header_and_what_is_missing_in_one_piece(held: int) -> None:
    session = FileSession(held_header=STREAM.header_bytes if held else b"", held=held)
    events, ranges = by_ranges(session)
    assert indices(events) == list(range(held, COUNT))
    assert len(ranges) <= 2
    if held:
        header_end = PREAMBLE_BYTES + len(STREAM.header_bytes)
        assert ranges[0] == (0, header_end)
        rest = sum(map(len, STREAM.packet_bytes[held:]))
        assert session.received_bytes == header_end + rest


def test_a_long_header_is_asked_for_in_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_session, "FIRST_BYTES", 40)
    events, ranges = by_ranges(FileSession())
    assert indices(events) == list(range(COUNT))
    header_end = PREAMBLE_BYTES + len(STREAM.header_bytes)
    assert ranges == [(0, 40), (40, header_end), (header_end, len(WHOLE))]


def test_a_bound_ends_the_range() -> None:
    until = Until(level=1)
    session = FileSession(until=until, held_header=STREAM.header_bytes, held=1)
    events, ranges = by_ranges(session)
    wanted = until.packet_count(STREAM.header, len(STREAM.header_bytes))
    assert ranges[-1][1] == len(preamble(STREAM.header_bytes)) + int(STREAM.header.packet_offsets[wanted])
    assert isinstance(events[-1], DoneEvent)
    assert events[-1].more


def test_another_stream_is_not_resumed() -> None:
    other = MadeUpStream(seed=7)
    events, _ = by_ranges(FileSession(held_header=other.header_bytes, held=3))
    assert isinstance(events[0], HeaderEvent)
    assert not events[0].resumed
    assert indices(events) == list(range(COUNT))


@given(st.integers(0, len(WHOLE) - 1))
def test_a_file_cut_anywhere_is_told(cut: int) -> None:
    session = FileSession()
    session.feed(WHOLE[:cut])
    with pytest.raises(TruncatedError, match=f"ends after {cut} bytes" if cut else "the file is empty"):
        session.end(cut)


@given(st.integers(0, len(WHOLE) - 1), st.integers(1, 255))
def test_a_damaged_byte_is_told(position: int, flip: int) -> None:
    damaged = bytearray(WHOLE)
    damaged[position] ^= flip
    session = FileSession()
    with pytest.raises((ContainerError, PacketError, LimitError, TruncatedError)):
        session.feed(damaged)
        session.end(len(damaged))


def test_what_stands_before_damaged_bytes_is_given_out() -> None:
    start = len(preamble(STREAM.header_bytes)) + int(STREAM.header.packet_offsets[3])
    damaged = bytearray(WHOLE)
    damaged[start] ^= 1
    session = FileSession()
    assert indices(session.feed(damaged)) == [0, 1, 2]
    for call in (session.check, lambda: session.feed(b""), lambda: session.end(len(WHOLE))):
        with pytest.raises(PacketError, match="packet 3 is damaged"):
            call()


def test_a_file_that_ends_early_is_told_with_what_is_missing_of_the_bound() -> None:
    session = FileSession(until=Until(level=1))
    session.feed(WHOLE[: len(preamble(STREAM.header_bytes)) + int(STREAM.header.packet_offsets[2])])
    wanted = STREAM.header.entry(1).packet_count
    with pytest.raises(TruncatedError, match=f"{wanted - 2} of {wanted} packets are missing"):
        session.end(5)


def test_bytes_after_the_last_packet_are_told() -> None:
    session = FileSession()
    assert indices(session.feed(WHOLE + b"abc")) == list(range(COUNT))
    with pytest.raises(ContainerError, match="3 bytes follow the last packet"):
        session.check()
    assert not session.finished


def test_a_web_page_is_told_by_its_first_bytes() -> None:
    with pytest.raises(ContainerError, match="the first bytes are foreign"):
        FileSession().feed(b"<!doctype html><html>")


def test_limits_are_kept() -> None:
    with pytest.raises(LimitError, match="header of"):
        FileSession(limits=Limits(header_bytes=10)).feed(WHOLE[:PREAMBLE_BYTES])
