"""Polygons to triangles: the same area, every corner used, all triangles turned like their polygon."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import polygons
from meshtide_codec.mesh_files.polygons import triangulated


def cut(points: np.ndarray, *sizes: int) -> Mesh:
    """The mesh of polygons whose corners are the points, one after the other."""
    found = triangulated(points, np.array(sizes or [len(points)]), np.arange(len(points)))
    return Mesh.checked(points, found.corners, polygons=found.inner)


def areas(mesh: Mesh, normal: np.ndarray) -> np.ndarray:
    """Signed areas of the triangles, seen along a normal of length one."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a) @ normal / 2


def shoelace(points: np.ndarray) -> float:
    following = np.roll(points, -1, axis=0)
    return float((points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]).sum() / 2)


def rotated(polygon: list[int]) -> list[int]:
    first = polygon.index(min(polygon))
    return polygon[first:] + polygon[:first]


def star(draw: st.DrawFn) -> np.ndarray:
    """A polygon (n, 2), all of which is seen from the origin; concave as a rule."""
    size = draw(st.integers(4, 14))
    radii = draw(st.lists(st.floats(0.2, 3.0), min_size=size, max_size=size))
    steps = np.array(draw(st.lists(st.floats(0.6, 1.4), min_size=size, max_size=size)))
    angles = np.cumsum(steps) * 2 * np.pi / steps.sum()
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) * np.array(radii)[:, None]


def staircase(draw: st.DrawFn) -> np.ndarray:
    """A comb (n, 2) of whole coordinates above the x axis: many corners on straight lines."""
    heights = draw(st.lists(st.integers(1, 5), min_size=1, max_size=7))
    top = [(x + step, height) for x, height in enumerate(heights) for step in (0, 1)]
    bottom = [(x, 0) for x in range(len(heights) + 1)]
    return np.array([*bottom, *top[::-1]], float)


@st.composite
def simple_polygons(draw: st.DrawFn) -> np.ndarray:
    """Simple polygons (n, 2), counter-clockwise, with corners on straight lines, begun at any corner."""
    points = star(draw) if draw(st.booleans()) else staircase(draw)
    for place in sorted(draw(st.lists(st.integers(0, len(points) - 1), max_size=4)), reverse=True):
        middle = (points[place] + points[(place + 1) % len(points)]) / 2
        points = np.insert(points, place + 1, middle, axis=0)
    return np.roll(points, draw(st.integers(0, len(points) - 1)), axis=0)


