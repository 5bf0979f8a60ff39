from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshes import grid, random_meshes, soup
from meshtide_codec.compact.octree import build_octree
from meshtide_codec.compact.reliable_coding import ReliableCoder
from meshtide_codec.errors import BaseError, LimitError, MapConnError, MeshtideError, StreamError
from meshtide_codec.limits import Limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import quantize

BITS = 7
QUANTIZED = quantize(grid(12), BITS)
OCTREE = build_octree(QUANTIZED.positions, QUANTIZED.faces, BITS)
COUNT = len(QUANTIZED.positions)


def coder() -> ReliableCoder:
    return ReliableCoder(BITS, COUNT, None)


@given(random_meshes(), st.integers(1, BITS))
@settings(max_examples=40)
def test_levels_come_back_whatever_the_base_depth(mesh: Mesh, base_depth: int) -> None:
    quantized = quantize(mesh, BITS)
    octree = build_octree(quantized.positions, quantized.faces, BITS)
    first_all_leaves = next(level.depth for level in octree.levels if level.all_leaves)
    base_depth = min(base_depth, first_all_leaves)
    writing = ReliableCoder(BITS, len(quantized.positions), None)
    reading = ReliableCoder(BITS, len(quantized.positions), None)
    levels = reading.decode_base(writing.encode_base(octree, base_depth), base_depth, Limits())
    for depth in range(base_depth + 1, first_all_leaves + 1):
        coarse, fine = octree.levels[depth - 1], octree.levels[depth]
        payload = writing.encode_map_conn(coarse, fine)
        assert fine.faces is not None
        levels.append(reading.decode_map_conn(payload, levels[-1], len(fine.faces)))
    for depth, level in enumerate(levels):
        expected = octree.levels[depth]
        assert np.array_equal(level.cells, expected.cells)
        assert np.array_equal(level.leaves, expected.leaves)
        assert expected.faces is not None
        assert np.array_equal(level.faces, expected.faces)  # type: ignore[arg-type]


def test_limits_hold_inside_of_the_base_too() -> None:
    payload = coder().encode_base(OCTREE, 4)
    with pytest.raises(LimitError):
        coder().decode_base(payload, 4, Limits(faces=10))


def test_a_base_deeper_than_the_last_map_is_refused() -> None:
    quantized = quantize(soup(3, 2, seed=0), BITS)
    octree = build_octree(quantized.positions, quantized.faces, BITS)
    writing = ReliableCoder(BITS, len(quantized.positions), None)
    depth = next(level.depth for level in octree.levels if level.all_leaves)
    payload = writing.encode_base(octree, depth)
    with pytest.raises(StreamError):
        ReliableCoder(BITS, len(quantized.positions), None).decode_base(payload, BITS, Limits())


@given(st.binary(max_size=120))
@settings(max_examples=100)
def test_any_bytes_decode_or_raise_from_the_tree(payload: bytes) -> None:
    for attempt in (
        lambda: coder().decode_base(payload, 3, Limits(faces=5000)),
        lambda: coder().decode_map_conn(payload, OCTREE.levels[3], 100),
    ):
        try:
            attempt()
        except MeshtideError as error:
            assert isinstance(error, BaseError | MapConnError | LimitError)


def test_every_cut_and_every_flipped_bit_is_survived() -> None:
    writing = coder()
    writing.encode_base(OCTREE, 3)
    payload = writing.encode_map_conn(OCTREE.levels[3], OCTREE.levels[4])
    faces = OCTREE.levels[4].faces
    assert faces is not None
    variants = [payload[:end] for end in range(len(payload))]
    for bit in range(8 * len(payload)):
        damaged = bytearray(payload)
        damaged[bit // 8] ^= 1 << (bit % 8)
        variants.append(bytes(damaged))
    refused = 0
    for variant in variants:
        try:
            level = coder().decode_map_conn(variant, OCTREE.levels[3], len(faces))
            assert level.faces is not None
            assert level.faces.max() < level.vertex_count <= COUNT
        except MapConnError:
            refused += 1
    assert refused > len(payload)
