from __future__ import annotations

import pytest

from meshes import grid
from meshtide_codec.compact.difference_coding import SMALL_PACKET, DifferenceCoder, encode_packets
from meshtide_codec.compact.octree import build_octree
from meshtide_codec.compact.slices import Slices
from meshtide_codec.entropy.codec import PayloadWriter
from meshtide_codec.errors import DiffError
from meshtide_codec.quantize import quantize

BITS = 8
QUANTIZED = quantize(grid(12), BITS)
OCTREE = build_octree(QUANTIZED.positions, QUANTIZED.faces, BITS)
SLICES = Slices(BITS)


def coder() -> DifferenceCoder:
    return DifferenceCoder(OCTREE.levels[0], SLICES, 0, None)


def planes() -> list[bytes]:
    """Each bit plane in a payload of its own."""
    writing = coder()
    payloads = []
    for depth in range(1, BITS + 1):
        writer = PayloadWriter()
        writing.write(writer, OCTREE, depth)
        payloads.append(writer.payload())
    return payloads


def packet(first: int, last: int, writing: DifferenceCoder) -> bytes:
    """The bit planes of some depths in one payload."""
    writer = PayloadWriter()
    for depth in range(first, last + 1):
        writing.write(writer, OCTREE, depth)
    return writer.payload()


def test_bit_planes_travel_alone_or_together() -> None:
    for cut in range(1, BITS):
        writing, reading = coder(), coder()
        reading.decode(packet(1, cut, writing), OCTREE.levels[1 : cut + 1])
        assert reading.depth == cut
        reading.decode(packet(cut + 1, BITS, writing), OCTREE.levels[cut + 1 :])
        assert reading.depth == BITS
        assert (reading.state.cells == OCTREE.positions).all()


def test_a_damaged_packet_changes_nothing() -> None:
    writing, reading = coder(), coder()
    reading.decode(packet(1, BITS - 1, writing), OCTREE.levels[1:BITS])
    last = packet(BITS, BITS, writing)
    with pytest.raises(DiffError, match="bytes follow"):
        reading.decode(last + bytes(200), OCTREE.levels[BITS:])
    assert reading.depth == BITS - 1
    reading.decode(last, OCTREE.levels[BITS:])
    assert (reading.state.cells == OCTREE.positions).all()


def test_nothing_may_stand_where_nothing_is_told() -> None:
    coder().decode(b"", OCTREE.levels[1:2])
    for length in range(1, 6):
        with pytest.raises(DiffError, match="bytes follow"):
            coder().decode(b"\1" * length, OCTREE.levels[1:2])


def test_packets_end_where_enough_has_come_together() -> None:
    sizes = {depth: len(payload) for depth, payload in enumerate(planes(), start=1)}
    first = min(depth for depth, size in sizes.items() if size > 0)
    packets = encode_packets(OCTREE, [coder()], 1, BITS)
    assert list(packets)[-1] == BITS
    assert all(len(payload) >= SMALL_PACKET - 8 for depth, (payload,) in packets.items() if depth < BITS)
    assert sum(len(payload) for (payload,) in packets.values()) <= sum(sizes.values())
    for base_depth in range(1, BITS + 1):
        late = encode_packets(OCTREE, [coder()], base_depth, BITS)
        assert min(late) >= base_depth
        reading = coder()
        for depth, (payload,) in late.items():
            reading.decode(payload, OCTREE.levels[reading.depth + 1 : depth + 1])
        assert (reading.state.cells == OCTREE.positions).all()
    assert encode_packets(OCTREE, [coder()], 1, 0) == {}
    assert list(encode_packets(OCTREE, [coder()], 6, first)) == [6]
