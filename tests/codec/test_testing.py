import importlib
import sys

import numpy as np
import pytest
from hypothesis import given

from meshtide_codec import testing
from meshtide_codec.errors import MeshtideError
from meshtide_codec.mesh import Mesh
from meshtide_codec.testing import grid, random_meshes, shapes, soup


@given(random_meshes(largest=10))
def test_random_meshes_are_small_and_valid(mesh: Mesh) -> None:
    assert 1 <= len(mesh.vertices) <= 10
    assert len(mesh.faces) <= 30
    assert np.isfinite(mesh.vertices).all()
    assert not len(mesh.faces) or 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices)


def test_known_meshes_are_the_same_each_time() -> None:
    for make in (*shapes().values(), lambda: grid(5, seed=3), lambda: soup(10, 20, seed=1)):
        first, second = make(), make()
        assert np.array_equal(first.vertices, second.vertices)
        assert np.array_equal(first.faces, second.faces)


def test_a_missing_hypothesis_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hypothesis", None)
    monkeypatch.delitem(sys.modules, testing.__name__)
    with pytest.raises(MeshtideError, match=r"needs hypothesis: pip install 'meshtide\[testing\]'"):
        importlib.import_module(testing.__name__)
