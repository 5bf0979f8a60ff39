from __future__ import annotations

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import PacketError
from meshtide_codec.stream.packets import FRAMING_BYTES, LARGEST_LEVEL, LARGEST_SLICE, Packet, PacketKind

PACKETS = st.builds(
    Packet,
    st.sampled_from(PacketKind),
    st.integers(0, LARGEST_LEVEL),
    st.integers(0, LARGEST_SLICE),
    st.binary(max_size=400),
)


@given(PACKETS)
def test_round_trip_and_framing(packet: Packet) -> None:
    data = packet.to_bytes()
    assert Packet.from_bytes(data) == packet
    assert len(data) - len(packet.payload) <= FRAMING_BYTES


def test_bytes_of_a_packet_are_frozen() -> None:
    assert Packet(PacketKind.DIFF, 3, 0, b"abc").to_bytes().hex() == "94030300c403616263"
    assert Packet(PacketKind.MAP_CONN, 0, 300, b"").to_bytes().hex() == "940100cd012cc400"


@given(st.binary(max_size=60))
def test_any_bytes_are_a_packet_or_a_packet_error(data: bytes) -> None:
    try:
        packet = Packet.from_bytes(data)
    except PacketError:
        return
    assert msgpack.unpackb(data) == [packet.kind, packet.level, packet.slice, packet.payload]


@pytest.mark.parametrize(
    "value",
    [
        [0, 0, 0],
        [6, 0, 0, b""],
        [-1, 0, 0, b""],
        [0, LARGEST_LEVEL + 1, 0, b""],
        [0, 0, LARGEST_SLICE + 1, b""],
        [0, 0, 0, "text"],
        [0, 0, 0, None],
        [True, 0, 0, b""],
        [0.0, 0, 0, b""],
        {"kind": 0},
        7,
    ],
)
def test_wrong_fields_are_refused(value: object) -> None:
    with pytest.raises(PacketError, match="not a packet"):
        Packet.from_bytes(msgpack.packb(value))


def test_a_packet_prints_itself_in_one_line() -> None:
    assert repr(Packet(PacketKind.MAP_CONN, 2, 0, bytes(10))) == "Packet(Map&Conn, level 2, 10 bytes)"
    assert repr(Packet(PacketKind.DIFF, 2, 5, bytes(10))) == "Packet(Diff, level 2, slice 5, 10 bytes)"
