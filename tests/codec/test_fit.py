"""Fits against the plain solutions of the paper's problems: numpy's least squares, and whole linear programs."""

from __future__ import annotations

import hashlib
import importlib
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from meshtide_codec.errors import MeshError
from meshtide_codec.filters import FilterSpec, basis_columns, coefficient_count, is_safe_denominator, predict
from meshtide_codec.fit import _orthonormalise, fit
from meshtide_codec.graph import Adjacency, apply_k, build_adjacency

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.filters import Basis, Kind

EPSILON = 1e-6  # of the paper's programs


def torus_faces(rows: int, columns: int) -> NDArray[np.int32]:
    row, column = (grid.ravel() for grid in np.mgrid[:rows, :columns])
    here, right = row * columns + column, row * columns + (column + 1) % columns
    below, diagonal = (row + 1) % rows * columns + column, (row + 1) % rows * columns + (column + 1) % columns
    faces = np.concatenate([np.stack([here, right, diagonal], 1), np.stack([here, diagonal, below], 1)])
    return faces.astype(np.int32)


def level_of_torus(rows: int, columns: int, step: int) -> tuple[Adjacency, NDArray[np.float64], NDArray[np.float64]]:
    """A torus on a grid of 2^12, and the same with its points at the centres of cells of side `step`."""
    row, column = (grid.ravel() for grid in np.mgrid[:rows, :columns])
    around, across = row * (2 * math.pi / rows), column * (2 * math.pi / columns)
    radius = 2 + np.cos(across) + 0.1 * np.sin(7 * around)
    torus = np.stack([radius * np.cos(around), radius * np.sin(around), np.sin(across)], axis=1)
    noise = np.random.default_rng(0).normal(size=torus.shape) * 0.002
    target = np.rint((torus + noise + 3.2) * (4095 / 6.4))
    extension = np.floor(target / step) * step + (step - 1) / 2
    return build_adjacency(torus_faces(rows, columns), len(target)), extension, target


def residual_of(
    adjacency: Adjacency, extension: NDArray[np.float64], target: NDArray[np.float64], spec: FilterSpec
) -> NDArray[np.float64]:
    return target - predict(adjacency, extension, spec, fit(adjacency, extension, target, spec))


