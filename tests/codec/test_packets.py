from __future__ import annotations

import pytest

from meshtide_codec.packets import Packet, PacketKind


def test_numbers_of_kinds_are_frozen() -> None:
    assert {kind.label: int(kind) for kind in PacketKind} == {
        "Base": 0,
        "Map&Conn": 1,
        "Param": 2,
        "Diff": 3,
        "Preview": 4,
        "Order": 5,
    }


@pytest.mark.parametrize(
    ("packet", "line"),
    [
        (Packet(PacketKind.MAP_CONN, 2, 0, bytes(10)), "Packet(Map&Conn, level 2, 10 bytes)"),
        (Packet(PacketKind.DIFF, 2, 5, bytes(10)), "Packet(Diff, level 2, slice 5, 10 bytes)"),
    ],
)
def test_a_packet_prints_itself_in_one_line(packet: Packet, line: str) -> None:
    assert repr(packet) == line
