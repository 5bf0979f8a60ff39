from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np
import pytest

from meshes import grid, shapes, tetrahedron
from meshtide_client import picture
from meshtide_client.picture import TILE, draw_levels, draw_mesh, png
from meshtide_codec.mesh import Mesh

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


def unpacked(data: bytes) -> NDArray[np.uint8]:
    """The pixels of a PNG file as `png` writes it."""
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    position, chunks = 8, {}
    while position < len(data):
        (length,) = struct.unpack_from(">I", data, position)
        kind, content = data[position + 4 : position + 8], data[position + 8 : position + 8 + length]
        assert struct.unpack_from(">I", data, position + 8 + length) == (zlib.crc32(kind + content),)
        chunks[kind] = content
        position += 12 + length
    width, height, *rest = struct.unpack(">2I5B", chunks[b"IHDR"])
    assert rest == [8, 2, 0, 0, 0]
    assert chunks[b"IEND"] == b""
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, 1 + 3 * width)
    assert not rows[:, 0].any()
    return rows[:, 1:].reshape(height, width, 3)


def test_a_png_holds_its_pixels() -> None:
    image = np.random.default_rng(0).integers(0, 256, (7, 11, 3)).astype(np.uint8)
    np.testing.assert_array_equal(unpacked(png(image)), image)


def test_levels_stand_side_by_side(tmp_path: Path) -> None:
    path = tmp_path / "levels.png"
    draw_levels([(f"level {i}", grid(6)) for i in range(4)], path)
    image = unpacked(path.read_bytes())
    height = TILE + picture._CAPTION
    assert image.shape == (2 * height, 3 * TILE, 3)
    tiles = [image[top : top + TILE, left : left + TILE] for top in (0, height) for left in (0, TILE, 2 * TILE)]
    for tile in tiles[1:4]:
        np.testing.assert_array_equal(tile, tiles[0])
    assert (tiles[4] == picture._PAPER).all()
    captions = image[TILE:height]
    assert (captions[:, :TILE] != picture._PAPER).any()
    assert (captions[:, :TILE] != captions[:, TILE : 2 * TILE]).any()


@pytest.mark.parametrize("name", sorted(shapes()))
def test_any_mesh_can_be_drawn(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture, "TILE", 60)
    draw_levels([(name, shapes()[name]())], tmp_path / "levels.png")
    assert unpacked((tmp_path / "levels.png").read_bytes()).shape == (60 + picture._CAPTION, 60, 3)


def facing(depths: tuple[float, ...], side: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangles, one behind the other, that cover the lower left half of a square of pixels."""
    corner = np.array([[0.0, 0.0], [0.0, float(side)], [float(side), 0.0]])
    points = [np.column_stack([corner, np.full(3, depth)]) for depth in depths]
    return np.concatenate(points), np.arange(3 * len(depths)).reshape(-1, 3)


@pytest.mark.parametrize("depths", [(1.0, 2.0, 3.0), (3.0, 2.0, 1.0), (1.0, 3.0, 2.0)])
def test_the_nearest_face_hides_the_others(depths: tuple[float, ...]) -> None:
    nearest = picture._nearest_faces(*facing(depths, 16), 16)
    y, x = np.mgrid[:16, :16] + 0.5
    np.testing.assert_array_equal(nearest, np.where(x + y <= 16, int(np.argmax(depths)), -1))


def test_faces_that_cross_hide_each_other_in_part() -> None:
    points, faces = facing((0.0, 0.0), 16)
    points[:3, 2] = [0.0, 0.0, 16.0]  # rises to the right
    points[3:, 2] = 5.0
    nearest = picture._nearest_faces(points, faces, 16)
    assert nearest[0].tolist() == [1] * 5 + [0] * 11


def test_faces_out_of_the_picture_and_without_area_are_skipped() -> None:
    points = np.array([[-50.0, -50, 0], [-40, -50, 0], [-50, -40, 0], [2, 2, 0], [5, 5, 0], [9, 9, 0]])
    assert (picture._nearest_faces(points, np.array([[0, 1, 2], [3, 4, 5]]), 16) == -1).all()


def test_batches_do_not_change_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = grid(12)
    centre, scale = picture._frame(mesh)
    whole = draw_mesh(mesh, centre, scale)
    monkeypatch.setattr(picture, "_LARGEST_BATCH", 5000)
    np.testing.assert_array_equal(draw_mesh(mesh, centre, scale), whole)


def test_orientation_does_not_matter() -> None:
    mesh = tetrahedron()
    turned = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    centre, scale = picture._frame(mesh)
    np.testing.assert_array_equal(draw_mesh(mesh, centre, scale), draw_mesh(turned, centre, scale))


def test_a_mesh_fits_its_tile() -> None:
    mesh = grid(12)
    image = draw_mesh(mesh, *picture._frame(mesh))
    drawn = (image != picture._PAPER).any(axis=2)
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    border = int(TILE * picture._MARGIN)
    assert max(rows[-1] - rows[0], columns[-1] - columns[0]) == pytest.approx(TILE - 2 * border, abs=3)
    assert min(rows[0], columns[0]) >= border - 2
