"""Write meshes as the program that trains the native core reads them, quantized to 12 bits.

    python -m meshtide_lab.training.samples FOLDER MESH...

`make core-train` runs it. The files' names become the samples' names, which codec/core/bench/training.cpp lists; their
layout (int32) is described in codec/core/bench/layers.hpp.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from meshtide_codec.compact.mirror import find_mirror
from meshtide_codec.mesh_files import load_mesh
from meshtide_codec.quantize import quantize

BITS = 12


def write_sample(path: Path, folder: Path) -> None:
    """One mesh, with its plane of symmetry."""
    quantized = quantize(load_mesh(path), BITS)
    mirror = find_mirror(quantized.positions, BITS)
    plane = (-1, 0) if mirror is None else (mirror.axis, mirror.coordinate_sum)
    head = (len(quantized.positions), len(quantized.faces), BITS, *plane)
    parts = [np.array(head), quantized.positions.ravel(), quantized.faces.ravel()]
    np.concatenate(parts).astype("<i4").tofile(folder / f"{path.stem}.mesh")


def main(paths: list[str]) -> None:
    """Write one file for each mesh."""
    folder = Path(paths[0])
    folder.mkdir(parents=True, exist_ok=True)
    for path in map(Path, paths[1:]):
        write_sample(path, folder)


if __name__ == "__main__":
    main(sys.argv[1:])
