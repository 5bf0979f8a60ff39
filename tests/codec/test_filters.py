"""Filters against dense matrices, their headers, and parameters that no encoder would write."""

from __future__ import annotations

import hashlib
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import chebyshev

from meshtide_codec.errors import MeshError, OptionError, ParamError
from meshtide_codec.filters import (
    SMALLEST_DENOMINATOR,
    FilterSpec,
    basis_columns,
    coefficient_count,
    divide,
    is_safe_denominator,
    predict,
)
from meshtide_codec.graph import Adjacency, apply_k, build_adjacency

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.filters import Basis, Kind

NO_COEFFICIENTS = np.empty((3, 0), np.float32)


def bumpy_torus(rows: int, columns: int, isolated: int = 0) -> tuple[Adjacency, NDArray[np.float64]]:
    """A closed grid with integer points, and a few vertices without edges."""
    row, column = (grid.ravel() for grid in np.mgrid[:rows, :columns])
    right, below = row * columns + (column + 1) % columns, (row + 1) % rows * columns + column
    diagonal = (row + 1) % rows * columns + (column + 1) % columns
    here = row * columns + column
    faces = np.concatenate([np.stack([here, right, diagonal], 1), np.stack([here, diagonal, below], 1)])
    height = (row * 37 + column * 101 + row * column * 13) % 97
    points = np.stack([row * 40 + height % 7, column * 30 + height % 11, height * 5], axis=1)
    points = np.concatenate([points, np.full((isolated, 3), 17)])
    return build_adjacency(faces.astype(np.int32), len(points)), points.astype(np.float64)


def dense_k(adjacency: Adjacency) -> NDArray[np.float64]:
    return np.stack([apply_k(adjacency, row) for row in np.eye(adjacency.vertex_count)], axis=1)


@pytest.mark.parametrize(
    "fields",
    [
        {"kind": "median"},
        {"kind": ["zeroth"]},
        {"degree": -1},
        {"degree": 16},
        {"degree": 2.0},
        {"degree": True},
        {"basis": "legendre"},
        {"basis": 3},
        {"norm": 0.5},
        {"norm": 3},
        {"norm": math.nan},
        {"norm": -math.inf},
        {"norm": "2"},
        {"norm": 10**400},
        {"kind": "taubin", "taubin_lambda": -0.1},
        {"kind": "taubin", "taubin_mu": 2.1},
        {"kind": "taubin", "taubin_mu": math.nan},
        {"kind": "rational", "norm": 1.0},
        {"kind": "rational", "denominator_degree": 0},
        {"kind": "rational", "denominator_degree": 5},
    ],
)
def test_options_out_of_range_are_refused(fields: dict[str, Any]) -> None:
    with pytest.raises(OptionError):
        FilterSpec(**fields)


def test_fields_that_a_kind_does_not_use_are_neutral() -> None:
    assert FilterSpec("gaussian", degree=9, norm=1.0, taubin_mu=1.0) == FilterSpec("gaussian")
    assert [FilterSpec(kind).degree for kind in ("zeroth", "gaussian", "taubin")] == [0, 1, 2]


def test_counts_of_coefficients() -> None:
    assert [coefficient_count(FilterSpec(kind)) for kind in ("zeroth", "gaussian", "taubin")] == [0, 0, 0]
    assert coefficient_count(FilterSpec("polynomial", degree=3)) == 4
    assert coefficient_count(FilterSpec("rational", degree=3, denominator_degree=2)) == 6


def test_fixed_filters_are_their_matrices() -> None:
    adjacency, points = bumpy_torus(5, 6, isolated=2)
    k, identity = dense_k(adjacency), np.eye(adjacency.vertex_count)
    spec = FilterSpec("taubin", taubin_lambda=0.5, taubin_mu=0.625)
    expected = (identity - 0.5 * k) @ (identity + 0.625 * k) @ points
    np.testing.assert_allclose(predict(adjacency, points, spec, NO_COEFFICIENTS), expected, atol=1e-9)
    smoothed = predict(adjacency, points, FilterSpec("gaussian"), NO_COEFFICIENTS)
    np.testing.assert_allclose(smoothed, points - k @ points, atol=1e-9)
    ring = adjacency.neighbours[adjacency.offsets[7] : adjacency.offsets[8]]
    np.testing.assert_allclose(smoothed[7], points[ring].mean(axis=0))
    unchanged = predict(adjacency, points, FilterSpec("zeroth"), NO_COEFFICIENTS)
    assert np.array_equal(unchanged, points)
    assert unchanged is not points


