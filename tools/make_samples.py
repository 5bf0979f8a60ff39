"""Make the sample meshes that ship with the package from their original files.

Usage: python tools/make_samples.py spot.obj stanford-bunny.obj

Coordinates are kept as float32 and indices as int32, one row per coordinate, which compresses better; compare
`meshtide_codec.samples`, which reads them. The files' names become the samples' names.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from meshtide_codec.mesh_files import load_mesh

SAMPLES = Path(__file__).parent.parent / "codec" / "meshtide_codec" / "samples"


def main(paths: list[str]) -> None:
    """Write one archive per mesh file."""
    for path in map(Path, paths):
        mesh = load_mesh(path)
        target = SAMPLES / f"{path.stem}.npz"
        np.savez_compressed(target, vertices=mesh.vertices.T.astype(np.float32), faces=mesh.faces.T.astype(np.int32))
        print(f"{target.name}: {mesh}, {target.stat().st_size} bytes")


if __name__ == "__main__":
    main(sys.argv[1:])
