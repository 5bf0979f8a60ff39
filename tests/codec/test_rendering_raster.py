from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.rendering import raster
from meshtide_codec.rendering.raster import PixelBuffers, draw_faces, vertex_normals
from meshtide_codec.testing import grid


def owners(points: np.ndarray, faces: np.ndarray, side: int) -> np.ndarray:
    """Which face each of side x side pixels shows."""
    buffers = PixelBuffers.empty(side, side)
    draw_faces(points, faces, buffers)
    return buffers.owners


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


def test_a_block_of_few_pixels_draws_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    points, faces = rng.uniform(-3.0, 35.0, (40, 3)), rng.integers(0, 40, (60, 3))
    whole = owners(points, faces, 32)
    assert len(np.unique(whole)) > 20
    monkeypatch.setattr(raster, "FRAGMENTS", 7)  # less than a row
    np.testing.assert_array_equal(owners(points, faces, 32), whole)


def test_normals_of_vertices_are_as_long_as_their_faces_are_large() -> None:
    points = np.array([[0.0, 0, 0], [4, 0, 0], [0, 2, 0], [4, 2, 3]])
    normals = vertex_normals(points, np.array([[0, 1, 2], [1, 3, 2]]))
    np.testing.assert_array_equal(normals[0], [0.0, 0.0, -8.0])  # rows run downwards: it points away from the eye
    np.testing.assert_array_equal(normals[1] - normals[0], normals[3])
    assert np.linalg.norm(normals[3]) == pytest.approx(
        np.linalg.norm(np.cross(points[3] - points[1], points[2] - points[1]))
    )
