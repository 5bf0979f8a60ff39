"""Robustness as section 4.2 defines it: every Diff is perturbed by noise of its own size, and the error is looked at.

The noise is that of a lossy link (`meshtide_lab.link`): Gaussian, its root mean square that of the level's Diff. It
is decoded as it is, so that a level extends what the noise left of the coarser one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic.encoder import ClassicEncoding
from meshtide_codec.encoder import describe
from meshtide_codec.quantize import grid_steps
from meshtide_lab.link.damage import Noise
from meshtide_lab.link.fidelity import vertex_errors
from meshtide_lab.link.lossy_link import LossyLink, receive

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.filters import FilterSpec
    from meshtide_codec.quantize import QuantizedMesh

LINK = LossyLink((Noise(relative=1.0),), seed=2000)
"""The same noise for every filter, but for its size."""


@dataclass(frozen=True, slots=True)
class NoiseResult:
    """Root mean squares of a coordinate in units of the cube, finest level first.

    Args:
        name: of the filter.
        differences: of each level's Diff.
        injected: of the noise added to it.
        reconstructed: of each level's error after decoding.
    """

    name: str
    differences: tuple[float, ...]
    injected: tuple[float, ...]
    reconstructed: tuple[float, ...]


def run_noise(quantized: QuantizedMesh, options: ClassicOptions, name: str, spec: FilterSpec) -> NoiseResult:
    """The multi-resolution scheme with one filter, all Diffs perturbed."""
    encoding = ClassicEncoding(quantized, replace(options, filter=spec))
    described = describe(encoding, quantized)
    decoder = receive(LINK, described.header, described.packets).decoder
    noises = {fate.entry.level: fate.noises for fate in LINK.plan(described.header) if fate.noises}
    unit = 1 / grid_steps(quantized.bits)
    scale = quantized.extent or 1.0
    differences, injected, reconstructed = [], [], []
    for level in sorted(encoding.differences):
        step = unit * (1 << encoding.levels[level].shift)
        sent = encoding.differences[level].astype(np.float64)
        changed = sent
        for noise in noises[level]:
            changed = noise(changed)
        shown = (decoder.mesh(level).vertices - quantized.origin) / scale
        differences.append(_root_mean_square(sent) * step)
        injected.append(_root_mean_square(changed - sent) * step)
        reconstructed.append(vertex_errors(encoding.geometry[level] * unit, shown).rms)
    return NoiseResult(name, tuple(differences), tuple(injected), tuple(reconstructed))


def _root_mean_square(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.square(values).mean()))
