"""Statistics of Diffs against closed forms and against samples of known distributions."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import OptionError
from meshtide_codec.statistics import (
    PowerLaw,
    fit_power_law,
    l2_error_per_vertex,
    power_law_gap,
    rate_model,
    shannon_bound_bits,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

integers = st.lists(st.integers(-50, 50), min_size=1, max_size=60).map(lambda values: np.array(values, np.int32))


def sample(alpha: float, scale: float, count: int = 200_000) -> NDArray[np.float64]:
    """|x| = scale * g^(1/alpha), g of a gamma distribution of shape 1/alpha, has density (20) with a = scale^-alpha."""
    random = np.random.default_rng(11)
    magnitudes = scale * random.gamma(1 / alpha, size=count) ** (1 / alpha)
    return magnitudes * random.choice([-1.0, 1.0], count)


@given(integers)
def test_shannon_bound_is_the_entropy_of_the_histogram(values: NDArray[np.int32]) -> None:
    frequencies = np.array([np.mean(values == value) for value in set(values.tolist())])
    assert shannon_bound_bits(values) == pytest.approx(
        -len(values) * (frequencies * np.log2(frequencies)).sum(), abs=1e-9
    )


@given(integers)
def test_columns_have_their_own_models(values: NDArray[np.int32]) -> None:
    columns = np.stack([values, values[::-1], np.full(len(values), 7)], axis=1)
    assert shannon_bound_bits(columns) == pytest.approx(2 * shannon_bound_bits(values))


def test_bounds_of_plain_cases() -> None:
    assert shannon_bound_bits(np.zeros((10, 3), np.int64)) == 0.0
    assert shannon_bound_bits(np.empty((0, 3), np.int64)) == 0.0
    assert shannon_bound_bits(np.arange(256).reshape(256, 1)) == 256 * 8


@pytest.mark.parametrize("alpha", [0.5, 1.0, 1.5, 2.0, 3.0])
def test_the_power_law_of_a_sample_is_found(alpha: float) -> None:
    law = fit_power_law(sample(alpha, 20.0))
    assert law.alpha == pytest.approx(alpha, rel=0.03)
    assert law.a == pytest.approx(20.0**-alpha, rel=0.15)


def test_a_is_the_paper_s_estimate() -> None:
    values = np.array([3, -1, 0, 4, -2, 7])
    law = fit_power_law(values)
    assert law.a == pytest.approx(1 / (law.alpha * (np.abs(values) ** law.alpha).mean()))


def test_exponents_stay_in_their_range() -> None:
    spike = np.zeros(10_000, np.int64)
    spike[0] = 1
    assert fit_power_law(spike).alpha == 0.2
    assert fit_power_law(np.array([5, -5, 5])).alpha == 4.0


def test_a_fit_does_not_depend_on_the_unit() -> None:
    values = sample(1.2, 5.0, 1000)
    assert fit_power_law(values * 1e6).alpha == pytest.approx(fit_power_law(values).alpha)


@pytest.mark.parametrize("law", [PowerLaw(1.0, 0.3), PowerLaw(2.0, 0.01), PowerLaw(0.7, 1.0)])
def test_a_density_has_mass_one_and_the_moment_of_its_a(law: PowerLaw) -> None:
    x = np.linspace(-400, 400, 1_600_001)
    density = np.array([law.density(value) for value in x[::20]])
    step = x[20] - x[0]
    assert density.sum() * step == pytest.approx(1, rel=1e-2)
    assert (density * np.abs(x[::20]) ** law.alpha).sum() * step == pytest.approx(1 / (law.alpha * law.a), rel=1e-2)


@pytest.mark.parametrize("alpha", [1.0, 1.5, 2.0])
def test_the_rate_of_wide_differences_is_their_entropy(alpha: float) -> None:
    differences = np.rint(sample(alpha, 12.0)).astype(np.int64)
    measured = shannon_bound_bits(differences) / len(differences)
    assert rate_model(differences, alpha) == pytest.approx(measured, abs=0.02)


def test_the_rate_grows_by_a_bit_when_differences_double() -> None:
    values = sample(1.0, 9.0, 500)
    assert rate_model(values * 2, 1.3) == pytest.approx(rate_model(values, 1.3) + 1)


def test_the_true_exponent_predicts_the_least_rate() -> None:
    values = sample(1.0, 30.0)
    assert rate_model(values, 1.0) < min(rate_model(values, 0.6), rate_model(values, 1.6))


def test_no_differences_cost_nothing() -> None:
    zeros = np.zeros((5, 3), np.int32)
    law = fit_power_law(zeros)
    assert law.a == math.inf
    assert rate_model(zeros, law.alpha) == 0.0
    assert rate_model(np.empty((0, 3)), 1.0) == 0.0
    assert l2_error_per_vertex(zeros, 1.0) == 0.0
    assert l2_error_per_vertex(np.empty((0, 3)), 1.0) == 0.0
    assert rate_model(np.array([0] * 1000 + [1]), 1.0) >= 0.0


def test_l2_error_is_the_norm_over_the_vertices() -> None:
    differences = np.array([[1, 2, 2], [0, 0, 0], [0, 4, 0], [0, 0, 0]])
    assert l2_error_per_vertex(differences, 1 / 4095) == pytest.approx(5 / 4 / 4095)


@pytest.mark.parametrize("bad", [np.array([1.0, np.nan]), np.array([np.inf]), np.array(["1"]), np.array([1j])])
def test_what_is_not_a_number_is_refused(bad: NDArray[Any]) -> None:
    for measure in (fit_power_law, lambda x: rate_model(x, 1.0), lambda x: l2_error_per_vertex(x, 1.0)):
        with pytest.raises(OptionError):
            measure(bad)


def test_options_out_of_range_are_refused() -> None:
    with pytest.raises(OptionError):
        fit_power_law(np.empty(0))
    for alpha in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(OptionError):
            rate_model(np.ones(3), alpha)
    with pytest.raises(OptionError):
        shannon_bound_bits(np.ones(3))
    with pytest.raises(OptionError):
        shannon_bound_bits(np.ones((2, 2, 2), np.int64))


@pytest.mark.parametrize("alpha", [0.8, 1.0, 2.0])
def test_differences_drawn_from_a_power_law_lie_close_to_it(alpha: float) -> None:
    rng = np.random.default_rng(5)
    scale = 12.0
    sizes = scale * rng.gamma(1 / alpha, 1.0, 40_000) ** (1 / alpha)
    differences = np.rint(sizes * rng.choice([-1, 1], len(sizes))).astype(np.int64)
    law = PowerLaw(alpha, scale**-alpha)
    assert power_law_gap(differences, law) < 0.012
    assert power_law_gap(differences, PowerLaw(alpha, (3 * scale) ** -alpha)) > 0.1
    assert power_law_gap(differences + 30, law) > 0.2


def test_gaps_of_special_differences() -> None:
    zeros = np.zeros(5, np.int64)
    assert power_law_gap(zeros, fit_power_law(zeros)) == 0.0
    assert power_law_gap(np.array([0, 0, 0, 7]), PowerLaw(1.0, math.inf)) == 0.25
    for bad in (np.zeros(0, np.int64), np.zeros(3)):
        with pytest.raises(OptionError, match="integer differences"):
            power_law_gap(bad, PowerLaw(1.0, 1.0))
