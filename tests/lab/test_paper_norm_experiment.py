from __future__ import annotations

from functools import cache

import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.quantize import quantize
from meshtide_codec.samples import load_sample, sample_names
from meshtide_lab.paper.norm_experiment import NORM_DEGREES, NORMS, NormResult, run_norm

OPTIONS = ClassicOptions(bits=10)
L1, NEARLY_L1, BETWEEN, L2, MAXIMUM = NORMS
FLOAT32 = 1e-5
"""Coefficients are rounded to single precision, so a fit is the best one only up to this share."""

cases = pytest.mark.parametrize(("name", "degree"), [(n, d) for n in sample_names() for d in NORM_DEGREES])


@cache
def last_diff_lost(name: str, degree: int, norm: str) -> NormResult:
    """Section 4.1 on a real mesh: all levels but the finest are exact, so all norms predict from the same extension."""
    multi, _ = run_norm(quantize(load_sample(name), OPTIONS.bits), OPTIONS, degree, norm)
    assert multi.scheme == "multi"
    return multi


@cases
def test_the_maximum_norm_has_the_smallest_largest_error(name: str, degree: int) -> None:
    least = last_diff_lost(name, degree, MAXIMUM).lost.largest_coordinate
    for norm in (L1, L2):
        assert least < last_diff_lost(name, degree, norm).lost.largest_coordinate


@cases
def test_least_squares_have_the_smallest_energy(name: str, degree: int) -> None:
    least = last_diff_lost(name, degree, L2).lost.rms
    for norm in (L1, BETWEEN, MAXIMUM):
        assert least <= last_diff_lost(name, degree, norm).lost.rms * (1 + FLOAT32)


@cases
def test_the_l1_program_has_the_smallest_sum_and_reweighting_comes_near(name: str, degree: int) -> None:
    least = last_diff_lost(name, degree, L1).lost.mean
    for norm in (NEARLY_L1, BETWEEN, L2, MAXIMUM):
        assert least <= last_diff_lost(name, degree, norm).lost.mean * (1 + FLOAT32)
    assert last_diff_lost(name, degree, NEARLY_L1).lost.mean < 1.001 * least


@cases
def test_norms_between_1_and_2_compress_better_than_the_maximum_norm(name: str, degree: int) -> None:
    for norm in (L1, BETWEEN, L2):
        assert last_diff_lost(name, degree, norm).rate < last_diff_lost(name, degree, MAXIMUM).rate
