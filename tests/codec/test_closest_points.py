"""Closest points: against plain distances of every triangle, degenerate triangles, samples, hostile arrays."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings

from meshtide_codec.closest_points import TriangleTree
from meshtide_codec.errors import MeshError
from meshtide_codec.mesh import Mesh
from meshtide_codec.testing import grid, random_meshes, shapes

Points = npt.NDArray[np.float64]

NO_FACES = np.zeros((0, 3), np.int64)


def to_segment(points: Points, start: Points, end: Points) -> Points:
    along = end - start
    length = along @ along
    place = np.clip((points - start) @ along / length, 0, 1) if length > 0 else np.zeros(len(points))
    distances: Points = np.linalg.norm(points - start - place[:, None] * along, axis=1)
    return distances


def to_triangle(points: Points, corners: Points) -> Points:
    """Distances by another way than the kernel's: the plane where its foot is inside, or else the sides."""
    a, b, c = corners
    distances = np.minimum(np.minimum(to_segment(points, a, b), to_segment(points, b, c)), to_segment(points, c, a))
    normal = np.cross(b - a, c - a)
    if np.linalg.norm(normal) > 1e-9 * max(np.linalg.norm(b - a), np.linalg.norm(c - a)) ** 2:
        normal /= np.linalg.norm(normal)
        heights = (points - a) @ normal
        feet = points - heights[:, None] * normal
        inside = np.ones(len(points), bool)
        for start, end in ((a, b), (b, c), (c, a)):
            inside &= np.cross(end - start, feet - start) @ normal >= 0
        distances = np.where(inside, np.minimum(distances, np.abs(heights)), distances)
    return distances


def plain_distances(points: Points, mesh: Mesh) -> Points:
    faces = mesh.faces if len(mesh.faces) else np.repeat(np.arange(len(mesh.vertices)), 3).reshape(-1, 3)
    distances: Points = np.min([to_triangle(points, mesh.vertices[face]) for face in faces], axis=0)
    return distances


@settings(deadline=None, max_examples=60)
@given(random_meshes(20))
def test_nothing_is_closer_than_what_is_found(mesh: Mesh) -> None:
    rng = np.random.default_rng(len(mesh.faces))
    size = max(mesh.diagonal, 1e-30)
    points = rng.normal(size=(30, 3)) * size + mesh.vertices.mean(axis=0)
    tree = TriangleTree(mesh.vertices, mesh.faces)
    found = tree.closest(points)
    distances = np.linalg.norm(points - found.points, axis=1)
    assert distances == pytest.approx(plain_distances(points, mesh), rel=1e-6, abs=1e-9 * size)
    assert (found.weights >= 0).all()
    assert found.weights.sum(axis=1) == pytest.approx(1)
    corners = mesh.vertices[found.corners]
    assert (corners * found.weights[:, :, None]).sum(axis=1) == pytest.approx(found.points, abs=1e-9 * size)


@pytest.mark.parametrize("name", shapes())
def test_points_of_the_mesh_are_on_it(name: str) -> None:
    mesh = shapes()[name]()
    tree = TriangleTree(mesh.vertices, mesh.faces)
    samples = tree.samples(200, seed=4)
    found = np.concatenate([tree.closest(samples.points).points, tree.closest(mesh.vertices).points])
    wanted = np.concatenate([samples.points, mesh.vertices])
    on_faces = np.r_[np.ones(200, bool), np.isin(np.arange(len(mesh.vertices)), mesh.faces) | (len(mesh.faces) == 0)]
    assert np.linalg.norm(found - wanted, axis=1)[on_faces].max() <= 1e-10 * max(mesh.diagonal, 1)


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_thin_triangles_of_any_size_have_right_distances(scale: float) -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1e-13, 0], [0, 5, 0]]) * scale
    faces = np.array([[0, 1, 2], [0, 3, 2], [1, 1, 1], [0, 1, 0]])
    points = np.array([[3.0, 0, 0], [0.5, 1, 0], [-1, 0, 0], [1, 0, 2], [1.9, -1, 0]]) * scale
    found = TriangleTree(vertices, faces).closest(points)
    distances = np.linalg.norm(points - found.points, axis=1)
    assert distances == pytest.approx(np.array([1, 1, 1, 2, 1]) * scale, rel=1e-9)


