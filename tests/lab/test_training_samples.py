"""Meshes for the training of the core: what the file holds is the quantized mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.mirror import find_mirror
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.quantize import quantize
from meshtide_codec.testing import grid
from meshtide_lab.training.samples import main

if TYPE_CHECKING:
    from pathlib import Path

BITS = 12


def test_a_file_holds_counts_positions_and_corners(tmp_path: Path) -> None:
    save_mesh(grid(12), tmp_path / "patch.ply")
    main([str(tmp_path / "samples"), str(tmp_path / "patch.ply")])
    numbers = np.fromfile(tmp_path / "samples" / "patch.mesh", "<i4")
    expected = quantize(grid(12), BITS)
    mirror = find_mirror(expected.positions, BITS)
    plane = (-1, 0) if mirror is None else (mirror.axis, mirror.coordinate_sum)
    assert numbers[:5].tolist() == [len(expected.positions), len(expected.faces), BITS, *plane]
    assert np.array_equal(numbers[5:], np.concatenate([expected.positions.ravel(), expected.faces.ravel()]))