def test_columns_are_powers_and_chebyshev_polynomials() -> None:
    adjacency, points = bumpy_torus(4, 5, isolated=1)
    k, identity = dense_k(adjacency), np.eye(adjacency.vertex_count)
    powers = basis_columns(adjacency, points[:, 2], 4, "power")
    assert powers.flags.f_contiguous
    for degree in range(5):
        power = np.linalg.matrix_power(k, degree) @ points[:, 2]
        np.testing.assert_allclose(powers[:, degree], power, atol=1e-8)
    shifted = k - identity
    orders = basis_columns(adjacency, points[:, 2], 5, "chebyshev")
    t_5 = 16 * np.linalg.matrix_power(shifted, 5) - 20 * np.linalg.matrix_power(shifted, 3) + 5 * shifted
    np.testing.assert_allclose(orders[:, 5], t_5 @ points[:, 2], atol=1e-8)
    np.testing.assert_allclose(orders[:, 1], shifted @ points[:, 2], atol=1e-8)


@given(st.integers(0, 15), st.sampled_from(["power", "chebyshev"]), st.integers(0, 2**32 - 1))
def test_a_polynomial_is_the_sum_of_its_columns(degree: int, basis: Basis, seed: int) -> None:
    adjacency, points = bumpy_torus(5, 7, isolated=3)
    spec = FilterSpec("polynomial", degree, basis)
    coefficients = np.random.default_rng(seed).normal(size=(3, degree + 1)).astype(np.float32)
    prediction = predict(adjacency, points, spec, coefficients)
    for axis in range(3):
        columns = basis_columns(adjacency, points[:, axis], degree, basis)
        expected = columns @ coefficients[axis].astype(np.float64)
        tolerance = 1e-12 * np.abs(columns).max() * (degree + 1) ** 2
        np.testing.assert_allclose(prediction[:-3, axis], expected[:-3], atol=tolerance, rtol=0)
    assert np.array_equal(prediction[-3:], points[-3:])


def test_a_chebyshev_series_acts_on_an_eigenvector_as_on_its_eigenvalue() -> None:
    adjacency, _ = bumpy_torus(5, 6)
    eigenvalues, vectors = np.linalg.eigh(dense_k(adjacency))  # symmetric: every degree is 6
    series = np.array([0.5, -1.0, 0.25, 2.0, -0.125], np.float32)
    points = np.ascontiguousarray(vectors[:, [3, 11, 29]])
    prediction = predict(adjacency, points, FilterSpec("polynomial", 4, "chebyshev"), np.tile(series, (3, 1)))
    gains = chebyshev.chebval(eigenvalues[[3, 11, 29]] - 1, series)
    np.testing.assert_allclose(prediction, points * gains, atol=1e-12)


@pytest.mark.parametrize("denominator", [[2.5], [-0.4], [0.5, 0.25], [-1.0, 1.0, -0.25], [0.1, 0.2, 0.3, 0.4]])
@pytest.mark.parametrize("basis", ["power", "chebyshev"])
def test_a_rational_filter_solves_its_equation(denominator: list[float], basis: Basis) -> None:
    adjacency, points = bumpy_torus(6, 7, isolated=2)
    k = dense_k(adjacency)
    spec = FilterSpec("rational", 1, basis, denominator_degree=len(denominator))
    coefficients = np.tile(np.array([0.75, -0.5, *denominator], np.float32), (3, 1))
    numerator = predict(adjacency, points, FilterSpec("polynomial", 1, basis), coefficients[:, :2].copy())
    divisor = sum(
        float(q) * np.linalg.matrix_power(k, power) for power, q in enumerate([1.0, *coefficients[0, 2:].tolist()])
    )
    expected = np.linalg.solve(divisor, numerator)
    expected[-2:] = points[-2:]
    prediction = predict(adjacency, points, spec, coefficients)
    np.testing.assert_allclose(prediction, expected, atol=1e-8 * np.abs(points).max())


def test_division_works_on_irregular_graphs_and_single_edges() -> None:
    fan = [[0, i, i + 1] for i in range(1, 40)] + [[41, 42, 42]]
    adjacency = build_adjacency(np.array(fan, np.int32), 44)
    values = np.arange(44.0) ** 2
    quotient = divide(adjacency, values, np.array([1.5], np.float32))
    np.testing.assert_allclose(quotient + 1.5 * apply_k(adjacency, quotient), values, atol=1e-7)
    assert quotient[43] == values[43]
    assert np.array_equal(divide(adjacency, values, np.zeros(2, np.float32)), values)


@given(st.lists(st.floats(-300, 300, width=32), min_size=1, max_size=4))
def test_a_safe_denominator_is_positive_and_bounded(denominator: list[float]) -> None:
    coefficients = np.array(denominator, np.float32)
    values = np.polynomial.polynomial.polyval(np.linspace(0, 2, 10_001), [1.0, *coefficients.astype(float)])
    if is_safe_denominator(coefficients):
        assert values.min() >= SMALLEST_DENOMINATOR
        assert values.max() <= 256 * values.min()
    else:
        assert values.min() < 0.1 or values.max() > 128 * values.min() or np.abs(coefficients).max() > 20


