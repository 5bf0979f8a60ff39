from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from meshtide_codec.errors import OptionError
from meshtide_codec.mesh import Mesh
from meshtide_codec.rendering.rasterizer import LARGEST_SIZE, PAPER, render
from meshtide_codec.rendering.view import MARGIN, Framing, View
from meshtide_codec.sphere import paper_sphere
from meshtide_codec.testing import random_meshes, shapes, tetrahedron

FRONT = View(0, 0)


def test_the_silhouette_of_a_sphere_is_a_disc() -> None:
    sphere, size = paper_sphere(4), 200
    drawn = (render(sphere, Framing.fitting(sphere, FRONT), size) != PAPER).any(axis=2)
    y, x = np.mgrid[:size, :size] + 0.5
    radius = size * (1 - 2 * MARGIN) / 2
    distance = np.hypot(x - size / 2, y - size / 2)
    assert drawn[distance < radius - 2].all()
    assert not drawn[distance > radius + 1].any()


def test_surfaces_turned_to_the_light_are_brighter() -> None:
    sphere, size = paper_sphere(3), 100
    image = render(sphere, Framing.fitting(sphere, FRONT), size, smooth=True).astype(int).sum(axis=2)
    towards, away = image[30, 65], image[75, 25]  # the light comes from the upper right
    assert towards > 1.3 * away


@pytest.mark.parametrize("smooth", [False, True])
def test_orientation_does_not_matter(smooth: bool) -> None:
    mesh = tetrahedron()
    frame = Framing.fitting(mesh)
    turned = Mesh(mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1]))
    one, other = (render(each, frame, 80, smooth=smooth).astype(int) for each in (mesh, turned))
    assert np.abs(one - other).max() <= 1


def test_colours_of_vertices_are_blended() -> None:
    square = Mesh.checked([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    colours = np.array([[200.0, 0, 0], [0, 200, 0], [0, 200, 0], [200, 0, 0]])
    image = render(square, Framing.fitting(square, FRONT), 100, colours=colours).astype(int)
    row = image[50, 8:92]
    assert (np.diff(row[:, 0]) <= 0).all()
    assert (np.diff(row[:, 1]) >= 0).all()
    assert row[0, 0] > 10 * row[0, 1]
    assert row[-1, 1] > 10 * row[-1, 0]
    assert (row[:, 2] == 0).all()


def test_edges_are_lines() -> None:
    square = Mesh.checked([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    frame = Framing.fitting(square, FRONT)
    plain, lined = render(square, frame, 100), render(square, frame, 100, edges=True)
    changed = (plain != lined).any(axis=2)
    assert changed[10:90, 10:90][::-1].diagonal().all()
    assert not changed[30:35, 30:35].any()
    assert (lined[changed].sum(axis=1) < plain[changed].astype(int).sum(axis=1)).all()


def test_smooth_shading_hides_the_faces() -> None:
    sphere = paper_sphere(2)
    frame = Framing.fitting(sphere, FRONT)
    shades = [len(np.unique(render(sphere, frame, 100, smooth=smooth)[30:70, 30:70, 0])) for smooth in (False, True)]
    assert shades[1] > shades[0]


def test_a_mesh_without_faces_is_drawn_as_dots() -> None:
    points = Mesh.checked([[0, 0, 0], [1, 1, 0]], [])
    drawn = (render(points, Framing.fitting(points, FRONT), 100) != PAPER).any(axis=2)
    assert drawn[94, 6]
    assert drawn[6, 94]
    assert 2 <= drawn.sum() < 40


@given(random_meshes())
def test_any_mesh_can_be_drawn_and_twice_the_same(mesh: Mesh) -> None:
    frame = Framing.fitting(mesh)
    one, other = (render(mesh, frame, 24, smooth=True, edges=True) for _ in range(2))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("size", [0, LARGEST_SIZE + 1])
def test_sizes_have_limits(size: int) -> None:
    mesh = tetrahedron()
    with pytest.raises(OptionError, match="pixels"):
        render(mesh, Framing.fitting(mesh), size)


def test_every_vertex_needs_a_colour() -> None:
    mesh = shapes()["triangle"]()
    with pytest.raises(OptionError, match="colours"):
        render(mesh, Framing.fitting(mesh), 10, colours=np.zeros((2, 3)))
