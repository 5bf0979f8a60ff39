"""What the paper says about its figures, held against the figures of each mesh, sentence by sentence.

A sentence is one of sections 4 to 6 that figures can confirm or refute; each test is spelt out beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_lab.paper.mesh_result import PICTURED_FILTERS

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_lab.paper.mesh_result import MeshResult
    from meshtide_lab.paper.norm_experiment import NormResult

DEGREES = range(1, 8)
SMALL_GAIN = 0.01
"""A range of degrees is enough if none outside of it saves more than this share."""

SMALL_SPREAD = 0.1
"""Rates within this share of each other do not differ much: those of the paper's car, round table and skateboard."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Whether a sentence holds for a mesh, and the figures that show it."""

    holds: bool
    figures: str


@dataclass(frozen=True, slots=True)
class Sentence:
    """A sentence of the paper.

    Args:
        section: where it stands.
        quote: its words.
        test: what is looked at.
        find: the finding for a mesh.
    """

    section: str
    quote: str
    test: str
    find: Callable[[MeshResult], Finding]


def _rates(mesh: MeshResult, scheme: str) -> dict[str, float]:
    return {name: mesh.filters[name].schemes[scheme].sizes.rate for name in PICTURED_FILTERS}


def _listed(values: dict[str, float], digits: int = 2) -> str:
    return ", ".join(f"{name} {value:.{digits}f}" for name, value in values.items())


def _zeroth_compresses_best(mesh: MeshResult) -> Finding:
    rates = _rates(mesh, "multi")
    return Finding(min(rates, key=rates.__getitem__) == "zeroth", _listed(rates))


def _zeroth_compresses_best_in_finest_steps(mesh: MeshResult) -> Finding:
    bounds = {name: mesh.filters[name].schemes["multi"].fine_shannon_rate for name in PICTURED_FILTERS}
    return Finding(min(bounds, key=bounds.__getitem__) == "zeroth", _listed(bounds))


def _zeroth_compresses_worst(mesh: MeshResult) -> Finding:
    rates = _rates(mesh, "multi")
    return Finding(max(rates, key=rates.__getitem__) == "zeroth", _listed(rates))


def _gaussian_is_poor(mesh: MeshResult) -> Finding:
    rates = _rates(mesh, "multi")
    return Finding(max(rates, key=rates.__getitem__) == "gaussian", _listed(rates))


def _zeroth_gains_by_levels(mesh: MeshResult) -> Finding:
    sizes = {scheme: mesh.filters["zeroth"].schemes[scheme].sizes.rate for scheme in ("multi", "single")}
    return Finding(sizes["multi"] < sizes["single"], _listed(sizes))


def _single_rates_are_alike(mesh: MeshResult) -> Finding:
    rates = _rates(mesh, "single")
    spread = max(rates.values()) / min(rates.values()) - 1
    return Finding(spread <= SMALL_SPREAD, f"largest / smallest rate {1 + spread:.2f}")


def _higher_orders_compress_single(mesh: MeshResult) -> Finding:
    rates = _rates(mesh, "single")
    return Finding(max(rates["degree 1"], rates["degree 3"]) < rates["zeroth"], _listed(rates))


def _higher_orders_are_accurate(mesh: MeshResult) -> Finding:
    errors = {name: 1e4 * mesh.filters[name].l2_error for name in PICTURED_FILTERS}
    holds = max(errors["degree 1"], errors["degree 3"]) < errors["zeroth"]
    return Finding(holds, _listed(errors) + " (l2 error/vertex x 1e4)")


def _smaller_error_smaller_rate(mesh: MeshResult) -> Finding:
    rates = _rates(mesh, "single")
    by_error = sorted(PICTURED_FILTERS, key=lambda name: mesh.filters[name].l2_error)
    by_rate = sorted(PICTURED_FILTERS, key=rates.__getitem__)
    return Finding(by_error == by_rate, f"by error {' < '.join(by_error)}; by rate {' < '.join(by_rate)}")


def _gaussian_fits_power_law_least(mesh: MeshResult) -> Finding:
    gaps = {name: mesh.filters[name].gap for name in PICTURED_FILTERS}
    return Finding(max(gaps, key=gaps.__getitem__) == "gaussian", _listed(gaps, 3) + " (gap of the distributions)")


def _higher_orders_are_robust(mesh: MeshResult) -> Finding:
    if not mesh.noises["zeroth"].reconstructed:  # a mesh of one level has no Diff
        return Finding(False, "no Diff")
    errors = {name: 1e4 * mesh.noises[name].reconstructed[0] for name in PICTURED_FILTERS}
    return Finding(max(errors["degree 1"], errors["degree 3"]) < errors["zeroth"], _listed(errors) + " (rms x 1e4)")


def _low_orders_suffice(mesh: MeshResult) -> Finding:
    rates = [mesh.filters[f"degree {degree}"].schemes["multi"].sizes.rate for degree in DEGREES]
    best = min(rates)
    more = min(rates[:5]) / best - 1
    figures = f"best degree {rates.index(best) + 1}; the best of 1 to 5 takes {more:.1%} more"
    return Finding(more <= SMALL_GAIN, figures)


