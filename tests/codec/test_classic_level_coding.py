from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshes import grid
from meshtide_codec.classic.level_coding import (
    decode_base,
    decode_diff,
    decode_map_conn,
    decode_param,
    encode_base,
    encode_diff,
    encode_map_conn,
    encode_param,
)
from meshtide_codec.errors import BaseError, DiffError, MapConnError, PacketError, ParamError
from meshtide_codec.filters import FilterSpec
from meshtide_codec.mesh import canonical_faces
from meshtide_codec.quantize import morton_codes, quantize
from meshtide_codec.stream.parts import join_parts

LINEAR = FilterSpec("polynomial", degree=1)
FINE = quantize(grid(10), 8)
COARSE_CODES, PARENTS = np.unique(morton_codes(FINE.positions >> 6), return_inverse=True)
PARENTS = PARENTS.astype(np.int32)
COARSE_FACES = canonical_faces(PARENTS[FINE.faces].astype(np.int32))
MAP_CONN = encode_map_conn(PARENTS, FINE.faces, COARSE_FACES, len(COARSE_CODES))


@given(st.integers(1, 20), st.integers(0, 2**32 - 1), st.integers(1, 60))
@settings(max_examples=40)
def test_base_round_trip(bits: int, seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    cells = np.unique(rng.integers(0, 1 << bits, (count, 3)), axis=0).astype(np.int32)
    cells = cells[np.argsort(morton_codes(cells))]
    faces = canonical_faces(rng.integers(0, len(cells), (count, 3)).astype(np.int32))
    payload = encode_base(cells, faces, bits)
    decoded_cells, decoded_faces = decode_base(payload, len(cells), len(faces), bits)
    assert np.array_equal(decoded_cells, cells)
    assert np.array_equal(decoded_faces, faces)


def test_map_conn_round_trip() -> None:
    parents, faces = decode_map_conn(MAP_CONN, len(FINE.positions), len(FINE.faces), COARSE_FACES, len(COARSE_CODES))
    assert np.array_equal(parents, PARENTS)
    assert np.array_equal(faces, FINE.faces)


@given(st.lists(st.tuples(*[st.integers(-(2**31) + 1, 2**31 - 1)] * 3), max_size=40))
@settings(max_examples=40)
def test_diff_round_trip_of_any_size(rows: list[tuple[int, int, int]]) -> None:
    differences = np.array(rows, np.int64).reshape(-1, 3)
    before = differences.copy()
    payload = encode_diff(differences)
    assert np.array_equal(differences, before)
    assert np.array_equal(decode_diff(payload, len(rows)), differences)


def test_small_diffs_cost_about_their_entropy() -> None:
    differences = np.random.default_rng(0).integers(-1, 2, (20000, 3))
    assert 8 * len(encode_diff(differences)) == pytest.approx(60000 * np.log2(3), rel=0.01)


def test_param_round_trip_and_layout() -> None:
    coefficients = np.array([[1, -0.5], [0.25, 2], [0, 3e-9]], np.float32)
    payload = encode_param(coefficients)
    assert payload[:8].hex() == "0000803f000000bf"
    assert np.array_equal(decode_param(payload, LINEAR), coefficients)


def test_damaged_params_are_refused() -> None:
    with pytest.raises(ParamError, match="coefficients take 24"):
        decode_param(bytes(20), LINEAR)
    with pytest.raises(ParamError, match="coordinate 1 is nan"):
        decode_param(np.array([1, 2, np.nan, 0, 0, 0], "<f4").tobytes(), LINEAR)
    with pytest.raises(ParamError, match="denominator"):
        decode_param(np.array([1, -0.9] * 3, "<f4").tobytes(), FilterSpec("rational", degree=0, denominator_degree=1))


@pytest.mark.parametrize("payload", [b"", b"\x01", b"\x05abc", b"\xff" * 50])
def test_payloads_without_their_two_parts_are_refused(payload: bytes) -> None:
    with pytest.raises(BaseError, match="damaged"):
        decode_base(payload, 10, 10, 8)
    with pytest.raises(MapConnError, match="damaged"):
        decode_map_conn(payload, 10, 10, COARSE_FACES, 5)


def test_counts_that_contradict_the_header_are_refused() -> None:
    with pytest.raises(MapConnError, match="do not add up"):
        decode_map_conn(MAP_CONN, len(FINE.positions) - 1, len(FINE.faces), COARSE_FACES, len(COARSE_CODES))
    with pytest.raises(MapConnError):
        decode_map_conn(MAP_CONN, len(FINE.positions), len(FINE.faces) + 50, COARSE_FACES, len(COARSE_CODES))


def test_bytes_after_the_last_face_are_refused() -> None:
    expected = len(FINE.positions), len(FINE.faces), COARSE_FACES, len(COARSE_CODES)
    with pytest.raises(MapConnError, match="bytes follow the last face"):
        decode_map_conn(MAP_CONN + bytes([1] * 9), *expected)
    with pytest.raises(MapConnError, match="bytes follow the last face"):
        decode_map_conn(MAP_CONN, len(FINE.positions), 0, COARSE_FACES, len(COARSE_CODES))


def test_cells_outside_of_the_grid_are_refused() -> None:
    cells = np.array([[0, 0, 0], [7, 7, 7]], np.int32)
    payload = encode_base(cells, np.zeros((0, 3), np.int32), 3)
    with pytest.raises(BaseError, match="grid of 2 bits"):
        decode_base(payload, 2, 0, 2)


@given(st.binary(max_size=200), st.integers(1, 300))
@settings(max_examples=150)
def test_any_bytes_decode_or_raise_from_the_tree(payload: bytes, count: int) -> None:
    """A stranger's payload with a right checksum: whatever comes out has the promised shape, or an error does."""
    try:
        assert decode_diff(payload, count).shape == (count, 3)
    except DiffError:
        pass
    try:
        parts = join_parts([payload, payload[::-1]])
        cells, faces = decode_base(parts, count, count, 7)
        assert cells.shape == (count, 3)
        assert cells.max() < 128
        assert faces.size == 0 or faces.max() < count
    except PacketError:
        pass
    try:
        parents, faces = decode_map_conn(parts, len(COARSE_CODES) + count, 2 * count, COARSE_FACES, len(COARSE_CODES))
        assert len(parents) == len(COARSE_CODES) + count
        assert faces.size == 0 or faces.max() < len(parents)
    except PacketError:
        pass


def test_a_map_conn_truncated_at_every_byte_or_with_any_flipped_bit_never_crashes() -> None:
    expected = len(FINE.positions), len(FINE.faces), COARSE_FACES, len(COARSE_CODES)
    variants = [MAP_CONN[:end] for end in range(len(MAP_CONN))]
    for bit in range(8 * len(MAP_CONN)):
        damaged = bytearray(MAP_CONN)
        damaged[bit // 8] ^= 1 << (bit % 8)
        variants.append(bytes(damaged))
    refused = 0
    for variant in variants:
        try:
            parents, faces = decode_map_conn(variant, *expected)
            assert faces.shape == FINE.faces.shape
            assert parents[-1] == len(COARSE_CODES) - 1
        except MapConnError:
            refused += 1
    assert refused > len(MAP_CONN)
