"""Mirror planes: finding them, refusing those out of range, and the table of cells that looks images up."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.compact.cell_table_kernels import ABSENT, build_cell_table, find_cell
from meshtide_codec.compact.mirror import Mirror, find_mirror
from meshtide_codec.errors import OptionError
from octrees import cloud


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("coordinate_sum", [600, 777, 1023])
def test_an_exact_plane_is_found(axis: int, coordinate_sum: int) -> None:
    half = cloud(3, 400, 512) // 2
    image = half.copy()
    image[:, axis] = coordinate_sum - half[:, axis]
    assert find_mirror(np.unique(np.concatenate([half, image]), axis=0), 10) == Mirror(axis, coordinate_sum, 10)


def test_a_plane_within_a_step_is_found() -> None:
    half = cloud(4, 500, 512) // 2 + np.array([1, 1, 1], np.int32)
    image = half.copy()
    image[:, 1] = 1000 - half[:, 1]
    image += np.random.default_rng(5).integers(-1, 2, image.shape).astype(np.int32)
    found = find_mirror(np.unique(np.concatenate([half, image]), axis=0), 10)
    assert found is not None
    assert found.axis == 1
    assert abs(found.coordinate_sum - 1000) <= 1


def test_a_plane_is_found_beside_a_part_without_symmetry() -> None:
    half = cloud(6, 600, 400) // 2
    image = half.copy()
    image[:, 0] = 500 - half[:, 0]
    aside = cloud(7, 150, 100) + np.array([900, 0, 0], np.int32)
    assert find_mirror(np.unique(np.concatenate([half, image, aside]), axis=0), 10) == Mirror(0, 500, 10)


@pytest.mark.parametrize("seed", range(4))
def test_a_random_cloud_has_none(seed: int) -> None:
    assert find_mirror(cloud(seed, 500, 4096), 12) is None


@pytest.mark.parametrize("count", [1, 2])
def test_the_smallest_meshes_are_no_trouble(count: int) -> None:
    mirror = find_mirror(cloud(1, count, 16), 4)
    assert mirror is None or mirror.bits == 4


@pytest.mark.parametrize(
    ("axis", "total", "bits"), [(3, 5, 4), (-1, 5, 4), (0, -1, 4), (0, 32, 4), (0, 0, 0), (0, 0, 21)]
)
def test_mirrors_out_of_range_are_refused(axis: int, total: int, bits: int) -> None:
    with pytest.raises(OptionError):
        Mirror(axis, total, bits)


def test_a_plane_lies_halfway() -> None:
    assert Mirror(0, 4095, 12).plane(12) == 2 * 4096
    assert Mirror(0, 4095, 12).plane(0) == 2.0
    assert Mirror(0, 9, 4).plane(3) == 10.0


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 300), st.integers(1, 1 << 20))
def test_a_cell_table_returns_what_it_holds(seed: int, count: int, size: int) -> None:
    cells = cloud(seed, count, size)
    chosen = np.random.default_rng(seed).integers(0, 2, len(cells)).astype(np.uint8)
    table = build_cell_table(cells, chosen)
    held = 0
    for index, (x, y, z) in enumerate(cells.astype(np.int64)):
        found = find_cell(table, x, y, z)
        assert found in {index, ABSENT}
        assert found == ABSENT or chosen[index]
        held += found != ABSENT
    assert held >= 0.98 * chosen.sum()


def test_crafted_cells_cannot_fill_a_chain() -> None:
    cells = np.stack([np.arange(0, 1 << 20, 1 << 10), np.zeros(1 << 10), np.zeros(1 << 10)], axis=1).astype(np.int32)
    table = build_cell_table(cells, np.ones(len(cells), np.uint8))
    assert find_cell(table, 5, 5, 5) == ABSENT
    assert sum(find_cell(table, int(x), 0, 0) != ABSENT for x in cells[:, 0]) >= 16
