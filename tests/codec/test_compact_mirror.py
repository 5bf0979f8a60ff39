"""Mirror planes: finding them, and refusing those out of range."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from meshtide_codec.compact.mirror import Mirror, find_mirror
from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    import numpy.typing as npt


def cloud(seed: int, count: int, size: int) -> npt.NDArray[np.int32]:
    """Pairwise different random grid points."""
    points = np.random.default_rng(seed).integers(0, size, (count, 3)).astype(np.int32)
    return np.unique(points, axis=0)


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
