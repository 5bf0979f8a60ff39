from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.errors import MeshError
from meshtide_codec.testing import grid
from meshtide_lab.comparison.draco import draco_decoded, draco_encoded

pytest.importorskip("DracoPy", reason="Draco comes with the extra bench")


def test_a_mesh_comes_back_within_half_a_step() -> None:
    mesh = grid(12)
    vertices, faces = draco_decoded(draco_encoded(mesh.vertices, mesh.faces, 12))
    assert (len(vertices), len(faces)) == (len(mesh.vertices), len(mesh.faces))
    sides = np.ptp(mesh.vertices, axis=0)
    step = sides.max() / (2**12 - 1)
    distances = np.abs(vertices[:, None] - mesh.vertices[None]).max(axis=2).min(axis=1)
    assert distances.max() <= 0.501 * step


def test_fewer_bits_are_fewer_bytes() -> None:
    mesh = grid(12)
    assert len(draco_encoded(mesh.vertices, mesh.faces, 8)) < len(draco_encoded(mesh.vertices, mesh.faces, 12))


def test_a_mesh_without_faces_is_a_point_cloud() -> None:
    mesh = grid(5)
    vertices, faces = draco_decoded(draco_encoded(mesh.vertices, np.zeros((0, 3), np.int64), 10))
    assert len(vertices) == 25
    assert faces.shape == (0, 3)


def test_what_draco_refuses_is_told() -> None:
    with pytest.raises(MeshError, match="Draco cannot encode the mesh: ."):
        draco_encoded(np.zeros((3, 3)), np.array([[0, 1, 2]]), 99)
    with pytest.raises(MeshError, match="Draco cannot decode the mesh: ."):
        draco_decoded(b"no Draco file")
