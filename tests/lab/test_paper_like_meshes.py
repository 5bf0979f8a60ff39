from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.quantize import quantize
from meshtide_lab.paper.like_meshes import LIKE_MESHES
from meshtide_lab.paper.mesh_result import regularity
from meshtide_lab.paper.published import published


@pytest.mark.parametrize("name", sorted(LIKE_MESHES))
def test_they_are_of_the_papers_kind(name: str) -> None:
    mesh = LIKE_MESHES[name]()
    printed = published().meshes[name.replace("-", " ")]
    assert len(mesh.vertices) == pytest.approx(printed.vertices, rel=0.15)
    assert not regularity(quantize(mesh, 10)).is_even
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert (areas > 0).all()


@pytest.mark.parametrize("name", sorted(LIKE_MESHES))
def test_they_are_the_same_each_time(name: str) -> None:
    one, other = LIKE_MESHES[name](), LIKE_MESHES[name]()
    np.testing.assert_array_equal(one.vertices, other.vertices)
    np.testing.assert_array_equal(one.faces, other.faces)
