from __future__ import annotations

import struct
import zlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.errors import (
    ContainerError,
    LimitError,
    PacketError,
    StreamError,
    TruncatedError,
    VersionError,
)
from meshtide_codec.limits import Limits
from meshtide_codec.packets import MAGIC, Packet
from meshtide_codec.stream.container import (
    PREAMBLE_BYTES,
    ContainerReader,
    check_packet,
    fingerprint,
    preamble,
    read_available,
    read_container,
    write_container,
)
from meshtide_codec.stream.header import FORMAT_VERSION
from streams import MadeUpStream, encoded_grid

STREAM = MadeUpStream((30, 70, 5, 40))
FILE = write_container(STREAM.header, STREAM.packet_bytes)
STARTS = [PREAMBLE_BYTES + len(STREAM.header_bytes) + int(offset) for offset in STREAM.header.packet_offsets]


def test_layout() -> None:
    assert FILE[:8] == MAGIC
    assert struct.unpack("<HII", FILE[8:18]) == (
        FORMAT_VERSION,
        len(STREAM.header_bytes),
        zlib.crc32(STREAM.header_bytes),
    )
    assert FILE[18 : 18 + len(STREAM.header_bytes)] == STREAM.header_bytes
    assert preamble(STREAM.header_bytes) == FILE[: STARTS[0]]
    assert len(FILE) == STARTS[-1]


def test_round_trip() -> None:
    header, packets = read_container(FILE)
    assert header == STREAM.header
    assert list(packets) == STREAM.packets


def test_truncated_at_every_byte() -> None:
    for length in range(len(FILE)):
        with pytest.raises(TruncatedError, match="ends after" if length else "the file is empty"):
            read_container(FILE[:length])
        whole = sum(start <= length for start in STARTS[1:])
        if length < STARTS[0]:
            with pytest.raises(TruncatedError, match="nothing can be decoded"):
                read_available(FILE[:length])
        else:
            header, packets, problem = read_available(FILE[:length])
            assert header == STREAM.header
            assert list(packets) == STREAM.packets[:whole]
            assert isinstance(problem, TruncatedError)


def test_a_truncation_tells_its_place() -> None:
    with pytest.raises(TruncatedError) as caught:
        read_container(FILE[: STARTS[1] + 7])
    assert (caught.value.level, caught.value.packet, caught.value.offset) == (0, "Map&Conn", 7)


@pytest.mark.parametrize("flip", [0x01, 0x80, 0xFF])
def test_any_flipped_byte_is_noticed(flip: int) -> None:
    for position in range(len(FILE)):
        damaged = bytearray(FILE)
        damaged[position] ^= flip
        with pytest.raises(StreamError):
            read_container(damaged)


def test_packets_before_the_damage_stay_usable() -> None:
    damaged = bytearray(FILE)
    damaged[STARTS[2] + 3] ^= 1
    _, packets, problem = read_available(damaged)
    assert list(packets) == STREAM.packets[:2]
    assert isinstance(problem, PacketError)
    reader = ContainerReader()
    with pytest.raises(PacketError):
        reader.feed(damaged)
    assert reader.consumed == STARTS[2]
    assert "checksum" in str(problem)


def test_bytes_after_the_end_are_refused() -> None:
    with pytest.raises(ContainerError, match="3 bytes follow the last packet"):
        read_container(FILE + b"abc")


def test_foreign_files_and_other_versions() -> None:
    for foreign in (b"ply\nformat ascii 1.0", b"\x89PNG\r\n\x1a\n" + bytes(100), b"x"):
        with pytest.raises(ContainerError, match="not a .tide file"):
            read_container(foreign)
    for version, wrong in ((1, "older meshtide .format 1.: encode it again"), (5, "newer meshtide .format 5;")):
        with pytest.raises(VersionError, match=wrong):
            read_container(FILE[:8] + bytes([version, 0]) + FILE[10:])
        header = bytes([version]) + STREAM.header.to_bytes()[1:]
        with pytest.raises(VersionError, match=wrong):
            read_container(preamble(header))


def test_a_header_over_the_limit_is_refused_before_it_comes() -> None:
    reader = ContainerReader(Limits(header_bytes=10))
    with pytest.raises(LimitError, match="header of"):
        reader.feed(FILE[:PREAMBLE_BYTES])


@given(st.lists(st.integers(1, 60), min_size=1, max_size=40))
def test_pieces_of_any_size_give_the_same_packets(sizes: list[int]) -> None:
    reader = ContainerReader()
    packets: list[Packet] = []
    position = 0
    while position < len(FILE):
        for size in sizes:
            packets += reader.feed(FILE[position : position + size])
            position += size
            assert reader.consumed in (0, *STARTS)
    reader.finish()
    assert reader.complete
    assert packets == STREAM.packets
    assert reader.header_bytes == STREAM.header_bytes


def test_an_error_is_raised_again() -> None:
    reader = ContainerReader()
    with pytest.raises(ContainerError):
        reader.feed(b"nonsense")
    with pytest.raises(ContainerError, match="foreign"):
        reader.feed(FILE)


def test_a_packet_in_another_ones_place_is_refused() -> None:
    with pytest.raises(PacketError, match="bytes where the header promises"):
        check_packet(STREAM.header, 0, STREAM.packet_bytes[1])
    other = MadeUpStream((30, 70, 5, 40), seed=1)
    with pytest.raises(PacketError, match="checksum"):
        check_packet(STREAM.header, 0, other.packet_bytes[0])
    assert check_packet(STREAM.header, 1, STREAM.packet_bytes[1]) == STREAM.packets[1]


def test_fingerprints_tell_streams_apart() -> None:
    other = MadeUpStream((30, 70, 5, 40), seed=1)
    assert fingerprint(STREAM.header_bytes) != fingerprint(other.header_bytes)
    assert len(fingerprint(STREAM.header_bytes)) == 32


@given(st.data())
@settings(max_examples=100)
def test_mutated_files_raise_stream_errors_only(data: st.DataObject) -> None:
    original = encoded_grid().to_bytes()
    start = data.draw(st.integers(0, len(original)))
    junk = data.draw(st.binary(max_size=30))
    with pytest.raises(StreamError):
        read_container(original[:start] + junk + b"\0" + original[start:])