def _least(mesh: MeshResult, scheme: str, value: Callable[[NormResult], float]) -> dict[str, float]:
    """The norms' values at the largest degree of a scheme."""
    rows = [row for row in mesh.norms if row.scheme == scheme]
    degree = max(row.degree for row in rows)
    return {row.norm: value(row) for row in rows if row.degree == degree}


def _norm_wins(
    scheme: str, winners: tuple[str, ...], value: Callable[[NormResult], float], factor: float, unit: str
) -> Callable[[MeshResult], Finding]:
    def find(mesh: MeshResult) -> Finding:
        values = _least(mesh, scheme, value)
        best = min(values.values())
        holds = any(values[name] <= best * (1 + 1e-6) for name in winners)
        return Finding(holds, _listed({name: factor * value for name, value in values.items()}) + unit)

    return find


SENTENCES = (
    Sentence(
        "5",
        "the Zeroth Order Filter ... has the best compression ratio",
        "multi-resolution: least rate of the four filters",
        _zeroth_compresses_best,
    ),
    Sentence(
        "5",
        "the Zeroth Order Filter ... has the best compression ratio",
        "the same, if Diffs were told in finest steps: least Shannon bound of the four filters",
        _zeroth_compresses_best_in_finest_steps,
    ),
    Sentence(
        "5",
        "[on the sphere] the compression ratio of the Zeroth Order filter ... is the worst of all the filters",
        "multi-resolution: largest rate of the four filters",
        _zeroth_compresses_worst,
    ),
    Sentence(
        "5",
        "the Gaussian filter behaves very poorly",
        "multi-resolution: largest rate of the four filters",
        _gaussian_is_poor,
    ),
    Sentence(
        "5",
        "[the Zeroth Order Filter] is better than the Single Resolution case",
        "rate of multi-resolution against single resolution",
        _zeroth_gains_by_levels,
    ),
    Sentence(
        "5",
        "in the Single Resolution case there is not much difference among the filtering schemes",
        f"largest of the four rates within {SMALL_SPREAD:.0%} of the smallest",
        _single_rates_are_alike,
    ),
    Sentence(
        "5",
        "the higher order filters perform better than the Zeroth Order Filter",
        "single resolution: rates of degrees 1 and 3 below that of zeroth",
        _higher_orders_compress_single,
    ),
    Sentence(
        "5, 6",
        "with respect to the accuracy, the higher order filters give a more accurate approximation",
        "l2 error per vertex of degrees 1 and 3 below that of zeroth",
        _higher_orders_are_accurate,
    ),
    Sentence(
        "5",
        "as smaller the l2-norm error gets, as narrower the p.d.f. and as smaller the rate becomes",
        "single resolution: the four filters in the same order by error and by rate",
        _smaller_error_smaller_rate,
    ),
    Sentence(
        "5",
        "the power-type p.d.f. hypothesis is well satisfied by the Zeroth, LS 1st and LS 3rd ... less by the Gaussian",
        "largest gap between the distribution of the Diffs and the fitted law: Gaussian's is the largest of four",
        _gaussian_fits_power_law_least,
    ),
    Sentence(
        "5",
        "The range [1..5] seems enough",
        f"multi-resolution: best of degrees 1 to 5 within {SMALL_GAIN:.0%} of the best of 1 to 7",
        _low_orders_suffice,
    ),
    Sentence(
        "4.1, 6",
        "for a better accuracy ... the filter coefficients should minimize the l-infinity norm",
        "last Diff lost, single resolution, degree 3: least largest error of a coordinate by the l-infinity fit",
        _norm_wins("single", ("l-infinity, program",), lambda row: row.lost.largest_coordinate, 1e4, " (x 1e4)"),
    ),
    Sentence(
        "4.1, 6",
        "for a better accuracy ... the filter coefficients should minimize the l-infinity norm",
        "the same in multi-resolution, where all fits start from the same, true level 1",
        _norm_wins("multi", ("l-infinity, program",), lambda row: row.lost.largest_coordinate, 1e4, " (x 1e4)"),
    ),
    Sentence(
        "4.2, 6",
        "For robustness ... the filters should minimize the l2-norm of the differences",
        "Diff of the finest level, multi-resolution, degree 3: least energy by the l2 fit",
        _norm_wins("multi", ("l2",), lambda row: row.lost.rms, 1e4, " (rms x 1e4)"),
    ),
    Sentence(
        "5, 6",
        "by paying a small price in the compression ratio, a least-square filter gives ... superior robustness",
        "multi-resolution, all Diffs with noise of their own RMS: error of degrees 1 and 3 below that of zeroth",
        _higher_orders_are_robust,
    ),
    Sentence(
        "4.3, 6",
        "the compression rate is maximized ... [by an] l-alpha norm with alpha usually between 1 and 2",
        "multi-resolution, degree 3: least rate by one of the fits with p in [1, 2]",
        _norm_wins(
            "multi",
            ("l1, program", "l1.001, reweighted", "l1.5, reweighted", "l2"),
            lambda row: row.rate,
            1.0,
            " (bits/vertex)",
        ),
    ),
)
"""In the order of the sections; what is said of one mesh is tested on all."""
