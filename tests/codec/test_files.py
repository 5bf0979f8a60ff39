from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

import numpy as np
import pytest

from meshes import grid, tetrahedron
from meshtide_codec import files
from meshtide_codec.errors import MeshError, MeshFileError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import is_mesh_path, load_mesh, save_mesh
from meshtide_codec.output_files import write_atomically

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(("suffix", "error"), [("ply", 0.0), ("obj", 1e-17), ("off", 1e-17)])
def test_formats_of_double_precision(tmp_path: Path, suffix: str, error: float) -> None:
    mesh = grid(7)
    path = tmp_path / f"grid.{suffix}"
    save_mesh(mesh, path)
    again = load_mesh(path)
    assert np.array_equal(again.faces, mesh.faces)
    assert np.abs(again.vertices - mesh.vertices).max() <= error


def test_a_scan_far_from_the_origin_keeps_its_millimetres(tmp_path: Path) -> None:
    mesh = Mesh.checked(grid(7).vertices * 1e-3 + [500_000.0, 5_400_000.0, 90.0], grid(7).faces)
    save_mesh(mesh, tmp_path / "scan.ply")
    assert np.array_equal(load_mesh(tmp_path / "scan.ply").vertices, mesh.vertices)


@pytest.mark.parametrize("suffix", ["glb", "stl"])
def test_formats_of_single_precision(tmp_path: Path, suffix: str) -> None:
    mesh = tetrahedron()
    path = tmp_path / f"small.{suffix}"
    save_mesh(mesh, path)
    again = load_mesh(path)
    assert np.allclose(again.vertices[again.faces], mesh.vertices[mesh.faces], atol=1e-6)


def test_polygons_become_triangles(tmp_path: Path) -> None:
    path = tmp_path / "quad.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    assert load_mesh(path).faces.shape == (2, 3)


def test_vertices_without_a_face_are_left_out_unless_asked(tmp_path: Path) -> None:
    path = tmp_path / "lonely.obj"
    path.write_text("v 0 0 0\nv 9 9 9\nv 1 0 0\nv 0 1 0\nf 1 3 4\n")
    assert len(load_mesh(path).vertices) == 3
    kept = load_mesh(path, keep_unreferenced=True)
    assert kept.vertices[1].tolist() == [9, 9, 9]
    assert kept.faces.tolist() == [[0, 2, 3]]


def test_seams_of_textures_do_not_split_vertices(tmp_path: Path) -> None:
    path = tmp_path / "seam.obj"
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\n"
    path.write_text(corners + "f 1/1 2/2 3/3\nf 3/4 2/1 4/2\n")
    assert len(load_mesh(path).vertices) == 4


@pytest.mark.parametrize(
    ("name", "content", "error"),
    [
        ("noise.ply", os.urandom(200), MeshFileError),
        ("empty.ply", b"", MeshFileError),
        ("words.obj", b"this is not a mesh", MeshFileError),
        ("words.xyzzy", b"whatever", MeshFileError),
        ("nan.off", b"OFF\n3 1 0\n0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n", MeshError),
        ("index.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", MeshError),
    ],
)
def test_files_that_are_not_meshes(tmp_path: Path, name: str, content: bytes, error: type[Exception]) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(error, match=name):
        load_mesh(path)


HEADER = (
    "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
)
ROWS = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.ply", HEADER.format(4, 1) + ROWS, "ends after 0 of the 1 rows of face"),
        ("a.ply", HEADER.format(3, 2) + ROWS, "ends after 1 of the 2 rows of face"),
        ("a.ply", HEADER.format(3, 1) + ROWS.replace("\n1", " 1", 1), "ends after 0 of the 1 rows of face"),
        ("a.ply", HEADER.format(3, 1) + ROWS.replace("3 0 1 2", "3 0 1"), "row 0 of face has fewer values"),
        ("a.ply", HEADER.format(900, 1).replace("ascii", "binary_little_endian"), "10801 bytes of rows, but 0 follow"),
        ("a.off", "OFF\n4 1 0\n" + ROWS, "4 vertices and 1 faces, but 4 lines follow"),
        ("a.off", "OFF\n3 2 0\n" + ROWS, "3 vertices and 2 faces, but 4 lines follow"),
        ("a.off", "OFF\n3 1 0\n" + ROWS.replace("3 0 1 2", "3 0 1"), "face 0 of the OFF file has fewer corners"),
    ],
)
def test_files_that_declare_more_than_they_hold_are_not_misread(
    tmp_path: Path, name: str, content: str, message: str
) -> None:
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(MeshFileError, match=f"{path} .*: .*{message}"):
        load_mesh(path)


def test_files_that_hold_what_they_declare_are_read(tmp_path: Path) -> None:
    for name, content in (("a.ply", HEADER.format(3, 1) + ROWS), ("a.off", "OFF\n3 1 0\n" + ROWS)):
        (tmp_path / name).write_text(content)
        assert load_mesh(tmp_path / name).faces.tolist() == [[0, 1, 2]]


def test_a_file_of_many_reads_no_files_elsewhere(tmp_path: Path) -> None:
    folder = tmp_path / "meshes"
    folder.mkdir()
    save_mesh(tetrahedron(), folder / "a.glb")
    data = (folder / "a.glb").read_bytes()
    length = int.from_bytes(data[12:16], "little")
    text, binary = json.loads(data[20 : 20 + length]), data[28 + length :]
    for uri, place in (("beside.bin", folder), ("../elsewhere.bin", tmp_path)):
        (place / uri.rsplit("/", 1)[-1]).write_bytes(binary)
        text["buffers"][0]["uri"] = uri
        (folder / "a.gltf").write_text(json.dumps(text))
        if place == folder:
            assert len(load_mesh(folder / "a.gltf").faces) == 4
        else:
            with pytest.raises(MeshFileError, match="cannot be read"):
                load_mesh(folder / "a.gltf")


def test_missing_files_are_told_as_such(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        load_mesh(tmp_path / "nowhere.ply")


def test_unknown_formats_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(MeshFileError, match="xyzzy"):
        save_mesh(tetrahedron(), tmp_path / "out.xyzzy")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "out.bin"
    write_atomically(path, b"old")

    def full_disk(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.bin"]


def test_written_files_have_ordinary_permissions(tmp_path: Path) -> None:
    path = tmp_path / "out.bin"
    write_atomically(path, b"x")
    (tmp_path / "reference").write_bytes(b"x")
    assert path.stat().st_mode == (tmp_path / "reference").stat().st_mode


def test_names_of_meshes() -> None:
    assert [is_mesh_path(name) for name in ("a.ply", "b.OBJ", "c.tide", "d")] == [True, True, False, False]