def test_ordinary_denominators_are_safe_and_others_are_not() -> None:
    assert is_safe_denominator(np.array([50.0], np.float32))
    assert is_safe_denominator(np.array([-0.49], np.float32))
    assert is_safe_denominator(np.array([0, 0, 0, 0], np.float32))
    for hostile in ([-0.5], [-1.0], [1e3], [3e38], [-2.0, 1.0], [math.nan], [1.0, math.inf], [3e38, -3e38, 3e38, 3e38]):
        assert not is_safe_denominator(np.array(hostile, np.float32))


@pytest.mark.parametrize("hostile", [-0.5, -3.0, 1e3, 3e38, -3e38])
def test_a_hostile_denominator_is_a_damaged_param(hostile: float) -> None:
    adjacency, points = bumpy_torus(4, 4)
    coefficients = np.array([[1, 0, 0], [1, 0, 0], [1, 0, hostile]], np.float32)
    with pytest.raises(ParamError, match="denominator"):
        predict(adjacency, points, FilterSpec("rational", 1), coefficients)


@pytest.mark.parametrize("kind", ["polynomial", "rational"])
def test_the_largest_coefficients_give_finite_predictions(kind: Kind) -> None:
    adjacency, points = bumpy_torus(6, 6)
    spec = FilterSpec(kind, degree=15)
    coefficients = np.full((3, coefficient_count(spec)), np.finfo(np.float32).max, np.float32)
    coefficients[:, 16:] = 100.0
    assert np.isfinite(predict(adjacency, points * 2**12, spec, coefficients)).all()


@pytest.mark.parametrize(
    ("coefficients", "message"),
    [
        (np.ones((3, 3), np.float32), r"\(3, 4\)"),
        (np.ones((4, 3), np.float32), r"\(3, 4\)"),
        (np.ones((3, 4)), "float64"),
        (np.array([[1, 0, 0, 0], [1, 0, np.nan, 0], [1, 0, 0, 0]], np.float32), "coefficient 2 of coordinate 1 is nan"),
        (np.array([[1, 0, 0, 0], [1, 0, 0, 0], [-np.inf, 0, 0, 0]], np.float32), "coefficient 0 of coordinate 2"),
    ],
)
def test_bad_coefficients_are_a_damaged_param(coefficients: NDArray[np.float32], message: str) -> None:
    adjacency, points = bumpy_torus(4, 4)
    with pytest.raises(ParamError, match=message):
        predict(adjacency, points, FilterSpec("polynomial"), coefficients)


def test_bad_extensions_are_refused() -> None:
    adjacency, points = bumpy_torus(4, 4)
    spec = FilterSpec("zeroth")
    for bad in (
        points[:-1],
        points[:, :2],
        points.astype(np.float32),
        np.where(points == points.max(), np.nan, points),
    ):
        with pytest.raises(MeshError, match="extension"):
            predict(adjacency, bad, spec, NO_COEFFICIENTS)
    with pytest.raises(MeshError, match="values"):
        basis_columns(adjacency, points[:-1, 0], 2, "power")
    with pytest.raises(OptionError):
        basis_columns(adjacency, points[:, 0], 16, "power")


def test_a_mesh_without_vertices_is_predicted() -> None:
    adjacency = build_adjacency(np.empty((0, 3), np.int32), 0)
    spec = FilterSpec("rational", 1)
    coefficients = np.tile(np.array([1, 0, 0.5], np.float32), (3, 1))
    assert predict(adjacency, np.empty((0, 3)), spec, coefficients).shape == (0, 3)


@pytest.mark.parametrize(
    ("spec", "row", "digest"),
    [
        (FilterSpec("gaussian"), [], "dfc8e77e63eb10cb"),
        (FilterSpec("taubin"), [], "7d9635a9d15afe96"),
        (FilterSpec("polynomial", 3), [1.0, -0.7, 0.3, 0.1], "1107d00a011b30a9"),
        (FilterSpec("polynomial", 3, "chebyshev"), [0.5, -0.4, 0.07, 0.03], "1b4d439c92f7664f"),
        (FilterSpec("rational", 1, denominator_degree=2), [1.0, 0.1, 0.6, 0.2], "8696dfbc2e041caf"),
    ],
)
def test_predictions_are_the_same_bits_everywhere(spec: FilterSpec, row: list[float], digest: str) -> None:
    adjacency, points = bumpy_torus(16, 24, isolated=1)
    coefficients = np.tile(np.array(row, np.float32), (3, 1))
    prediction = predict(adjacency, points, spec, coefficients)
    assert hashlib.sha256(prediction.astype("<f8").tobytes()).hexdigest()[:16] == digest
