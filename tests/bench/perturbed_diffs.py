"""Robustness as in section 4.2 of the paper: all Diffs perturbed by noise of their own size, both profiles.

    python tests/bench/perturbed_diffs.py [SAMPLE]

Prints, per level, the root mean square of a coordinate in units of the cube: of the Diffs, of the noise added to them,
and of the error after decoding; and how far compact vertices went inside their leaf cells.
"""

from __future__ import annotations

import sys

import numpy as np

from meshtide_codec.classic.options import ClassicHeader, ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.quantize import grid_steps
from meshtide_codec.samples import load_sample
from meshtide_lab.link.fidelity import StreamMeter
from meshtide_lab.link.lossy_link import LossyLink

NOISES = ("gaussian", "uniform", "laplace")
SEED = 1
COLUMNS = ("stream", "noise", "level", "Diffs", "injected", "reconstructed", "reconstructed / injected")


def perturbed(encoded: EncodedMesh, kind: str) -> tuple[Decoder, dict[int, list[tuple[float, float, int]]]]:
    """A decoder whose Diffs were all perturbed; per level, sums of squares of Diffs and noise in cube units."""
    fates = LossyLink.parse(f"noise:kind={kind},relative=1", SEED).plan(encoded.header)
    noises = {(fate.entry.level, fate.entry.slice): fate.noises for fate in fates if fate.noises}
    told: dict[int, list[tuple[float, float, int]]] = {}

    def perturb(level: int, part: int, differences: np.ndarray) -> np.ndarray:
        (noise,) = noises[level, part]
        changed = noise(differences)
        unit = 2 ** level_shift(encoded, level) / grid_steps(encoded.header.bits)
        squares = [float(np.square(values * unit).sum()) for values in (differences, changed - differences)]
        told.setdefault(level, []).append((squares[0], squares[1], differences.size))
        return changed

    decoder = Decoder(encoded.header, perturb=perturb)
    for packet in encoded.packets:
        decoder.push(packet)
    return decoder, told


def level_shift(encoded: EncodedMesh, level: int) -> int:
    """Bits per coordinate that a level has dropped."""
    options = encoded.header.options
    return options.shifts[level] if isinstance(options, ClassicHeader) else level


def print_rows(name: str, encoded: EncodedMesh) -> None:
    """The rows of one stream."""
    meter = StreamMeter(encoded.header, encoded.packets)
    for kind in NOISES:
        decoder, told = perturbed(encoded, kind)
        errors = {row.level: row.vertex.rms for row in meter.measure(decoder, surfaces=False).levels}
        for level in sorted(told, reverse=True):
            count = sum(size for _, _, size in told[level])
            diffs, noise = (np.sqrt(sum(row[i] for row in told[level]) / max(count, 1)) for i in (0, 1))
            cells = (name, kind, level, f"{diffs:.2e}", f"{noise:.2e}", f"{errors[level]:.2e}")
            print(f"| {' | '.join(map(str, cells))} | {errors[level] / noise:.2f} |")
        if name.startswith("compact"):
            print(
                f"| {name} | {kind} | 0 | half leaf cells from the middle, at most: {farthest(encoded, decoder):.3f} |"
            )


def leaf_shifts(positions: np.ndarray) -> np.ndarray:
    """(n,) int: bits per coordinate that the cell of each vertex leaves open; no other vertex is in it."""
    differing = np.bitwise_or.reduce(positions[1:] ^ positions[:-1], axis=1)
    parted = np.frexp(differing)[1] - 1  # the highest bit in which neighbours in Morton order differ
    shifts: np.ndarray = np.minimum(np.append(parted, 99), np.insert(parted, 0, 99))
    return shifts


def farthest(encoded: EncodedMesh, decoder: Decoder) -> float:
    """The largest offset from the middle of a leaf cell, in halves of its side: at most 1 means inside."""
    header = encoded.header
    shifts = leaf_shifts(encoded.quantized.positions)[:, None]
    sides = 2.0**shifts
    positions = (decoder.mesh(0).vertices - header.origin) / header.extent * grid_steps(header.bits)
    middles = (encoded.quantized.positions >> shifts) * sides + sides / 2 - 0.5
    return float((np.abs(positions - middles) / (sides / 2)).max())


def main() -> None:
    """Print the table."""
    mesh = load_sample(sys.argv[1] if len(sys.argv) > 1 else "spot")
    print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}")
    print_rows("classic degree 3", encode(mesh, ClassicOptions()))
    print_rows("compact", encode(mesh, CompactOptions()))


if __name__ == "__main__":
    main()
