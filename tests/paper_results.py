"""Results of small or invented experiments for the tests of the paper's report."""

from __future__ import annotations

from functools import cache

import numpy as np

from meshtide_codec.classic.geometry_bytes import GeometryBytes
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.quantize import quantize
from meshtide_codec.sphere import PAPER_FILTERS
from meshtide_codec.testing import grid
from meshtide_lab.paper.experiment import Arrays, FilterResult, LostDiff, SchemeResult, SurfaceDistance
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS, MeshResult, new_mesh_result
from meshtide_lab.paper.noise_experiment import NoiseResult
from meshtide_lab.paper.norm_experiment import NORMS, NormResult
from meshtide_lab.paper.run import PaperResults

OPTIONS = ClassicOptions(bits=8, coarsest_vertices=30)
RATES = {"zeroth": 14.0, "gaussian": 41.0, "degree 1": 14.7, "degree 3": 14.8}
NORM_FIGURES = {norm: 10.0 + place for place, norm in enumerate(NORMS)}


def invented_filter(name: str, multi: float, single: float, l2_error: float, gap: float = 0.1) -> FilterResult:
    """A filter with these figures; what is not given follows from them."""
    lost = LostDiff(l2_error, l2_error, l2_error, l2_error)
    differences = np.random.default_rng(len(name)).integers(-9, 10, (400, 3))
    return FilterResult(
        name=name,
        schemes={
            scheme: SchemeResult(GeometryBytes(400, 0, 0, round(50 * rate)), rate, rate, lost)
            for scheme, rate in (("multi", multi), ("single", single))
        },
        l2_error=l2_error,
        alpha=1.0,
        a=0.5,
        gap=gap,
        modelled_rate=single,
        surface=SurfaceDistance(l2_error, l2_error),
        arrays=Arrays(differences, np.zeros((400, 3))),
    )


def invented_mesh(
    name: str = "patch",
    multi: dict[str, float] | None = None,
    single: dict[str, float] | None = None,
    errors: dict[str, float] | None = None,
    gaps: dict[str, float] | None = None,
    norms: dict[str, float] | None = None,
    noises: dict[str, float] | None = None,
) -> MeshResult:
    """A patch of 400 vertices with these figures by filter, and every measure of a norm by the norm."""
    mesh = new_mesh_result(name, "invented", quantize(grid(20), OPTIONS.bits), OPTIONS)
    for filter_name in PAPER_FILTERS:
        figures = [
            (chosen or {}).get(filter_name, default)
            for chosen, default in ((multi or RATES, 15.0), (single, 17.0), (errors, 1e-3), (gaps, 0.1))
        ]
        mesh.filters[filter_name] = invented_filter(filter_name, *figures)
    for filter_name in PICTURED_FILTERS:
        error = (noises or {}).get(filter_name, 1e-3)
        mesh.noises[filter_name] = NoiseResult(filter_name, (1e-3, 2e-3), (1e-3, 2e-3), (error, 2e-3))
    for norm, figure in (norms or NORM_FIGURES).items():
        lost = LostDiff(figure, figure, figure, figure)
        mesh.norms.extend(NormResult(3, norm, scheme, lost, 1, figure, figure) for scheme in ("multi", "single"))
    return mesh


@cache
def invented_results() -> PaperResults:
    """Two meshes, one under the name of the paper's sphere, and one that failed."""
    return PaperResults(OPTIONS, [invented_mesh(), invented_mesh("sphere")], {"<broken>": "no vertices"})
