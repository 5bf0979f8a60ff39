"""One filter on one mesh, in the two schemes of section 5, with and without the last Diff: what every table is made of.

``multi`` is the basic algorithm (section 3.1), ``single`` the variable length algorithm with S = nL (section 3.2):
only the finest level sends a Diff. Errors are those of the finest level where its Diff is lost (section 4.1), in units
of the cube that holds the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic.encoder import ClassicEncoding
from meshtide_codec.classic.geometry_bytes import GeometryBytes, geometry_bytes
from meshtide_codec.classic.hierarchy import cell_centres
from meshtide_codec.distortion import DistortionMeter
from meshtide_codec.quantize import grid_steps
from meshtide_codec.statistics import (
    fit_power_law,
    l2_error_per_vertex,
    power_law_gap,
    rate_model,
    shannon_bound_bits,
)
from meshtide_lab.link.fidelity import vertex_errors

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.filters import FilterSpec
    from meshtide_codec.quantize import QuantizedMesh

SCHEMES = ("multi", "single")
SINGLE_RESOLUTION = 99  # any S from the number of levels on
DISTANCE_SAMPLES = 4_000


@dataclass(frozen=True, slots=True)
class LostDiff:
    """Errors of the finest level when its Diff does not come.

    Args:
        mean: l1: mean size of a coordinate's error.
        rms: l2: root of the mean squared error of a coordinate.
        largest_coordinate: l-infinity, as eq. (17) minimises it for each coordinate.
        largest_vertex: the farthest that a vertex is from its true place.
    """

    mean: float
    rms: float
    largest_coordinate: float
    largest_vertex: float


@dataclass(frozen=True, slots=True)
class SurfaceDistance:
    """Distance of the predicted surface from the true one, as shares of the diagonal of its box."""

    rms: float
    hausdorff: float


@dataclass(frozen=True, slots=True)
class SchemeResult:
    """One filter in one scheme.

    Args:
        sizes: of the geometry.
        shannon_rate: bits per vertex that an order-0 coder with one model a level and coordinate needs for the Diffs.
        fine_shannon_rate: the same, were each level's Diffs given in finest steps instead of cells of its own grid.
        lost: errors without the finest level's Diff.
    """

    sizes: GeometryBytes
    shannon_rate: float
    fine_shannon_rate: float
    lost: LostDiff


@dataclass(frozen=True, slots=True)
class Arrays:
    """What pictures and histograms of the single resolution are made of.

    Args:
        differences: (n, 3) int64, the finest level's Diff in finest steps.
        prediction: (n, 3) float64, the finest level without it, in finest steps.
    """

    differences: NDArray[np.int64]
    prediction: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FilterResult:
    """One filter on one mesh; what is not listed by scheme is of the single resolution's Diff.

    Args:
        name: of the filter.
        schemes: results by scheme.
        l2_error: l2 norm of the Diff divided by the number of vertices, in units of the cube, as in the tables.
        alpha: exponent of the power law fitted to it.
        a: its inverse scale, in 1 / steps^alpha.
        gap: largest gap between the distributions of the Diff and of the law.
        modelled_rate: bits per vertex of the Diff by eq. (21).
        surface: distance of the predicted surface.
        arrays: None where they were not asked for.
    """

    name: str
    schemes: dict[str, SchemeResult]
    l2_error: float
    alpha: float
    a: float
    gap: float
    modelled_rate: float
    surface: SurfaceDistance
    arrays: Arrays | None


def run_filter(
    quantized: QuantizedMesh, options: ClassicOptions, name: str, spec: FilterSpec, *, keep_arrays: bool = False
) -> FilterResult:
    """All that tables and pictures need of one filter.

    Args:
        quantized: the mesh.
        options: of the hierarchy; filter and scheme are set here.
        name: what to call the filter.
        spec: the filter.
        keep_arrays: whether the result holds the arrays too.
    """
    multi, _ = run_scheme(quantized, replace(options, filter=spec), "multi")
    single, arrays = run_scheme(quantized, replace(options, filter=spec), "single")
    law = fit_power_law(arrays.differences)
    meter = DistortionMeter(quantized.positions.astype(np.float64), quantized.faces, samples=DISTANCE_SAMPLES)
    distance = meter.measure(arrays.prediction, quantized.faces)
    return FilterResult(
        name=name,
        schemes={"multi": multi, "single": single},
        l2_error=l2_error_per_vertex(arrays.differences, 1 / grid_steps(quantized.bits)),
        alpha=law.alpha,
        a=law.a,
        gap=power_law_gap(arrays.differences, law),
        modelled_rate=3 * rate_model(arrays.differences, law.alpha),
        surface=SurfaceDistance(distance.rms, distance.maximum),
        arrays=arrays if keep_arrays else None,
    )


def run_scheme(quantized: QuantizedMesh, options: ClassicOptions, scheme: str) -> tuple[SchemeResult, Arrays]:
    """One filter in one scheme; `options` name the filter."""
    variable_from = SINGLE_RESOLUTION if scheme == "single" else None
    encoding = ClassicEncoding(quantized, replace(options, variable_from=variable_from))
    true = quantized.positions.astype(np.float64)
    prediction = encoding.predictions.get(0, true)
    result = SchemeResult(
        sizes=geometry_bytes(encoding, quantized.bits),
        shannon_rate=_shannon_rate(encoding.differences.values(), len(true)),
        fine_shannon_rate=_shannon_rate(_fine_differences(encoding), len(true)),
        lost=lost_diff(true, prediction, grid_steps(quantized.bits)),
    )
    return result, Arrays(encoding.differences.get(0, np.zeros(true.shape, np.int64)), prediction)


def _fine_differences(encoding: ClassicEncoding) -> Iterator[NDArray[np.int64]]:
    for number in encoding.differences:
        level = encoding.levels[number]
        yield np.rint(cell_centres(level.cells, level.shift) - encoding.predictions[number]).astype(np.int64)


def _shannon_rate(differences: Iterable[NDArray[np.int64]], vertices: int) -> float:
    return sum(shannon_bound_bits(each) for each in differences) / vertices


def lost_diff(true: NDArray[np.float64], prediction: NDArray[np.float64], steps: int) -> LostDiff:
    """The errors of a prediction (n, 3) in a cube of so many steps.

    >>> lost_diff(np.zeros((2, 3)), np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 0.0]]), 2).largest_vertex
    2.5
    """
    errors = vertex_errors(true, prediction, unit=steps)
    differences = prediction - true
    return LostDiff(
        mean=float(np.abs(differences).mean()) / steps,
        rms=errors.rms,
        largest_coordinate=errors.l_infinity,
        largest_vertex=float(np.sqrt(np.square(differences).sum(axis=1).max())) / steps,
    )
