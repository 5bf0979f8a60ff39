"""The quadratic surface through a vertex' surroundings, against least squares by a library."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.compact import surface_fit_kernels as fit
from meshtide_codec.compilation import kernel
from meshtide_codec.reference.surface_fit import fit_surface as reference_fit

Reals = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int32]


@kernel
def fitted(patch: Reals, scale: float, normal: Reals, surface: Reals) -> float:
    matrix, solution = np.zeros((fit.TERMS, fit.TERMS)), np.zeros(fit.TERMS)
    return fit.fit_surface(len(patch), scale, normal, patch, matrix, solution, surface)


@kernel
def gathered(vertex: int, count: int, rows: Reals, starts: Integers, members: Integers, patch: Reals) -> int:
    stamps = np.full(len(rows), -1, np.int32)
    return fit.gather_patch(vertex, count, rows, starts, members, stamps, patch)


def fit_kernel(patch: Reals, scale: float, normal: Reals) -> tuple[float, Reals]:
    surface = np.zeros(3)
    return fitted(patch, scale, normal, surface), surface


def bowl_patch(height: float, curvature: float, count: int = 18) -> Reals:
    """Points of the surface z = height + curvature (x^2 + 2 y^2) / 2 around the origin, each of weight one."""
    generator = np.random.default_rng(3)
    u, v = generator.uniform(-2, 2, (2, count))
    return np.column_stack([u, v, height + curvature * (u * u + 2 * v * v) / 2, np.ones(count)])


@pytest.mark.parametrize(("height", "curvature"), [(0.0, 0.0), (0.7, 0.0), (-0.4, 0.1), (0.3, -0.2)])
def test_a_surface_that_is_quadratic_is_found(height: float, curvature: float) -> None:
    found, normal = fit_kernel(bowl_patch(height, curvature), 1.0, np.array([0.0, 0.0, 1.0]))
    assert found == pytest.approx(height, abs=0.02)
    assert normal == pytest.approx([0.0, 0.0, 1.0], abs=0.02)


def test_a_tilted_plane_is_measured_along_its_own_normal() -> None:
    patch = bowl_patch(0.0, 0.0)
    patch[:, 2] = 0.5 + 0.5 * patch[:, 0]
    height, normal = fit_kernel(patch, 1.0, np.array([0.0, 0.0, 1.0]))
    assert height == pytest.approx(0.5 / np.sqrt(1.25), abs=0.01)
    assert normal == pytest.approx(np.array([-0.5, 0.0, 1.0]) / np.sqrt(1.25), abs=0.01)


def test_it_is_the_damped_least_squares_of_a_library() -> None:
    generator = np.random.default_rng(5)
    patch = np.column_stack([generator.normal(size=(20, 3)), generator.integers(1, 3, 20)])
    u, v, z = -patch[:, 1], patch[:, 0], patch[:, 2]  # the frame that a normal along z gets
    terms = np.column_stack([np.ones(20), u, v, u * u, u * v, v * v])
    weights = patch[:, 3] / (0.25 + u * u + v * v) ** 2
    damping = np.diag([0.0, 0.001, 0.001, 0.01, 0.01, 0.01]) * weights.sum()
    expected = np.linalg.solve(terms.T @ (weights[:, None] * terms) + damping, terms.T @ (weights * z))
    height, normal = fit_kernel(patch, 1.0, np.array([0.0, 0.0, 1.0]))
    slopes = np.clip(expected[1:3], -1.0, 1.0)
    assert height == pytest.approx(expected[0] / np.sqrt(1.0 + slopes @ slopes), rel=1e-9)
    assert abs(normal[2]) == pytest.approx(1.0 / np.sqrt(1.0 + slopes @ slopes), rel=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(3, fit.PATCH_LIMIT), st.booleans())
def test_kernel_and_reference_agree_to_the_last_bit(seed: int, count: int, flat: bool) -> None:
    generator = np.random.default_rng(seed)
    patch = np.column_stack([generator.integers(-40, 41, (count, 3)), generator.integers(1, 3, count)]).astype(float)
    if flat:
        patch[:, 2] = 0.0
    normal = generator.normal(size=3)
    normal /= np.sqrt(normal @ normal)
    scale = float(generator.uniform(0.5, 50.0))
    height, surface = fit_kernel(patch, scale, normal)
    expected, expected_surface = reference_fit([(row[:3].tolist(), row[3]) for row in patch], scale, normal.tolist())
    assert (height, *surface) == (expected, *expected_surface)
    assert np.isfinite([height, *surface]).all()


def test_a_patch_holds_each_vertex_of_two_rings_once_but_not_the_middle() -> None:
    members = np.array([1, 2, 3, 0, 2, 4, 0, 1, 5, 0, 4, 4, 1, 2], np.int32)
    starts = np.array([0, 3, 6, 9, 11, 13, 14], np.int32)
    rows = np.zeros((6, 8))
    rows[:, 0] = np.arange(6)
    rows[2, 3] = 1.0
    patch = np.zeros((fit.PATCH_LIMIT, 4))
    assert gathered(0, 3, rows, starts, members, patch) == 5
    assert patch[:5, 0].tolist() == [1, 2, 3, 4, 5]
    assert patch[:5, 3].tolist() == [1, 2, 1, 1, 1]


def test_a_patch_has_a_largest_size() -> None:
    count = fit.PATCH_LIMIT + 20
    members = np.arange(1, count + 1, dtype=np.int32)
    starts = np.concatenate([[0], np.full(count + 1, count)]).astype(np.int32)
    patch = np.zeros((fit.PATCH_LIMIT, 4))
    assert gathered(0, count, np.zeros((count + 1, 8)), starts, members, patch) == fit.PATCH_LIMIT
