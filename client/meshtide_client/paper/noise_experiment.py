"""Robustness as section 4.2 defines it: every Diff is perturbed by noise of its own size, and the error is looked at.

Each level's Diff gets Gaussian noise whose root mean square, coordinate by coordinate, is that of the Diff; what comes
out is decoded as it is, so that a level extends what the noise left of the coarser one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic.encoder import ClassicEncoding
from meshtide_codec.classic.level_coding import encode_diff
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import describe
from meshtide_codec.quantize import grid_steps
from meshtide_codec.stream.packets import Packet, PacketKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.filters import FilterSpec
    from meshtide_codec.quantize import QuantizedMesh

SEED = 2000


@dataclass(frozen=True, slots=True)
class NoiseResult:
    """Root mean squares of a coordinate in units of the cube, finest level first.

    Args:
        name: of the filter.
        differences: of each level's Diff.
        injected: of the noise added to it, which is rounded to steps of the level.
        reconstructed: of each level's error after decoding.
    """

    name: str
    differences: tuple[float, ...]
    injected: tuple[float, ...]
    reconstructed: tuple[float, ...]


def run_noise(quantized: QuantizedMesh, options: ClassicOptions, name: str, spec: FilterSpec) -> NoiseResult:
    """The multi-resolution scheme with one filter, all Diffs perturbed; the same noise generator for every filter."""
    encoding = ClassicEncoding(quantized, replace(options, filter=spec))
    described = describe(encoding, quantized)
    generator = np.random.Generator(np.random.PCG64(SEED))
    noises = {level: _noise(encoding.differences[level], generator) for level in sorted(encoding.differences)}
    decoder = Decoder(described.header)
    for packet in described.packets:
        decoder.push(_perturbed(packet, encoding, noises))
    unit = 1 / grid_steps(quantized.bits)
    scale = quantized.extent or 1.0
    differences, injected, reconstructed = [], [], []
    for level, noise in noises.items():
        step = unit * (1 << encoding.levels[level].shift)
        true = encoding.geometry[level] * unit
        shown = (decoder.mesh(level).vertices - quantized.origin) / scale
        differences.append(_root_mean_square(encoding.differences[level]) * step)
        injected.append(_root_mean_square(noise) * step)
        reconstructed.append(_root_mean_square(shown - true))
    return NoiseResult(name, tuple(differences), tuple(injected), tuple(reconstructed))


def _noise(differences: NDArray[np.int64], generator: np.random.Generator) -> NDArray[np.int64]:
    size = np.sqrt((differences.astype(np.float64) ** 2).mean(axis=0))
    noise: NDArray[np.int64] = np.rint(generator.standard_normal(differences.shape) * size).astype(np.int64)
    return noise


def _perturbed(packet: Packet, encoding: ClassicEncoding, noises: dict[int, NDArray[np.int64]]) -> Packet:
    if packet.kind is not PacketKind.DIFF:
        return packet
    payload = encode_diff(encoding.differences[packet.level] + noises[packet.level])
    return replace(packet, payload=payload)


def _root_mean_square(values: NDArray[np.float64] | NDArray[np.int64]) -> float:
    return float(np.sqrt((values.astype(np.float64) ** 2).mean()))
