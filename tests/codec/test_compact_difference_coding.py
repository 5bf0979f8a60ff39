from __future__ import annotations

import pytest

from meshes import grid
from meshtide_codec.compact.difference_coding import DifferenceCoder, packet_depths
from meshtide_codec.compact.octree import build_octree
from meshtide_codec.compact.slices import Slices
from meshtide_codec.errors import DiffError
from meshtide_codec.quantize import quantize
from meshtide_codec.stream.parts import join_parts

BITS = 8
QUANTIZED = quantize(grid(12), BITS)
OCTREE = build_octree(QUANTIZED.positions, QUANTIZED.faces, BITS)
SLICES = Slices(BITS)


def coder() -> DifferenceCoder:
    return DifferenceCoder(OCTREE.levels[0], SLICES, 0, None)


def planes() -> list[bytes]:
    writing = coder()
    return [writing.encode(OCTREE, depth) for depth in range(1, BITS + 1)]


def test_bit_planes_travel_alone_or_together() -> None:
    written = planes()
    for cut in range(1, BITS):
        reading = coder()
        reading.decode(join_parts(written[:cut]), OCTREE.levels[1 : cut + 1])
        assert reading.depth == cut
        reading.decode(join_parts(written[cut:]), OCTREE.levels[cut + 1 :])
        assert reading.depth == BITS
        assert (reading.state.cells == OCTREE.positions).all()


def test_a_damaged_packet_keeps_the_planes_before_the_damage() -> None:
    written = planes()
    reading = coder()
    with pytest.raises(DiffError):
        reading.decode(join_parts([*written[:-1], written[-1] + bytes(200)]), OCTREE.levels[1:])
    assert reading.depth == BITS - 1
    with pytest.raises(DiffError, match="damaged"):
        coder().decode(b"\xff", OCTREE.levels[1:])


@pytest.mark.parametrize(
    ("sizes", "base_depth", "needed", "depths"),
    [
        ([0, 0, 0, 0], 1, 0, []),
        ([0, 9, 9, 100], 1, 4, [4]),
        ([100, 9, 9, 100], 1, 4, [1, 4]),
        ([100, 9, 9, 100], 3, 4, [3, 4]),
        ([100, 9, 9, 0], 1, 3, [1, 3]),
        ([5, 0, 0, 0], 3, 1, [3]),
        ([0, 0, 0, 0], 2, 4, [4]),
    ],
)
def test_where_packets_end(sizes: list[int], base_depth: int, needed: int, depths: list[int]) -> None:
    by_depth = {depth: [bytes(size)] for depth, size in enumerate(sizes, start=1)}
    assert packet_depths(by_depth, base_depth, needed) == depths
