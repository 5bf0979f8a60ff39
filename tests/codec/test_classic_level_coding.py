"""Payloads of profile classic one by one; whole streams are decoded in test_decoder.py and by the core's own tests."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.classic.hierarchy import build_hierarchy
from meshtide_codec.classic.level_coding import LevelEncoder, decode_diff, encode_param
from meshtide_codec.errors import DiffError, OptionError
from meshtide_codec.quantize import quantize
from meshtide_codec.testing import grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

QUANTIZED = quantize(grid(10), 8)
FINE, COARSE = build_hierarchy(QUANTIZED.positions, QUANTIZED.faces, 8, drop_bits=6, coarsest_vertices=20)[:2]
NO_FACES = np.zeros((0, 3), np.int32)


def base(encoder: LevelEncoder) -> bytes:
    return encoder.base(COARSE.cells, COARSE.faces, 8 - COARSE.shift)


def parents() -> NDArray[np.int32]:
    assert FINE.parents is not None
    return FINE.parents


@given(st.lists(st.tuples(*[st.integers(-(2**31) + 1, 2**31 - 1)] * 3), max_size=40))
@settings(max_examples=40)
def test_diff_round_trip_of_any_size(rows: list[tuple[int, int, int]]) -> None:
    differences = np.array(rows, np.int64).reshape(-1, 3)
    before = differences.copy()
    payload = LevelEncoder().diff(differences)
    assert np.array_equal(differences, before)
    assert np.array_equal(decode_diff(payload, len(rows)), differences)


def test_diffs_are_the_same_whatever_was_encoded_before() -> None:
    differences = np.random.default_rng(1).integers(-9, 10, (50, 3))
    encoder = LevelEncoder()
    first = encoder.diff(differences)
    base(encoder)
    encoder.map_conn(parents(), FINE.faces)
    assert encoder.diff(differences) == first


def test_small_diffs_cost_about_their_entropy() -> None:
    differences = np.random.default_rng(0).integers(-1, 2, (20000, 3))
    assert 8 * len(LevelEncoder().diff(differences)) == pytest.approx(60000 * np.log2(3), rel=0.02)


@given(st.binary(max_size=200), st.integers(1, 300))
@settings(max_examples=150)
def test_any_bytes_decode_or_raise_from_the_tree(payload: bytes, count: int) -> None:
    """A stranger's payload with a right checksum: whatever comes out has the promised shape, or an error does."""
    try:
        assert decode_diff(payload, count).shape == (count, 3)
    except DiffError:
        pass


def test_bytes_after_the_last_diff_are_refused_by_name() -> None:
    payload = LevelEncoder().diff(np.zeros((4, 3), np.int64))
    with pytest.raises(DiffError, match="left over") as caught:
        decode_diff(payload + bytes([1] * 9), 4, 7)
    assert caught.value.level == 7


def test_param_layout() -> None:
    coefficients = np.array([[1, -0.5], [0.25, 2], [0, 3e-9]], np.float32)
    payload = encode_param(coefficients)
    assert payload[:8].hex() == "0000803f000000bf"
    assert np.array_equal(np.frombuffer(payload, "<f4").reshape(3, 2), coefficients)


def test_faces_cost_less_when_the_coarser_level_tells_of_them() -> None:
    encoder = LevelEncoder()
    base(encoder)
    known = encoder.map_conn(parents(), FINE.faces)
    unknown = LevelEncoder()
    unknown.base(COARSE.cells, NO_FACES, 8 - COARSE.shift)
    assert len(known) < len(unknown.map_conn(parents(), FINE.faces))


def test_levels_out_of_order_are_refused() -> None:
    encoder = LevelEncoder()
    with pytest.raises(OptionError, match="before the Base"):
        encoder.map_conn(parents(), FINE.faces)
    base(encoder)
    with pytest.raises(OptionError, match="second Base"):
        base(encoder)
    with pytest.raises(OptionError, match="another level"):
        encoder.map_conn(parents()[:-1] * 0, NO_FACES)


@pytest.mark.parametrize(
    ("cells", "faces", "message"),
    [
        ([[0, 0, 0], [8, 7, 7]], [], "outside of the grid"),
        ([[7, 7, 7], [0, 0, 0]], [], "Morton order"),
        ([[0, 0, 0], [7, 7, 7]], [[0, 1, 1]], "not canonical"),
        ([[0, 0, 0], [7, 7, 6], [7, 7, 7]], [[1, 2, 0]], "not canonical"),
        ([[0, 0, 0], [7, 7, 6], [7, 7, 7]], [[0, 2, 1], [0, 1, 2]], "do not ascend"),
        ([[0, 0, 0], [7, 7, 7]], [[0, 1, 2]], "a vertex that is not there"),
    ],
)
def test_what_is_no_level_is_refused(cells: list[list[int]], faces: list[list[int]], message: str) -> None:
    with pytest.raises(OptionError, match=message):
        LevelEncoder().base(np.array(cells, np.int32), np.array(faces, np.int32).reshape(-1, 3), 3)