def test_samples_are_spread_by_area_and_repeat_with_their_seed() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [10, 0, 0], [13, 0, 0], [10, 1, 0]])
    tree = TriangleTree(vertices, np.array([[0, 1, 2], [3, 4, 5]]))
    samples = tree.samples(4000, seed=7)
    assert (samples.points[:, 0] < 5).mean() == pytest.approx(1 / 4, abs=0.001)
    right = samples.points[samples.points[:, 0] > 5]
    assert right.mean(axis=0) == pytest.approx([11, 1 / 3, 0], abs=0.02)
    assert (tree.samples(4000, seed=7).points == samples.points).all()
    assert (tree.samples(4000, seed=8).points != samples.points).any()


def test_a_mesh_without_faces_is_its_vertices() -> None:
    points = np.random.default_rng(5).random((40, 3))
    tree = TriangleTree(points, NO_FACES)
    queries = np.random.default_rng(6).random((50, 3))
    distances = np.linalg.norm(queries - tree.closest(queries).points, axis=1)
    assert distances == pytest.approx(np.linalg.norm(queries[:, None] - points, axis=2).min(axis=1))


def test_threads_share_a_tree() -> None:
    mesh = grid(60)
    tree = TriangleTree(mesh.vertices, mesh.faces)
    points = np.random.default_rng(7).random((4, 5000, 3)) * 60
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda some: tree.closest(some).points, points))
    for one, some in zip(found, points, strict=True):
        assert np.array_equal(one, tree.closest(some).points)


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.zeros((0, 3)), NO_FACES, "at least one point"),
        (np.zeros((3, 2)), NO_FACES, r"\(k, 3\)"),
        (np.array([[0, 0, np.nan]]), NO_FACES, "finite"),
        (np.zeros((3, 3)), np.array([[0, 1, 3]]), "face 0 names a vertex outside of 0..2"),
        (np.zeros((3, 3)), np.array([[0, 1, 2], [0, -1, 2]]), "face 1 names"),
        (np.zeros((3, 3)), np.array([0, 1, 2]), r"\(m, 3\)"),
        (np.zeros((3, 3)), np.array([[0, 1, 2**40]]), "face 0 names"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused(vertices: Points, faces: npt.NDArray[np.int64], message: str) -> None:
    with pytest.raises(MeshError, match=message):
        TriangleTree(vertices, faces)


def test_points_to_search_for_must_have_three_finite_coordinates() -> None:
    tree = TriangleTree(np.zeros((1, 3)), NO_FACES)
    with pytest.raises(MeshError, match=r"\(k, 3\)"):
        tree.closest(np.zeros((4, 2)))
    with pytest.raises(MeshError, match="finite"):
        tree.closest(np.array([[0.0, np.inf, 0.0]]))


@pytest.mark.parametrize("exponent", [-1060, -1000, -600, -200, -101, -100, 100, 101, 200, 600, 1000, 1022])
def test_the_unit_of_a_mesh_does_not_matter(exponent: int) -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    faces = np.array([[0, 1, 2], [1, 3, 2]])
    asked = np.array([[0.25, 0.5, 1.5], [1.5, 0.0, 0.0], [-1.0, -1.0, 0.5]])
    near = TriangleTree(square, faces)
    far = TriangleTree(np.ldexp(square, exponent), faces)
    expected, found = near.closest(asked), far.closest(np.ldexp(asked, exponent))
    assert expected.points.tolist() == [[0.25, 0.5, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    np.testing.assert_array_equal(found.points, np.ldexp(expected.points, exponent))
    np.testing.assert_array_equal(found.weights, expected.weights)
    np.testing.assert_array_equal(far.samples(20, 1).points, np.ldexp(near.samples(20, 1).points, exponent))


def test_points_that_are_too_far_away_to_be_measured_are_refused() -> None:
    tree = TriangleTree(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    assert tree.closest(np.array([[1e15, 0.25, 0.0]])).points.tolist() == [[1.0, 0.0, 0.0]]
    for far in (1e16, 1e20, -1e150, 1e300):
        with pytest.raises(MeshError, match=r"point 1 cannot be searched for: it is (\d\.\de\+\d+|inf) times the size"):
            tree.closest(np.array([[0.0, 0.0, 0.0], [0.0, far, 0.0]]))
    tiny = TriangleTree(np.array([[0.0, 0, 0], [1e-300, 0, 0], [0, 1e-300, 0]]), np.array([[0, 1, 2]]))
    with pytest.raises(MeshError, match="point 0 cannot"):
        tiny.closest(np.ones((1, 3)))
