"""Outlines with many corners nearly on one line, turned in space: what earcut cuts wrongly is cut right."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.ear_clipping import MOST_CORNERS, Work, clipped
from meshtide_codec.mesh_files.polygons import Triangulation, triangulated
from meshtide_codec.mesh_files.read import read_source
from meshtide_codec.mesh_files.source import Source

if TYPE_CHECKING:
    from numpy.typing import NDArray

BOW_TIE = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0], [2, 3, 0]])
PENTAGRAM = np.array([[np.cos(2 * turn), np.sin(2 * turn), 0.0] for turn in 2 * np.pi / 5 * np.arange(5)])


def comb(teeth: int) -> NDArray[np.float64]:
    """A comb (4 k + 2, 2): the tips and the gaps of its teeth are each on one line."""
    points = [(-1.0, -1.0), (2.0 * teeth, -1.0)]
    for tooth in range(teeth)[::-1]:
        points += [(2 * tooth + 1, 0 if tooth == teeth - 1 else 1), (2 * tooth + 1, 3), (2 * tooth, 3), (2 * tooth, 0)]
    return np.array(points)


def battlement(teeth: int) -> NDArray[np.float64]:
    """A wall (4 k, 2) with notches: all of their corners are on two lines."""
    points = [(0.0, -1.0), (2.0 * teeth - 1, -1.0)]
    for tooth in range(teeth)[::-1]:
        points += [(2 * tooth + 1, 1), (2 * tooth, 1)]
        points += [(2 * tooth, 0), (2 * tooth - 1, 0)] if tooth else []
    return np.array(points)


def spiral(turns: int) -> NDArray[np.float64]:
    """A corridor (n, 2) of width one, wound up at right angles, with walls on one line at each side."""
    ways = [(1, 0), (0, 1), (-1, 0), (0, -1)]
    left, right, at = [], [], np.zeros(2)
    for turn in range(2 * turns):
        ahead, before = np.array(ways[turn % 4], float), np.array(ways[turn % 4 - 1], float)
        if turn == 0:
            before = ahead
        left.append(at + 0.5 * np.array([-ahead[1], ahead[0]]) + 0.5 * np.array([-before[1], before[0]]) * (turn > 0))
        right.append(2 * at - left[-1])
        at = at + ahead * 2 * (turn // 2 + 1)
    return np.array([*right, *left[::-1]])


def turned(points: NDArray[np.float64], seed: int, shift: int) -> NDArray[np.float64]:
    """A polygon (n, 2) turned at random in space (n, 3), begun at another corner."""
    rotation, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    flat = np.column_stack([np.roll(points, shift, axis=0), np.zeros(len(points))])
    return flat @ rotation.T


def shoelace(points: NDArray[np.float64]) -> float:
    following = np.roll(points, -1, axis=0)
    return float(abs((points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]).sum()) / 2)


def cut(points: NDArray[np.float64]) -> tuple[Triangulation, float]:
    """The triangles of a polygon, and the sum of their areas."""
    found = triangulated(points, np.array([len(points)]), np.arange(len(points)))
    a, b, c = (points[found.corners[:, place]] for place in range(3))
    return found, float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


SHAPES = {"comb": comb, "battlement": battlement, "spiral": spiral}


@pytest.mark.parametrize("shape", SHAPES)
@given(size=st.integers(2, 9), seed=st.integers(0, 1 << 30), shift=st.integers(0, 40))
def test_triangles_of_turned_outlines_do_not_overlap(shape: str, size: int, seed: int, shift: int) -> None:
    plane = SHAPES[shape](size)
    found, area = cut(turned(plane, seed, shift))
    assert area == pytest.approx(shoelace(plane), rel=1e-9)
    assert len(found.corners) == len(plane) - 2
    assert found.crossed == 0


@pytest.mark.parametrize("shape", SHAPES)
@given(size=st.integers(2, 6), seed=st.integers(0, 1 << 30))
def test_each_outline_is_cut_without_earcut(shape: str, size: int, seed: int) -> None:
    points = turned(SHAPES[shape](size), seed, 0)
    angle = seed / 1e8
    plane = SHAPES[shape](size) @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    following = np.roll(plane, -1, axis=0)
    if (plane[:, 0] * following[:, 1] - plane[:, 1] * following[:, 0]).sum() < 0:
        plane = plane[::-1]
    triangles = clipped(plane, Work())
    assert triangles is not None
    a, b, c = (plane[np.array(triangles)[:, place]] for place in range(3))
    b, c = b - a, c - a
    areas = (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]) / 2
    assert (areas >= -1e-12).all()
    assert areas.sum() == pytest.approx(shoelace(plane), rel=1e-9)
    assert len(triangles) == len(points) - 2


def test_an_outline_with_a_hole_is_cut() -> None:
    hole = [(1.0, 1.0), (1, 2), (2, 2), (2, 1), (1, 1)]
    plane = np.array([(0.0, 0.0), *hole, (0, 0), (3, 0), (3, 3), (0, 3)])
    triangles = clipped(plane, Work())
    assert triangles is not None
    a, b, c = (plane[np.array(triangles)[:, place]] for place in range(3))
    b, c = b - a, c - a
    assert (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0] >= 0).all()
    assert np.abs(b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]).sum() / 2 == 8


def test_equal_outlines_are_cut_alike() -> None:
    points = turned(comb(5), 3, 0)
    both = triangulated(np.vstack([points, points]), np.array([22, 22]), np.arange(44))
    assert both.corners[:20].tolist() == (both.corners[20:] - 22).tolist()


@pytest.mark.parametrize("points", [BOW_TIE, PENTAGRAM, np.vstack([BOW_TIE, [[1, -1, 0]]])])
def test_outlines_that_cross_themselves_are_counted(points: NDArray[np.float64]) -> None:
    for seed in range(4):
        found, _ = cut(turned(points[:, :2], seed, seed))
        assert found.crossed == 1
        assert found.notes() == ["1 polygons cross themselves: their triangles overlap"]


def test_a_bow_tie_of_equal_halves_has_no_area_and_crosses_itself() -> None:
    assert cut(np.array([[0.0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]]))[0].crossed == 1
    hexagon = np.array([[0.0, 0, 0], [1, 1, 0], [2, 1, 0], [2, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert cut(hexagon)[0].crossed == 1


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]],  # a line
        [[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]],  # a triangle
        [[0, 0, 0], [1, 0, 0], [0.25, 0.25, 0], [0, 1, 0]],  # an arrow
        [[0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]],  # bent
        [[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [0, 1, 0]],  # a corner on a straight line
        [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0], [0, 0, 0]],
        [[np.nan, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0], [0, 0, 0]],
        [[np.inf, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0]],
    ],
)
def test_what_does_not_cross_itself_is_not_counted(points: list[list[float]]) -> None:
    places = np.array(points, float)
    assert triangulated(places, np.array([len(places)]), np.arange(len(places))).crossed == 0


def test_work_is_bounded() -> None:
    assert clipped(np.zeros((MOST_CORNERS + 1, 2)), Work()) is None
    work = Work(left=1000)
    assert clipped(spiral(50), work) is None
    assert work.left > -(1 << 16)


@pytest.mark.parametrize("suffix", [".obj", ".off", ".ply"])
def test_readers_tell_of_polygons_that_cross_themselves(suffix: str) -> None:
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in BOW_TIE.tolist())
    header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    texts = {
        ".obj": "v " + rows.strip().replace("\n", "\nv ") + "\nf 1 2 3 4\nf 4 3 2 1\n",
        ".off": f"OFF\n4 2 0\n{rows}4 0 1 2 3\n4 3 2 1 0\n",
        ".ply": f"{header}{rows}4 0 1 2 3\n4 3 2 1 0\n",
    }
    source = Source("a", suffix, texts[suffix].encode())
    read_source(source, FileLimits())
    assert source.notes == ["2 polygons cross themselves: their triangles overlap"]
