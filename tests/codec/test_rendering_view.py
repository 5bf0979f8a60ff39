from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import OptionError
from meshtide_codec.mesh import Mesh
from meshtide_codec.rendering.view import MARGIN, Framing, View
from meshtide_codec.testing import grid, random_meshes, shapes

angles = st.floats(-720, 720)


@given(angles, angles)
def test_turning_keeps_lengths(turn: float, tilt: float) -> None:
    points = np.random.default_rng(0).normal(size=(20, 3))
    turned = View(turn, tilt).turned(points)
    np.testing.assert_allclose(turned @ turned.T, points @ points.T, atol=1e-12)


@given(random_meshes(), angles, angles)
def test_a_mesh_fills_its_frame_and_no_more(mesh: Mesh, turn: float, tilt: float) -> None:
    size = 100
    points = Framing.fitting(mesh, View(turn, tilt)).pixels(mesh.vertices, size)
    low, high = points.min(axis=0)[:2], points.max(axis=0)[:2]
    assert (low >= size * MARGIN - 1e-6).all()
    assert (high <= size * (1 - MARGIN) + 1e-6).all()
    np.testing.assert_allclose(low + high, size, atol=1e-6)


def test_up_is_up_and_near_is_near() -> None:
    mesh = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [])
    origin, right, up, near = Framing.fitting(mesh, View(0, 0)).pixels(mesh.vertices, 100)
    assert right[0] > origin[0]
    assert up[1] < origin[1]
    assert near[2] > origin[2]


@pytest.mark.parametrize("scale", [1e300, 1e-300])
def test_extreme_units_can_be_framed(scale: float) -> None:
    mesh = Mesh.checked(grid(5).vertices * scale, grid(5).faces)
    points = Framing.fitting(mesh).pixels(mesh.vertices, 100)
    np.testing.assert_allclose(points, Framing.fitting(grid(5)).pixels(grid(5).vertices, 100), atol=1e-9)


def test_a_point_has_a_frame() -> None:
    mesh = shapes()["point"]()
    np.testing.assert_array_equal(Framing.fitting(mesh).pixels(mesh.vertices, 60), [[30, 30, 0]])


@pytest.mark.parametrize("view", [(math.nan, 0.0), (0.0, math.inf)])
def test_angles_must_be_finite(view: tuple[float, float]) -> None:
    with pytest.raises(OptionError, match="finite"):
        View(*view)