def reference_maximum(columns: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    """Program (18), whole: variables w, f, g."""
    count = columns.shape[1]
    cost = np.concatenate([[1.0], np.full(2 * count, EPSILON)])
    edge = np.ones((len(columns), 1))
    upper = np.block([[-edge, columns, -columns], [-edge, -columns, columns]])
    return linprog(cost, A_ub=upper, b_ub=np.concatenate([target, -target]), method="highs").x[0]


def reference_sum(columns: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    """Program (22), whole: variables u, v, f, g."""
    rows, count = columns.shape
    cost = np.concatenate([np.ones(2 * rows), np.full(2 * count, EPSILON)])
    equal = np.block([np.eye(rows), -np.eye(rows), columns, -columns])
    solution = linprog(cost, A_eq=equal, b_eq=target, method="highs").x
    return solution[: 2 * rows].sum()


@pytest.mark.parametrize("basis", ["power", "chebyshev"])
@pytest.mark.parametrize("degree", [0, 1, 2, 3, 5])
def test_least_squares_is_numpys(basis: Basis, degree: int) -> None:
    adjacency, extension, target = level_of_torus(20, 30, 16)
    spec = FilterSpec("polynomial", degree, basis)
    coefficients = fit(adjacency, extension, target, spec)
    assert coefficients.dtype == np.float32
    prediction = predict(adjacency, extension, spec, coefficients)
    for axis in range(3):
        columns = basis_columns(adjacency, extension[:, axis], degree, basis)
        scale = np.linalg.norm(columns, axis=0)
        expected = np.linalg.lstsq(columns / scale, target[:, axis], rcond=None)[0] / scale
        np.testing.assert_allclose(prediction[:, axis], columns @ expected, atol=1e-3)
        best = np.linalg.norm(columns @ expected - target[:, axis])
        found = np.linalg.norm(prediction[:, axis] - target[:, axis])
        assert found <= best * (1 + 1e-7)


def test_bases_agree_and_errors_fall_with_the_degree_on_a_large_mesh() -> None:
    adjacency, extension, target = level_of_torus(320, 320, 8)
    error = math.inf
    for degree in range(1, 8):
        power = residual_of(adjacency, extension, target, FilterSpec("polynomial", degree, "power"))
        other = residual_of(adjacency, extension, target, FilterSpec("polynomial", degree, "chebyshev"))
        assert np.abs(power - other).max() < 1e-6 * np.abs(target).max()
        assert np.linalg.norm(power) <= error * (1 + 1e-9)
        error = np.linalg.norm(power)
    assert error < 0.9 * np.linalg.norm(target - extension)


@pytest.mark.parametrize("basis", ["power", "chebyshev"])
@pytest.mark.parametrize("degree", [1, 3, 6])
def test_the_norms_reach_the_paper_s_programs(basis: Basis, degree: int) -> None:
    adjacency, extension, target = level_of_torus(12, 15, 64)
    greatest = residual_of(adjacency, extension, target, FilterSpec("polynomial", degree, basis, math.inf))
    least_sum = residual_of(adjacency, extension, target, FilterSpec("polynomial", degree, basis, 1.0))
    for axis in range(3):
        columns = basis_columns(adjacency, extension[:, axis], degree, "chebyshev")
        best = reference_maximum(columns, target[:, axis])
        assert np.abs(greatest[:, axis]).max() == pytest.approx(best, rel=2e-4)
        best = reference_sum(columns, target[:, axis])
        assert np.abs(least_sum[:, axis]).sum() == pytest.approx(best, rel=2e-4)


@pytest.mark.parametrize("norm", [1.0, 1.01, 1.25, 1.5, 1.9, 2.0, math.inf])
def test_every_norm_is_least_for_its_own_fit(norm: float) -> None:
    adjacency, extension, target = level_of_torus(100, 120, 32)

    def length(residual: NDArray[np.float64]) -> Any:
        magnitudes = np.abs(residual)
        return magnitudes.max(axis=0) if norm == math.inf else (magnitudes**norm).sum(axis=0)

    own = length(residual_of(adjacency, extension, target, FilterSpec("polynomial", norm=norm)))
    for other in (1.0, 1.1, 1.5, 1.75, 2.0, math.inf):
        theirs = length(residual_of(adjacency, extension, target, FilterSpec("polynomial", norm=other)))
        assert (own <= theirs * (1 + 1e-5)).all()
    zeroth = length(target - extension)
    assert (own <= zeroth * (1 + 1e-6)).all()


@pytest.mark.parametrize("norm", [1.0, math.inf])
def test_a_program_over_many_rows_is_solved_exactly(norm: float) -> None:
    """Least sum and least maximum are convex: no small change of the coefficients may lower them."""
    adjacency, extension, target = level_of_torus(200, 150, 16)
    spec = FilterSpec("polynomial", 2, "chebyshev", norm)
    coefficients = fit(adjacency, extension, target, spec)
    columns = basis_columns(adjacency, extension[:, 2], 2, "chebyshev")
    basis, _ = np.linalg.qr(columns)
    residual = target[:, 2] - columns @ coefficients[2].astype(float)

    def length(values: NDArray[np.float64]) -> float:
        return np.abs(values).sum() if norm == 1.0 else np.abs(values).max()

    random = np.random.default_rng(5)
    for size in (10.0, 1.0, 0.1, 0.01):
        for _ in range(50):
            assert length(residual - basis @ (random.normal(size=3) * size)) >= length(residual) * (1 - 1e-5)


@pytest.mark.parametrize("preparing_rounds", [0, 12])
def test_a_least_sum_over_few_rows_in_doubt_is_that_of_the_whole_program(
    monkeypatch: pytest.MonkeyPatch, preparing_rounds: int
) -> None:
    fitting = importlib.import_module("meshtide_codec.fit")
    monkeypatch.setattr(fitting, "SMALLEST_BAND", 10)
    monkeypatch.setattr(fitting, "PREPARING_ROUNDS", preparing_rounds)
    _, extension, target = level_of_torus(20, 30, 64)
    random = np.random.default_rng(8)
    basis = np.asfortranarray(np.linalg.qr(random.normal(size=(600, 5)))[0])
    residual = (target - extension)[:, 0] * random.choice([1.0, 30.0], 600)
    shares = fitting._least_sum(basis, residual)
    assert np.abs(residual - basis @ shares).sum() == pytest.approx(reference_sum(basis, residual), rel=1e-7)


def test_columns_become_orthonormal_however_alike_they_are() -> None:
    adjacency, extension, _ = level_of_torus(40, 40, 16)
    columns = basis_columns(adjacency, extension[:, 1] + 2.0**14, 7, "power")
    original = columns.copy()
    triangle = np.zeros((8, 8))
    assert _orthonormalise(columns, triangle) == 8
    assert np.abs(columns.T @ columns - np.eye(8)).max() < 1e-13
    assert not np.tril(triangle, -1).any()
    np.testing.assert_allclose(columns @ triangle, original, atol=1e-9)


def test_the_zeroth_filter_wins_where_no_other_is_more_accurate() -> None:
    """Full cells bound the error of the zeroth filter by half a side, and some vertices attain it on both sides."""
    adjacency, extension, target = level_of_torus(100, 100, 4)
    coefficients = fit(adjacency, extension, target, FilterSpec("polynomial", 4, norm=math.inf))
    assert coefficients.tolist() == [[1, 0, 0, 0, 0]] * 3


@pytest.mark.parametrize("basis", ["power", "chebyshev"])
@pytest.mark.parametrize("norm", [1.0, 1.5, 2.0, math.inf])
def test_coefficients_that_made_the_target_are_found(basis: Basis, norm: float) -> None:
    adjacency, extension, _ = level_of_torus(30, 30, 64)
    spec = FilterSpec("polynomial", 2, basis, norm)
    true = np.array([[0.875, -0.25, 0.5], [1.0, 0.5, -0.125], [1.25, -0.75, 0.0]], np.float32)
    found = fit(adjacency, extension, predict(adjacency, extension, spec, true), spec)
    np.testing.assert_allclose(found, true, atol=2e-5)


def test_outliers_do_not_move_the_least_sum() -> None:
    adjacency, extension, _ = level_of_torus(30, 30, 64)
    spec = FilterSpec("polynomial", 2, norm=1.0)
    true = np.tile(np.array([1.0, -0.5, 0.25], np.float32), (3, 1))
    target = predict(adjacency, extension, spec, true)
    target[::10] += 1000.0
    np.testing.assert_allclose(fit(adjacency, extension, target, spec), true, atol=1e-5)


@pytest.mark.parametrize("norm", [1.0, 1.3, 2.0, math.inf])
@pytest.mark.parametrize("basis", ["power", "chebyshev"])
def test_degenerate_input_gives_modest_coefficients(basis: Basis, norm: float) -> None:
    spec = FilterSpec("polynomial", 7, basis, norm)
    zeroth = [1.0] + [0.0] * 7
    faces = torus_faces(6, 6)
    isolated = build_adjacency(faces[:0], 36)
    torus = build_adjacency(faces, 36)
    grid = np.arange(36.0)
    plane = np.stack([grid % 6, grid // 6, np.zeros(36)], axis=1)
    assert fit(isolated, plane, plane + 5.0, spec).tolist() == [zeroth] * 3
    assert fit(torus, np.zeros((36, 3)), plane, spec).tolist() == [zeroth] * 3
    assert fit(torus, plane, plane, spec)[2].tolist() == zeroth
    equal = fit(torus, np.full((36, 3), 0.1), np.full((36, 3), 0.2), spec)
    doubled = predict(torus, np.full((36, 3), 0.1), spec, equal)
    np.testing.assert_allclose(doubled, 0.2, rtol=1e-6)
    assert (equal[:, 1:] == 0).all()
    random = np.random.default_rng(1)
    irregular = build_adjacency(random.integers(0, 36, (60, 3), dtype=np.int32), 36)
    assert apply_k(irregular, np.full(36, 0.7)).any()  # rounding noise, which must not become a column
    noisy = fit(irregular, np.full((36, 3), 0.7), random.normal(size=(36, 3)), spec)
    assert (noisy[:, 1:] == 0).all()


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 9),
    st.lists(st.tuples(*[st.integers(0, 8)] * 3), max_size=8),
    st.sampled_from([1.0, 1.5, 2.0, math.inf]),
    st.sampled_from(["power", "chebyshev"]),
    st.integers(0, 2**32 - 1),
    st.sampled_from([1e-200, 1.0, 2.0**20, 1e200]),
)
def test_tiny_meshes_are_fitted_at_any_scale(
    count: int, faces: list[tuple[int, int, int]], norm: float, basis: Basis, seed: int, scale: float
) -> None:
    kept = [face for face in faces if max(face) < count]
    adjacency = build_adjacency(np.array(kept, np.int32).reshape(-1, 3), count)
    random = np.random.default_rng(seed)
    extension, target = (random.integers(-3, 4, (count, 3)) * scale for _ in range(2))
    spec = FilterSpec("polynomial", 5, basis, norm)
    coefficients = fit(adjacency, extension, target, spec)
    assert np.isfinite(coefficients).all()
    error = target / scale - predict(adjacency, extension / scale, spec, coefficients)
    connected = adjacency.degree > 0
    if norm == 2.0 and connected.any():
        before = np.linalg.norm((target - extension)[connected] / scale, axis=0)
        assert (np.linalg.norm(error[connected], axis=0) <= before * (1 + 1e-6) + 1e-5).all()


def test_isolated_vertices_have_no_say() -> None:
    adjacency, extension, target = level_of_torus(20, 20, 32)
    faces = torus_faces(20, 20)
    larger = build_adjacency(faces, 410)
    far = np.full((10, 3), 1e6)
    for norm in (1.0, 2.0, math.inf):
        spec = FilterSpec("polynomial", 3, norm=norm)
        alone = fit(adjacency, extension, target, spec)
        together = fit(larger, np.concatenate([extension, far]), np.concatenate([target, -far]), spec)
        np.testing.assert_allclose(together, alone, rtol=1e-4, atol=1e-4)


def test_rounding_coefficients_to_single_precision_costs_nothing() -> None:
    adjacency, extension, target = level_of_torus(100, 100, 16)
    shifted = 2.0**8
    columns = basis_columns(adjacency, extension[:, 0] * shifted, 7, "power")
    basis, _ = np.linalg.qr(columns)
    best = np.linalg.norm(target[:, 0] * shifted - basis @ (basis.T @ (target[:, 0] * shifted)))
    error = residual_of(adjacency, extension * shifted, target * shifted, FilterSpec("polynomial", 7))
    assert np.linalg.norm(error[:, 0]) <= best * (1 + 1e-6)


@pytest.mark.parametrize(("degree", "denominator_degree"), [(0, 1), (1, 1), (1, 3), (3, 2)])
@pytest.mark.parametrize("basis", ["power", "chebyshev"])
def test_a_rational_filter_is_never_worse_than_its_numerator_alone(
    degree: int, denominator_degree: int, basis: Basis
) -> None:
    for step in (4, 32):
        adjacency, extension, target = level_of_torus(30, 40, step)
        spec = FilterSpec("rational", degree, basis, denominator_degree=denominator_degree)
        plain = residual_of(adjacency, extension, target, FilterSpec("polynomial", degree, basis))
        error = residual_of(adjacency, extension, target, spec)
        assert (np.linalg.norm(error, axis=0) <= np.linalg.norm(plain, axis=0) * (1 + 1e-12)).all()
        for row in fit(adjacency, extension, target, spec):
            assert is_safe_denominator(row[degree + 1 :])


def test_a_rational_filter_that_made_the_target_is_found() -> None:
    adjacency, extension, _ = level_of_torus(30, 30, 64)
    spec = FilterSpec("rational", 1, denominator_degree=1)
    true = np.array([[1.0, -0.25, 0.75], [1.0, 0.125, 2.0], [0.875, 0.0, -0.25]], np.float32)
    target = predict(adjacency, extension, spec, true)
    np.testing.assert_allclose(fit(adjacency, extension, target, spec), true, atol=1e-4)


def test_an_unsafe_denominator_is_shrunk_or_dropped() -> None:
    """1 - 0.8 K would make this target, but is negative at the end of the spectrum."""
    adjacency, target, _ = level_of_torus(30, 30, 64)
    extension = target - 0.8 * apply_k(adjacency, target)
    spec = FilterSpec("rational", 0, denominator_degree=1)
    coefficients = fit(adjacency, extension, target, spec)
    assert all(is_safe_denominator(row[1:]) for row in coefficients)
    assert (coefficients[:, 1] < 0).all()
    error = target - predict(adjacency, extension, spec, coefficients)
    assert np.linalg.norm(error) < np.linalg.norm(target - extension)


@pytest.mark.parametrize("kind", ["zeroth", "gaussian", "taubin"])
def test_fixed_filters_have_nothing_to_fit(kind: Kind) -> None:
    adjacency, extension, target = level_of_torus(6, 6, 64)
    coefficients = fit(adjacency, extension, target, FilterSpec(kind))
    assert coefficients.shape == (3, 0)
    assert coefficients.dtype == np.float32


def test_bad_arrays_are_refused() -> None:
    adjacency, extension, target = level_of_torus(6, 6, 64)
    for bad in (target[:-1], target.astype(np.float32), np.where(target == target.max(), np.inf, target)):
        with pytest.raises(MeshError, match="target"):
            fit(adjacency, extension, bad, FilterSpec())
        with pytest.raises(MeshError, match="extension"):
            fit(adjacency, bad, target, FilterSpec())


def test_inputs_are_left_alone_and_results_repeat() -> None:
    adjacency, extension, target = level_of_torus(12, 12, 64)
    copies = extension.copy(), target.copy()
    for spec in (FilterSpec(), FilterSpec(norm=1.0), FilterSpec(norm=math.inf), FilterSpec("rational")):
        first = fit(adjacency, extension, target, spec)
        assert first.shape == (3, coefficient_count(spec))
        assert first.tobytes() == fit(adjacency, extension, target, spec).tobytes()
    assert np.array_equal(extension, copies[0])
    assert np.array_equal(target, copies[1])


@pytest.mark.parametrize(
    ("spec", "digest"),
    [
        (FilterSpec("polynomial", 7), "064241e65caf6efb"),
        (FilterSpec("polynomial", 7, "chebyshev"), "556fe43cafc30422"),
        (FilterSpec("rational", 1), "8574563b84a224ac"),
    ],
)
def test_least_squares_coefficients_are_the_same_bits_everywhere(spec: FilterSpec, digest: str) -> None:
    row, column = (grid.ravel() for grid in np.mgrid[:24, :24])
    height = (row * 37 + column * 101 + row * column * 13) % 97
    target = np.stack([row * 40 + height % 7, column * 30 + height % 11, height * 5], axis=1).astype(np.float64)
    extension = np.floor(target / 32) * 32 + 15.5
    coefficients = fit(build_adjacency(torus_faces(24, 24), 576), extension, target, spec)
    assert hashlib.sha256(coefficients.astype("<f4").tobytes()).hexdigest()[:16] == digest
