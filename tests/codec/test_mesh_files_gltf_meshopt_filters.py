"""Filters of meshopt: what meshoptimizer makes of the same rows, and values that are known."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshopt_streams import FIXED_FILTERS
from meshtide_codec.mesh_files.gltf import meshopt_filters

if TYPE_CHECKING:
    from numpy.typing import NDArray

TYPES = {
    ("octahedral", 4): "<i1",
    ("octahedral", 8): "<i2",
    ("quaternion", 8): "<i2",
    ("exponential", 16): "<f4",
    ("color", 4): "<u1",
    ("color", 8): "<u2",
}


def applied(name: str, rows: NDArray[Any]) -> NDArray[np.uint8]:
    plain = np.ascontiguousarray(rows).view(np.uint8)
    result: NDArray[np.uint8] = getattr(meshopt_filters, name)(plain)
    assert result.dtype == np.uint8
    assert result.shape == plain.shape
    return result


@pytest.mark.parametrize(("name", "stride", "before", "after"), FIXED_FILTERS)
def test_filters_give_what_meshoptimizer_gives(name: str, stride: int, before: str, after: str) -> None:
    rows = np.frombuffer(base64.b64decode(before), np.uint8).reshape(-1, stride)
    dtype = TYPES[name, stride]
    expected = np.frombuffer(base64.b64decode(after), dtype).astype(float)
    found = applied(name, rows).view(dtype).reshape(-1).astype(float)
    assert np.abs(found - expected).max() <= (0 if name == "exponential" else 1)


def test_octahedral_normals_have_length_one_and_keep_the_fourth_component() -> None:
    rows = np.array([[127, 0, 127, -5], [0, -64, 127, 9], [100, 100, 127, 0]], "<i1")
    found = applied("octahedral", rows).view("<i1").astype(float)
    assert found[:, 3].tolist() == [-5, 9, 0]
    assert np.allclose(np.linalg.norm(found[:, :3], axis=1), 127, atol=1.5)
    assert found[0, :3].tolist() == [127, 0, 0]
    assert found[2, 2] < 0


def test_quaternions_have_length_one_and_their_largest_component_in_its_place() -> None:
    one = 2047
    rows = np.array([[0, 0, 0, (one & ~3) | place] for place in range(4)], "<i2")
    found = applied("quaternion", rows).view("<i2").reshape(4, 4)
    assert found.tolist() == (np.eye(4, dtype=int) * 32767).tolist()


def test_exponential_floats_are_exact() -> None:
    rows = np.array([[3 | 2 << 24], [0xFFFFFF | 0xFF << 24], [5]], "<u4")
    assert applied("exponential", rows).view("<f4").reshape(-1).tolist() == [12.0, -0.5, 5.0]


def test_colors_of_full_bits() -> None:
    rows = np.array([[255, 0, 0, 255], [0, 0, 0, 128]], "<u1")
    assert applied("color", rows).tolist() == [[255, 255, 255, 255], [0, 0, 0, 0]]


@given(st.binary(min_size=16, max_size=16))
def test_rows_of_any_bytes_pass_without_a_warning(data: bytes) -> None:
    for name, stride in TYPES:
        rows = np.frombuffer(data, np.uint8).reshape(-1, stride)
        assert applied(name, rows).nbytes == rows.nbytes