@st.composite
def planes(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Two axes (2, 3) of length one, across each other, and the normal that they span."""
    matrix = draw(arrays.arrays(float, (2, 3), elements=st.floats(-1, 1)))
    first = matrix[0] + [1.5, 0, 0]
    first /= np.linalg.norm(first)
    second = matrix[1] + [0, 0, 3]
    second -= (second @ first) * first
    second /= np.linalg.norm(second)
    return np.stack([first, second]), np.cross(first, second)


@given(simple_polygons(), planes(), st.sampled_from([1e-150, 1.0, 1e150]))
@settings(max_examples=80)
def test_a_simple_polygon_in_any_plane(flat: np.ndarray, plane: tuple[np.ndarray, np.ndarray], size: float) -> None:
    axes, normal = plane
    points = flat @ axes * size
    mesh = cut(points)
    count = len(points)
    assert len(mesh.faces) == count - 2
    assert sorted(set(mesh.faces.reshape(-1).tolist())) == list(range(count))
    signed = areas(Mesh(mesh.vertices / size, mesh.faces), normal)
    expected = shoelace(flat)
    assert signed.sum() == pytest.approx(expected, rel=1e-9)
    assert np.abs(signed).sum() == pytest.approx(expected, rel=1e-9)  # none overlaps another, none is turned round
    assert [rotated(one) for one in mesh.polygons_as_lists()] == [list(range(count))]
    assert np.array_equal(cut(points).faces, mesh.faces)


@given(st.lists(simple_polygons(), min_size=1, max_size=6))
@settings(max_examples=40)
def test_polygons_of_many_sizes_keep_their_order(flats: list[np.ndarray]) -> None:
    points = np.concatenate([np.column_stack([flat, np.zeros(len(flat))]) for flat in flats])
    sizes = [len(flat) for flat in flats]
    found = triangulated(points, np.array(sizes), np.arange(len(points)))
    starts = np.cumsum([0, *sizes])
    assert found.degenerate == 0
    assert found.polygon.tolist() == np.repeat(np.arange(len(sizes)), np.array(sizes) - 2).tolist()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(polygons, "_BATCH", 8)
        assert np.array_equal(found.corners, triangulated(points, np.array(sizes), np.arange(len(points))).corners)
    mesh = Mesh.checked(points, found.corners, polygons=found.inner)
    expected = [list(range(start, start + size)) for start, size in zip(starts, sizes, strict=False)]
    assert [rotated(one) for one in mesh.polygons_as_lists()] == expected
    for polygon, flat in enumerate(flats):
        alone = cut(np.column_stack([flat, np.zeros(len(flat))]))
        assert np.array_equal(found.corners[found.polygon == polygon] - starts[polygon], alone.faces)


@given(simple_polygons(), st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_bent_polygons_become_as_many_triangles(flat: np.ndarray, seed: int) -> None:
    heights = np.random.default_rng(seed).normal(0, 0.3, len(flat))
    points = np.column_stack([flat, heights])
    mesh = cut(points)
    assert len(mesh.faces) == len(points) - 2
    assert [rotated(one) for one in mesh.polygons_as_lists()] == [list(range(len(points)))]


def test_corners_in_one_place_and_on_a_line_but_for_rounding() -> None:
    steps = [[0, 0], [1, 0], [2, 0], [3, 0], [4, 0], [4, 4], [3, 4], [3, 1], [2, 1], [2, 1], [1, 1], [1, 4], [0, 4]]
    random = np.random.default_rng(0)
    for _ in range(100):
        axes = np.linalg.qr(random.normal(size=(3, 2)))[0].T
        points = np.roll(np.array(steps, float), random.integers(13), axis=0) @ axes
        assert np.abs(areas(cut(points), np.cross(*axes))).sum() == pytest.approx(10)


def keyholed(hole: np.ndarray) -> np.ndarray:
    """A square of 4 x 4 with a hole, which a slit joins to its first corner."""
    outer = np.array([[0.0, 0], [4, 0], [4, 4], [0, 4]])
    return np.concatenate([outer, outer[:1], hole, hole[:1]])


@pytest.mark.parametrize(
    ("hole", "area"),
    [
        ([[1.0, 1], [1, 3], [3, 3], [3, 1]], 12.0),
        ([[1.0, 1], [2, 3], [3, 1]], 14.0),
        ([[1.0, 1], [1, 3], [2, 1.5], [3, 3], [3, 1]], 13.5),
    ],
)
def test_holes_of_keyholed_polygons_stay_open(hole: list[list[float]], area: float) -> None:
    flat = keyholed(np.array(hole))
    assert shoelace(flat) == area
    points, numbers = np.unique(np.column_stack([flat, np.zeros(len(flat))]), axis=0, return_inverse=True)
    found = triangulated(points, np.array([len(flat)]), numbers)
    mesh = Mesh.checked(points, numbers[found.corners], polygons=found.inner)
    signed = areas(mesh, np.array([0.0, 0, 1]))
    assert len(mesh.faces) == len(flat) - 2
    assert signed.sum() == pytest.approx(area)
    assert np.abs(signed).sum() == pytest.approx(area)


def test_of_a_quadrilateral_the_shorter_inner_diagonal_is_taken() -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert cut(square).faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert cut(square * [1, 2, 1] + [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0]]).faces.tolist() == [
        [0, 1, 3],
        [1, 2, 3],
    ]
    for reflex in range(4):
        dart = np.roll(np.array([[0.2, 0.2, 0], [2, -1, 0], [0, 0, 0], [-1, 2, 0]]) * [-1, -1, 1], reflex, axis=0)
        mesh = cut(dart[::-1])
        assert np.abs(areas(mesh, np.array([0.0, 0, 1]))).sum() == pytest.approx(abs(shoelace(dart)))


def test_triangles_pass_as_they_are() -> None:
    found = triangulated(np.zeros((3, 3)), np.array([3, 3]), np.array([0, 1, 2, 2, 1, 1]))
    assert found.corners.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert (found.inner, found.degenerate) == (None, 0)


def test_polygons_of_fewer_than_three_vertices_are_counted() -> None:
    points = np.random.default_rng(1).random((5, 3))
    corners = np.array([0, 1, 0, 1, 2, 0, 1, 2, 3, 3, 3, 3, 0, 1, 0, 1])
    found = triangulated(points, np.array([2, 3, 4, 3, 0, 4]), corners)
    assert found.degenerate == 3
    assert found.polygon.tolist() == [1, 2, 2, 3]
    nothing = triangulated(points, np.array([2, 0]), corners[:2])
    assert (len(nothing.corners), len(nothing.polygon), nothing.inner, nothing.degenerate) == (0, 0, None, 2)
    assert len(triangulated(points, np.zeros(0, np.int64), corners[:0]).corners) == 0


@given(arrays.arrays(float, st.tuples(st.integers(3, 12), st.just(3)), elements=st.floats(width=64)))
@settings(max_examples=80)
def test_no_polygon_raises_or_warns(points: np.ndarray) -> None:
    found = triangulated(points, np.array([len(points)]), np.arange(len(points)))
    assert found.corners.shape == (len(points) - 2, 3)
    assert sorted(set(found.corners.reshape(-1).tolist())) == list(range(len(points)))


@given(arrays.arrays(np.int8, st.tuples(st.integers(3, 12), st.just(3)), elements=st.integers(0, 2)))
@settings(max_examples=80)
def test_polygons_that_cross_or_touch_themselves_are_cut_somehow(corners: np.ndarray) -> None:
    points = corners.astype(float)
    found = triangulated(points, np.array([len(points)]), np.arange(len(points)))
    assert found.corners.shape == (len(points) - 2, 3)
    mesh = Mesh.checked(points, found.corners, polygons=found.inner)
    assert [rotated(one) for one in mesh.polygons_as_lists()] == [list(range(len(points)))]


def test_convex_polygons_are_not_cut_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    cut_by_ears = []
    original = polygons.ears
    monkeypatch.setattr(
        polygons, "ears", lambda planes, work: cut_by_ears.append(len(planes)) or original(planes, work)
    )
    angles = np.arange(8) * np.pi / 4
    octagon = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    dented = octagon * np.where(np.arange(8) == 3, 0.2, 1.0)[:, None]
    found = triangulated(np.concatenate([octagon] * 50 + [dented] * 3), np.full(53, 8), np.arange(53 * 8))
    assert len(found.corners) == 53 * 6
    assert cut_by_ears == [3]
