from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.classic.hierarchy import build_hierarchy, cell_centres, containing_cells, within_cube
from meshtide_codec.mesh import Mesh, canonical_faces
from meshtide_codec.quantize import morton_codes, quantize
from meshtide_codec.sphere import paper_sphere
from meshtide_codec.testing import grid, random_meshes


@given(random_meshes(), st.integers(1, 3), st.floats(1.0, 3.0), st.integers(1, 20))
@settings(max_examples=50)
def test_invariants(mesh: Mesh, drop_bits: int, ratio: float, coarsest: int) -> None:
    quantized = quantize(mesh, 8)
    levels = build_hierarchy(
        quantized.positions,
        quantized.faces,
        8,
        drop_bits=drop_bits,
        minimum_ratio=ratio,
        coarsest_vertices=coarsest,
    )
    assert np.array_equal(levels[0].cells, quantized.positions)
    assert levels[-1].parents is None
    for fine, coarse in pairwise(levels):
        step = coarse.shift - fine.shift
        assert step > 0
        assert step % drop_bits == 0
        assert len(fine.cells) >= ratio * len(coarse.cells)
        assert len(fine.cells) > coarsest
        assert fine.parents is not None
        assert np.array_equal(coarse.cells[fine.parents], fine.cells >> step)
        assert set(np.diff(fine.parents, prepend=-1).tolist()) <= {0, 1}
        assert fine.parents[-1] == len(coarse.cells) - 1
        assert np.array_equal(coarse.faces, canonical_faces(fine.parents[fine.faces]))
        codes = morton_codes(coarse.cells)
        assert (codes[1:] > codes[:-1]).all()


def test_the_papers_sphere_has_four_levels() -> None:
    quantized = quantize(paper_sphere(), 10)
    levels = build_hierarchy(quantized.positions, quantized.faces, 10, coarsest_vertices=300)
    assert [(10 - level.shift, len(level.cells)) for level in levels] == [(10, 10242), (5, 3864), (4, 1112), (3, 272)]


def test_a_high_ratio_skips_levels() -> None:
    quantized = quantize(grid(20), 10)
    dense = build_hierarchy(quantized.positions, quantized.faces, 10, minimum_ratio=1.0, coarsest_vertices=4)
    sparse = build_hierarchy(quantized.positions, quantized.faces, 10, minimum_ratio=8.0, coarsest_vertices=4)
    assert len(sparse) < len(dense)
    sizes = [len(level.cells) for level in sparse]
    assert all(fine >= 8 * coarse for fine, coarse in pairwise(sizes))


@given(st.integers(0, 8), st.lists(st.tuples(*[st.integers(0, 3)] * 3), min_size=1))
def test_a_centre_lies_in_its_cell(shift: int, rows: list[tuple[int, int, int]]) -> None:
    cells = np.array(rows)
    centres = cell_centres(cells, shift)
    assert np.array_equal(containing_cells(centres, shift, shift + 2), cells)
    half = 0.49 * (1 << shift)
    assert np.array_equal(containing_cells(centres + half, shift, shift + 2), cells)
    assert np.array_equal(containing_cells(centres - half, shift, shift + 2), cells)


def test_level_zero_sits_on_the_grid_points() -> None:
    assert cell_centres(np.array([[0, 5, 255]]), 0).tolist() == [[0.0, 5.0, 255.0]]


@pytest.mark.parametrize("far", [-1e30, -3.0, 300.0, 1e300])
def test_predictions_outside_of_the_cube_are_taken_to_its_border(far: float) -> None:
    cells = containing_cells(within_cube(np.full((1, 3), far), 8), 0, 8)
    assert cells.tolist() == [[0 if far < 0 else 255] * 3]
