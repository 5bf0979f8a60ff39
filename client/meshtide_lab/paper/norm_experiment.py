"""The norms of section 4 against each other: filters of one degree, fitted in l1, l2, l-infinity and between.

l1 and l-infinity are solved as the linear programs (22) and (18); l_p with p between 1 and 2 by reweighting, and at
p = 1.001 so is as good as l1, which shows what the program gains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from meshtide_codec.filters import FilterSpec
from meshtide_lab.paper.experiment import SCHEMES, LostDiff, run_scheme

if TYPE_CHECKING:
    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.quantize import QuantizedMesh

NORMS = {
    "l1, program": 1.0,
    "l1.001, reweighted": 1.001,
    "l1.5, reweighted": 1.5,
    "l2": 2.0,
    "l-infinity, program": math.inf,
}
"""p by the name of the norm and of the way it is minimised."""

NORM_DEGREES = (1, 3)


@dataclass(frozen=True, slots=True)
class NormResult:
    """One norm in one scheme.

    Args:
        degree: of the filter.
        norm: a name in `NORMS`.
        scheme: ``multi`` or ``single``.
        lost: errors without the finest level's Diff.
        total: bytes of the geometry.
        rate: bits per vertex.
        shannon_rate: bits per vertex that an order-0 coder needs for the Diffs at least.
    """

    degree: int
    norm: str
    scheme: str
    lost: LostDiff
    total: int
    rate: float
    shannon_rate: float


def run_norm(quantized: QuantizedMesh, options: ClassicOptions, degree: int, norm: str) -> list[NormResult]:
    """A filter of `degree` fitted in the norm of that name, in each scheme."""
    chosen = replace(options, filter=FilterSpec("polynomial", degree=degree, norm=NORMS[norm]))
    results = []
    for scheme in SCHEMES:
        found, _ = run_scheme(quantized, chosen, scheme)
        results.append(
            NormResult(degree, norm, scheme, found.lost, found.sizes.total, found.sizes.rate, found.shannon_rate)
        )
    return results
