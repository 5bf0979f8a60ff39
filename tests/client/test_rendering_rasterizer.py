from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshes import grid, random_meshes, shapes, tetrahedron
from meshtide_client.rendering import raster_kernels
from meshtide_client.rendering.rasterizer import LARGEST_SIZE, PAPER, render
from meshtide_client.rendering.view import MARGIN, Frame, View
from meshtide_codec.errors import OptionError
from meshtide_codec.mesh import Mesh
from meshtide_codec.sphere import paper_sphere

FRONT = View(0, 0)


def owners(points: np.ndarray, faces: np.ndarray, side: int) -> np.ndarray:
    """Which face each of side x side pixels shows."""
    depths, shown = np.full((side, side), -np.inf), np.full((side, side), -1, np.int32)
    raster_kernels.draw_faces(points, faces, depths, shown, np.zeros((side, side, 2)))
    return shown


def facing(depths: tuple[float, ...], side: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles, one behind the other, that cover the upper left half of a square of pixels."""
    corner = np.array([[0.0, 0.0], [0.0, float(side)], [float(side), 0.0]])
    points = [np.column_stack([corner, np.full(3, depth)]) for depth in depths]
    return np.concatenate(points), np.arange(3 * len(depths)).reshape(-1, 3)


@pytest.mark.parametrize("depths", [(1.0, 2.0, 3.0), (3.0, 2.0, 1.0), (1.0, 3.0, 2.0)])
def test_the_nearest_face_hides_the_others(depths: tuple[float, ...]) -> None:
    y, x = np.mgrid[:16, :16] + 0.5
    np.testing.assert_array_equal(owners(*facing(depths, 16), 16), np.where(x + y <= 16, int(np.argmax(depths)), -1))


def test_of_equal_faces_the_first_is_shown() -> None:
    assert set(owners(*facing((2.0, 2.0), 16), 16).ravel()) == {-1, 0}


def test_faces_that_cross_hide_each_other_in_part() -> None:
    points, faces = facing((0.0, 0.0), 16)
    points[:3, 2] = [0.0, 0.0, 16.0]  # rises to the right
    points[3:, 2] = 5.0
    assert owners(points, faces, 16)[0].tolist() == [1] * 5 + [0] * 11


def test_faces_out_of_the_picture_and_without_area_are_skipped() -> None:
    points = np.array([[-50.0, -50, 0], [-40, -50, 0], [-50, -40, 0], [2, 2, 0], [5, 5, 0], [9, 9, 0]])
    points = np.concatenate([points, points[:3] + 1e12])
    assert (owners(points, np.array([[0, 1, 2], [3, 4, 5], [6, 7, 8]]), 16) == -1).all()


@given(st.integers(0, 2**32 - 1))
def test_no_pixel_falls_between_faces_that_share_an_edge(seed: int) -> None:
    rng = np.random.default_rng(seed)
    side = 32
    u, v = np.meshgrid(np.arange(9.0), np.arange(9.0), indexing="ij")
    jitter = rng.uniform(-0.3, 0.3, (2, 9, 9))
    jitter[:, [0, -1]] = jitter[:, :, [0, -1]] = 0.0
    points = np.stack([(u + jitter[0]) * 4, (v + jitter[1]) * 4, rng.random((9, 9))], axis=-1).reshape(-1, 3)
    faces = grid(9).faces
    assert (owners(points, faces[rng.permutation(len(faces))], side) >= 0).all()


def test_the_silhouette_of_a_sphere_is_a_disc() -> None:
    sphere, size = paper_sphere(4), 200
    drawn = (render(sphere, Frame.fitting(sphere, FRONT), size) != PAPER).any(axis=2)
    y, x = np.mgrid[:size, :size] + 0.5
    radius = size * (1 - 2 * MARGIN) / 2
    distance = np.hypot(x - size / 2, y - size / 2)
    assert drawn[distance < radius - 2].all()
    assert not drawn[distance > radius + 1].any()


def test_surfaces_turned_to_the_light_are_brighter() -> None:
    sphere, size = paper_sphere(3), 100
    image = render(sphere, Frame.fitting(sphere, FRONT), size, smooth=True).astype(int).sum(axis=2)
    towards, away = image[30, 65], image[75, 25]  # the light comes from the upper right
    assert towards > 1.3 * away


@pytest.mark.parametrize("smooth", [False, True])
def test_orientation_does_not_matter(smooth: bool) -> None:
    mesh = tetrahedron()
    frame = Frame.fitting(mesh)
    turned = Mesh(mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1]))
    one, other = (render(each, frame, 80, smooth=smooth).astype(int) for each in (mesh, turned))
    assert np.abs(one - other).max() <= 1


def test_colours_of_vertices_are_blended() -> None:
    square = Mesh.checked([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    colours = np.array([[200.0, 0, 0], [0, 200, 0], [0, 200, 0], [200, 0, 0]])
    image = render(square, Frame.fitting(square, FRONT), 100, colours=colours).astype(int)
    row = image[50, 8:92]
    assert (np.diff(row[:, 0]) <= 0).all()
    assert (np.diff(row[:, 1]) >= 0).all()
    assert row[0, 0] > 10 * row[0, 1]
    assert row[-1, 1] > 10 * row[-1, 0]
    assert (row[:, 2] == 0).all()


def test_edges_are_lines() -> None:
    square = Mesh.checked([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    frame = Frame.fitting(square, FRONT)
    plain, lined = render(square, frame, 100), render(square, frame, 100, edges=True)
    changed = (plain != lined).any(axis=2)
    assert changed[10:90, 10:90][::-1].diagonal().all()
    assert not changed[30:35, 30:35].any()
    assert (lined[changed].sum(axis=1) < plain[changed].astype(int).sum(axis=1)).all()


def test_smooth_shading_hides_the_faces() -> None:
    sphere = paper_sphere(2)
    frame = Frame.fitting(sphere, FRONT)
    shades = [len(np.unique(render(sphere, frame, 100, smooth=smooth)[30:70, 30:70, 0])) for smooth in (False, True)]
    assert shades[1] > shades[0]


def test_a_mesh_without_faces_is_drawn_as_dots() -> None:
    points = Mesh.checked([[0, 0, 0], [1, 1, 0]], [])
    drawn = (render(points, Frame.fitting(points, FRONT), 100) != PAPER).any(axis=2)
    assert drawn[94, 6]
    assert drawn[6, 94]
    assert 2 <= drawn.sum() < 40


@given(random_meshes())
def test_any_mesh_can_be_drawn_and_twice_the_same(mesh: Mesh) -> None:
    frame = Frame.fitting(mesh)
    one, other = (render(mesh, frame, 24, smooth=True, edges=True) for _ in range(2))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("size", [0, LARGEST_SIZE + 1])
def test_sizes_have_limits(size: int) -> None:
    mesh = tetrahedron()
    with pytest.raises(OptionError, match="pixels"):
        render(mesh, Frame.fitting(mesh), size)


def test_every_vertex_needs_a_colour() -> None:
    mesh = shapes()["triangle"]()
    with pytest.raises(OptionError, match="colours"):
        render(mesh, Frame.fitting(mesh), 10, colours=np.zeros((2, 3)))
