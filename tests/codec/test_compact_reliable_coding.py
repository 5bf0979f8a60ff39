from __future__ import annotations

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshes import grid, random_meshes, soup
from meshtide_codec.compact.effort import DeepLayers
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


@given(random_meshes(), st.integers(1, BITS), st.booleans())
@settings(max_examples=60)
def test_levels_come_back_whatever_the_base_depth(mesh: Mesh, base_depth: int, deeply: bool) -> None:
    deep = DeepLayers.ALL if deeply else DeepLayers.NONE
    quantized = quantize(mesh, BITS)
    octree = build_octree(quantized.positions, quantized.faces, BITS)
    first_all_leaves = next(level.depth for level in octree.levels if level.all_leaves)
    base_depth = min(base_depth, first_all_leaves)
    writing = ReliableCoder(BITS, len(quantized.positions), None, deep=deep)
    reading = ReliableCoder(BITS, len(quantized.positions), None, deep=deep)
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


def test_bytes_after_the_end_are_refused() -> None:
    with pytest.raises(BaseError, match="bytes follow"):
        coder().decode_base(coder().encode_base(OCTREE, 3) + b"\1" * 8, 3, Limits())
    writing, reading = coder(), coder()
    levels = reading.decode_base(writing.encode_base(OCTREE, 3), 3, Limits())
    payload = writing.encode_map_conn(OCTREE.levels[3], OCTREE.levels[4])
    faces = OCTREE.levels[4].faces
    assert faces is not None
    with pytest.raises(MapConnError, match="bytes follow"):
        reading.decode_map_conn(payload + b"\1" * 8, levels[-1], len(faces))


def test_a_mesh_of_one_vertex_has_an_empty_base() -> None:
    point = ReliableCoder(BITS, 1, None)
    octree = build_octree(np.array([[5, 6, 7]], np.int32), np.zeros((0, 3), np.int32), BITS)
    assert point.encode_base(octree, 0) == b""
    levels = point.decode_base(b"", 2, Limits())
    assert [level.depth for level in levels] == [0, 1, 2]
    with pytest.raises(BaseError, match="bytes follow"):
        point.decode_base(b"\1" * 9, 2, Limits())


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


@pytest.mark.parametrize("deep", [DeepLayers.NONE, DeepLayers.ALL])
def test_a_payload_that_was_damaged_may_come_again(deep: DeepLayers) -> None:
    writing = ReliableCoder(BITS, COUNT, None, deep=deep)
    base = writing.encode_base(OCTREE, 3)
    payload = writing.encode_map_conn(OCTREE.levels[3], OCTREE.levels[4])
    faces = OCTREE.levels[4].faces
    assert faces is not None
    reading = ReliableCoder(BITS, COUNT, None, deep=deep)
    refused = 0
    for place in range(len(base)):
        try:
            ReliableCoder(BITS, COUNT, None, deep=deep).decode_base(base[:place], 3, Limits(faces=5000))
        except StreamError:
            refused += 1
            with pytest.raises(StreamError):
                reading.decode_base(base[:place], 3, Limits(faces=5000))
    coarse = reading.decode_base(base, 3, Limits(faces=5000))[-1]
    for place in range(len(payload)):
        damaged = payload[:place] + b"\xff\x00\xff" + payload[place + 1 :]
        state = copy.deepcopy(reading)
        try:
            state.decode_map_conn(damaged, coarse, len(faces))
        except StreamError:
            refused += 1
            fine = state.decode_map_conn(payload, coarse, len(faces))
            assert np.array_equal(fine.faces, faces)  # type: ignore[arg-type]
            assert np.array_equal(fine.cells, OCTREE.levels[4].cells)
    assert refused > len(payload)


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
