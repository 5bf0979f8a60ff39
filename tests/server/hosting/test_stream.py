from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import ContainerError, LimitError, StreamError, TruncatedError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.container import read_container
from meshtide_server.hosting.stream import StoppedError, load_stream
from meshtide_server.store.range_reader import FileReader, MemoryReader

from ..made_streams import make_stream

WHOLE = make_stream()


def test_a_stream_gives_header_packets_and_ranges(tmp_path: Path) -> None:
    (tmp_path / "a.tide").write_bytes(WHOLE)
    stream = load_stream(FileReader(tmp_path / "a.tide"))
    header, packets = read_container(WHOLE)
    assert stream.header == header
    assert stream.size == len(WHOLE)
    with closing(stream.open()) as opened:
        for index, packet in enumerate(packets):
            assert opened.at_hand(stream.packet_offset(index), stream.packet_offset(index + 1)) == packet.payload
        assert opened.at_hand(0, stream.size) == WHOLE


def test_level_bytes_are_a_usable_prefix() -> None:
    stream = load_stream(MemoryReader(WHOLE))
    assert [stream.level_bytes(row) for row in stream.header.levels][-1] == len(WHOLE)
    assert stream.level_bytes(stream.header.levels[0]) == stream.packet_offset(1)


def test_etag_is_strong_and_tells_streams_apart() -> None:
    first, again, other = (load_stream(MemoryReader(make_stream(seed))) for seed in (1, 1, 2))
    assert first.etag == again.etag != other.etag
    assert first.etag.startswith('"')


@given(st.integers(0, len(WHOLE) - 1), st.integers(1, 255))
def test_any_changed_byte_is_found(position: int, change: int) -> None:
    damaged = bytearray(WHOLE)
    damaged[position] ^= change
    with pytest.raises(StreamError):
        load_stream(MemoryReader(bytes(damaged)))


@given(st.integers(0, len(WHOLE) - 1))
def test_any_cut_is_found(length: int) -> None:
    with pytest.raises(TruncatedError, match="ends|is empty"):
        load_stream(MemoryReader(WHOLE[:length]))


def test_bytes_after_the_end_are_found() -> None:
    with pytest.raises(ContainerError, match="3 bytes follow the last packet"):
        load_stream(MemoryReader(make_stream(payloads=(400, 30, 40, 2000, 50, 100_000)) + b"abc"))


def test_limits_hold(stream_bytes: Callable[..., bytes]) -> None:
    with pytest.raises(LimitError, match="accepts 1000"):
        load_stream(MemoryReader(stream_bytes()), Limits(vertices=1000))


def test_loading_stops_when_told_to() -> None:
    with pytest.raises(StoppedError):
        load_stream(MemoryReader(WHOLE), stopping=lambda: True)
