from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import dequantize, morton_codes, quantize
from meshtide_codec.testing import grid, random_meshes


@given(random_meshes(), st.integers(4, 20))
@settings(max_examples=60)
def test_quantization_errs_by_half_a_step_and_keeps_the_faces(mesh: Mesh, bits: int) -> None:
    quantized = quantize(mesh, bits)
    restored = quantized.mesh()
    step = quantized.extent / (2**bits - 1)
    moved = np.abs(restored.vertices[quantized.permutation] - mesh.vertices)
    assert moved.max() <= step * 0.5 * (1 + 1e-9) + 1e-12 * np.abs(mesh.vertices).max()
    codes = morton_codes(quantized.positions)
    assert (codes[1:] > codes[:-1]).all()
    expected = {frozenset(row) for row in quantized.permutation[mesh.faces].tolist() if len(set(row)) == 3}
    assert {frozenset(row) for row in quantized.faces.tolist()} == expected
    assert quantized.welded_vertices == len(mesh.vertices) - len(quantized.positions)
    assert quantized.dropped_faces == len(mesh.faces) - len(quantized.faces)


def test_quantizing_the_restored_mesh_changes_nothing() -> None:
    once = quantize(grid(20), 10)
    twice = quantize(once.mesh(), 10)
    assert np.array_equal(once.positions, twice.positions)
    assert np.array_equal(once.faces, twice.faces)
    assert twice.welded_vertices == 0
    assert twice.dropped_faces == 0


@pytest.mark.parametrize("bits", [3, 21, -1])
def test_b_out_of_range(bits: int) -> None:
    with pytest.raises(OptionError, match="B must be 4..20"):
        quantize(grid(3), bits)


def test_too_large_a_mesh() -> None:
    with pytest.raises(MeshError, match="too large"):
        quantize(Mesh.checked([[-1.7e308, 0, 0], [1.7e308, 0, 0]], []))


def test_a_single_point_and_a_plane() -> None:
    point = quantize(Mesh.checked([[5.0, 6.0, 7.0]] * 3, [[0, 1, 2]]))
    assert point.mesh().vertices.tolist() == [[5.0, 6.0, 7.0]]
    assert point.welded_vertices == 2
    assert point.dropped_faces == 1
    plane = quantize(Mesh.checked([[0, 0, 4], [2, 0, 4], [0, 1, 4]], [[0, 1, 2]]), 8)
    assert set(plane.mesh().vertices[:, 2]) == {4.0}


def test_ends_of_the_longest_axis_are_exact() -> None:
    quantized = quantize(Mesh.checked([[0.1, 0, 0], [0.7, 0, 0]], []), 12)
    assert quantized.positions[:, 0].tolist() == [0, 4095]
    positions = dequantize(quantized.positions, 12, quantized.origin, quantized.extent)
    assert positions[:, 0].tolist() == pytest.approx([0.1, 0.7], rel=1e-15)


@given(st.lists(st.tuples(*[st.integers(0, 2**20 - 1)] * 3), min_size=1, max_size=30))
def test_morton_codes_interleave_the_bits(rows: list[tuple[int, int, int]]) -> None:
    codes = morton_codes(np.array(rows))
    for code, (x, y, z) in zip(codes.tolist(), rows, strict=True):
        assert code == sum(
            ((x >> bit) & 1) << (3 * bit + 2) | ((y >> bit) & 1) << (3 * bit + 1) | ((z >> bit) & 1) << (3 * bit)
            for bit in range(20)
        )
