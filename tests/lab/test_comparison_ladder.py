from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.distortion import DistortionMeter
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import QuantizedMesh, quantize
from meshtide_codec.testing import grid, tetrahedron
from meshtide_lab.comparison.draco import draco_encoded
from meshtide_lab.comparison.ladder import MOST_OF_TARGET, LadderLevels

pytest.importorskip("DracoPy", reason="Draco comes with the extra bench")
pytest.importorskip("fast_simplification", reason="it comes with the extra bench")


def prepared(mesh: Mesh) -> tuple[LadderLevels, QuantizedMesh, bytes]:
    quantized = quantize(mesh, 12)
    meter = DistortionMeter(quantized.positions.astype(np.float64), quantized.faces, samples=500)
    return LadderLevels(quantized, meter), quantized, draco_encoded(mesh.vertices, mesh.faces, 12)


def test_a_ladder_climbs_to_the_mesh_itself() -> None:
    levels, quantized, whole = prepared(grid(40))
    ladder = levels.climbed(whole, fitted_steps=False)
    assert [state.name for state in ladder] == ["1/256", "1/64", "1/16", "1/4", "1"]
    for state, ratio in zip(ladder, (256, 64, 16, 4, 1), strict=True):
        assert state.vertices <= MOST_OF_TARGET * len(quantized.positions) / ratio
    assert [state.size for state in ladder] == sorted({state.size for state in ladder})
    assert [state.rms for state in ladder] == sorted((state.rms for state in ladder), reverse=True)
    assert ladder[-1].size - ladder[-2].size == len(whole)
    assert ladder[-1].rms < 1e-4


def test_fitted_steps_take_fewer_bytes_for_about_the_same_distance() -> None:
    levels, _, whole = prepared(grid(40))
    same, fitted = (levels.climbed(whole, fitted_steps=steps) for steps in (False, True))
    assert fitted[-1].size < same[-1].size
    for coarse, other in zip(same, fitted, strict=True):
        assert other.rms <= 1.1 * coarse.rms
        assert other.size <= coarse.size


def test_a_mesh_too_small_for_levels_has_only_itself() -> None:
    levels, _, whole = prepared(tetrahedron())
    assert [(state.name, state.size) for state in levels.climbed(whole, fitted_steps=True)] == [("1", len(whole))]
