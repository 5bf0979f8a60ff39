from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.encoder import encode
from meshtide_codec.errors import MeshError
from meshtide_codec.mesh import Mesh
from meshtide_codec.testing import grid
from meshtide_lab.comparison import mesh_comparison
from meshtide_lab.comparison.draco import draco_encoded
from meshtide_lab.comparison.mesh_comparison import FITTED_LADDER, LADDER, MESHTIDE, compare_mesh

pytest.importorskip("DracoPy", reason="Draco comes with the extra bench")
pytest.importorskip("fast_simplification", reason="it comes with the extra bench")


def test_all_candidates_are_measured_on_the_same_mesh() -> None:
    mesh = grid(30)
    stages: list[float] = []
    found = compare_mesh("grid", mesh, CompactOptions(bits=10), lambda _stage, fraction: stages.append(fraction))
    assert found.meshtide.size == len(encode(mesh, CompactOptions(bits=10)).to_bytes())
    assert found.whole_size == found.bare_size == len(encode(mesh, CompactOptions(bits=10, previews=())).to_bytes())
    assert found.draco is not None
    assert found.draco.size == len(draco_encoded(mesh.vertices, mesh.faces, 10))
    assert found.ratio == found.whole_size / found.draco.size
    assert found.ratio_with_previews == found.meshtide.size / found.draco.size
    assert found.bits_per_vertex(900) == 8.0
    assert found.exact
    assert list(found.curves) == [MESHTIDE, LADDER, FITTED_LADDER]
    assert found.curves[LADDER][-1].size > found.draco.size
    assert found.problems == []
    assert stages == sorted(stages)


def test_the_classic_profile_has_no_previews() -> None:
    found = compare_mesh("grid", grid(12), ClassicOptions(bits=9, coarsest_vertices=12))
    assert found.bare_size is None
    assert found.whole_size == found.meshtide.size


def test_a_mesh_that_draco_refuses_is_compared_with_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> bytes:
        raise MeshError("Draco cannot encode the mesh: no reason")

    monkeypatch.setattr(mesh_comparison, "draco_encoded", refuse)
    found = compare_mesh("grid", grid(12), CompactOptions(bits=9))
    assert (found.draco, found.ratio, found.ratio_with_previews) == (None, None, None)
    assert found.problems == ["Draco cannot encode the mesh: no reason"]
    assert list(found.curves) == [MESHTIDE]


def test_points_have_no_ladder() -> None:
    points = Mesh.checked(np.random.default_rng(1).random((40, 3)), [])
    found = compare_mesh("points", points, CompactOptions(bits=9))
    assert found.draco is not None
    assert list(found.curves) == [MESHTIDE]
    assert found.problems == ["a mesh without faces has no ladder of levels of detail"]
