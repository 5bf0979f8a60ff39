"""From a path to a scene or a mesh: which reader, what is refused, what is told."""

from __future__ import annotations

import gzip
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from meshtide_codec.errors import MeshError, MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import is_mesh_path, load_mesh, load_scene, mesh_of, save_mesh
from meshtide_codec.mesh_files.formats import SUFFIXES, content_kind, reader_of, writer_of
from meshtide_codec.mesh_files.read import read_source
from meshtide_codec.mesh_files.source import Source
from meshtide_codec.mesh_files.stl import write_stl
from meshtide_codec.scene import Node, Scene
from meshtide_codec.testing import grid

OFF = b"OFF 4 1 0\n0 0 0\n9 9 9\n1 0 0\n0 1 0\n3 0 2 3\n"


def written(folder: Path, name: str, data: bytes) -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


def test_a_mesh_is_read_without_what_no_face_uses(tmp_path: Path) -> None:
    path = written(tmp_path, "a.off", OFF)
    assert load_mesh(path).vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert len(load_mesh(path, keep_unreferenced=True).vertices) == 4
    found = mesh_of(load_scene(path))
    assert (len(found.mesh.vertices), found.unreferenced, found.notes) == (3, 1, ())
    kept = mesh_of(load_scene(str(path)), keep_unreferenced=True)
    assert (len(kept.mesh.vertices), kept.unreferenced) == (4, 0)


def test_a_packed_file_is_the_file(tmp_path: Path) -> None:
    assert len(load_mesh(written(tmp_path, "a.off.gz", gzip.compress(OFF))).faces) == 1
    assert len(load_mesh(written(tmp_path, "b.off", gzip.compress(OFF))).faces) == 1
    assert len(load_mesh(written(tmp_path, "c.bin", OFF), kind="off").faces) == 1


KINDS = {
    "a zip archive": b"PK\x03\x04" + bytes(100),
    "a gzip archive": gzip.compress(gzip.compress(OFF)),
    "a bzip2 archive": b"BZh91AY&SY" + bytes(100),
    "an xz archive": b"\xfd7zXZ\x00" + bytes(100),
    "a zstandard archive": b"\x28\xb5\x2f\xfd" + bytes(100),
    "a 7z archive": b"7z\xbc\xaf\x27\x1c" + bytes(100),
    "a picture .PNG.": b"\x89PNG\r\n\x1a\n" + bytes(100),
    "a picture .JPEG.": b"\xff\xd8\xff\xe0" + bytes(100),
    "a document .PDF.": b"%PDF-1.7" + bytes(100),
    "glb": b"glTF" + struct.pack("<2I", 2, 12),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("suffix", ["off", "obj", "ply", "stl", "gltf"])
def test_contents_of_another_kind_are_named(tmp_path: Path, kind: str, suffix: str) -> None:
    path = written(tmp_path, f"a.{suffix}", KINDS[kind])
    with pytest.raises(MeshFileError, match=rf"a\.{suffix} .* taken for \*\.{suffix}, but its content is {kind}"):
        load_scene(path)


def test_contents_that_could_be_several_things_are_left_to_their_readers() -> None:
    assert [content_kind(head) for head in (b"ply\n", b"ply\r\n", b"plywood", b"solid", b"OFF", b"")] == [
        ".ply",
        ".ply",
        None,
        None,
        None,
        None,
    ]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.xyzzy", r"nothing is known about files named \*\.xyzzy; obj, ply, off, stl, glb, gltf can be read, and"),
        ("a", "its name does not show the format; --format names it"),
        ("a.gz", "its name does not show the format"),
    ],
)
def test_formats_that_are_not_known(tmp_path: Path, name: str, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        load_scene(written(tmp_path, name, OFF))


def test_readers_and_writers_stand_for_their_suffixes() -> None:
    assert reader_of(".off") is not None
    assert writer_of(".stl") is not None
    assert reader_of(".xyzzy") is writer_of(".dae") is None
    names = [f"A{suffix.upper()}" for suffix in SUFFIXES] + ["b.obj.gz", "folder.obj/c", "d.tide"]
    assert [is_mesh_path(name) for name in names] == [True] * (len(SUFFIXES) + 1) + [False, False]


def test_a_vertex_that_is_not_finite_is_left_out_where_no_face_uses_it(tmp_path: Path) -> None:
    for value, count in ((b"nan", 1), (b"inf", 1), (b"1e999", 1)):
        found = mesh_of(load_scene(written(tmp_path, "a.off", OFF.replace(b"9 9 9", value + b" 9 9"))))
        assert found.mesh.faces.tolist() == [[0, 1, 2]]
        assert found.notes == (f"{count} vertex is not finite and of no face: left out",)
    two = OFF.replace(b"4 1 0\n", b"5 1 0\nnan 0 0\n").replace(b"9 9 9", b"9 -inf 9").replace(b"0 2 3", b"1 3 4")
    found = mesh_of(load_scene(written(tmp_path, "a.off", two)), keep_unreferenced=True)
    assert found.notes == ("2 vertices are not finite and of no face: left out",)
    assert found.mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    with pytest.raises(MeshError, match=r"a\.off: vertex 1 is not finite"):
        load_mesh(
            written(tmp_path, "a.off", OFF.replace(b"9 9 9\n1 0 0", b"1 nan 0\n9 9 9").replace(b"0 2 3", b"0 1 3"))
        )


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"OFF 3 0 0\n0 0 0\n1 0 0\n0 1 0\n", "there are no faces in it$"),
        (b"OFF 0 0 0\n", "there are no vertices in it$"),
        (
            b"OFF 3 2 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n4 0 1 0 1\n",
            "no faces in it .faces of fewer than three different corners, left out: 2",
        ),
    ],
)
def test_a_file_without_faces_is_an_error_and_never_a_stream(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        load_mesh(written(tmp_path, "a.off", data))


def test_notes_of_reader_and_source_come_together(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, "a.off", OFF + b"more"))
    assert [note.split(":")[0] for note in scene.notes] == ["1 words follow the last face", "its last line has no end"]
    assert mesh_of(scene).notes == scene.notes


def test_limits_count_every_instance() -> None:
    limits = FileLimits(vertices=11)
    triangle = Mesh.checked(np.eye(3), [[0, 1, 2]])
    scene = Scene((triangle,), (Node(0, instances=np.stack([np.eye(4)] * 4)),), (0,))
    with pytest.raises(MeshFileError, match="claims 12 vertices; 11 are the most that is read"):
        limits.check_counts(*scene.counts())
    with pytest.raises(MeshFileError, match="claims 4 vertices; 3 are the most"):
        read_source(Source("a.off", ".off", OFF), FileLimits(vertices=3))


def test_errors_name_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, "bad.off", b"nonsense")
    with pytest.raises(MeshFileError, match=rf"{path} cannot be read as a mesh: the file does not begin with OFF"):
        load_mesh(path)
    with pytest.raises(FileNotFoundError):
        load_mesh(tmp_path / "none.off")


def patch_as(kind: str, side: int = 150) -> bytes:
    """A patch of quadrilaterals or triangles, far from the origin, as text or in binary form."""
    mesh = grid(side)
    points = mesh.vertices + np.array([1000, 2000, 3000])
    if kind == "binary.stl":
        return write_stl(Scene.of(Mesh(points, mesh.faces)), "a.stl").data
    if kind == "text.stl":
        corners = "".join(
            "facet normal 0 0 1\nouter loop\n" + "vertex %.9g %.9g %.9g\n" * 3 + "endloop\nendfacet\n"
            for _ in mesh.faces
        )
        return ("solid\n" + corners % tuple(points[mesh.faces].reshape(-1)) + "endsolid\n").encode()
    half = len(mesh.faces) // 2
    faces = (
        mesh.faces if kind == "triangles.off" else np.column_stack([mesh.faces[:half, :2], mesh.faces[half:, [2, 0]]])
    )
    rows = [f"{x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points.tolist()]
    rows += [" ".join(map(str, [len(face), *face])) + "\n" for face in faces.tolist()]
    return f"OFF\n{len(points)} {len(faces)} 0\n{''.join(rows)}".encode()


@pytest.mark.parametrize("kind", ["triangles.off", "quads.off", "binary.stl", "text.stl"])
def test_reading_takes_at_most_six_times_the_file(kind: str) -> None:
    data = patch_as(kind)
    source = Source(kind, f".{kind[-3:]}", data)
    faces = read_source(source, FileLimits()).counts()[1]  # modules and tables that stay are loaded
    assert faces == 2 * 149 * 149
    tracemalloc.start()
    try:
        read_source(source, FileLimits())
        assert tracemalloc.get_traced_memory()[1] < 6 * len(data)
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("kind", ["ply", "stl", "glb"])
def test_a_signalling_nan_is_refused_without_a_warning(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"a.{kind}"
    save_mesh(Mesh.checked([[7.5, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), path)
    kept = np.float64(7.5).tobytes() if kind == "ply" else np.float32(7.5).tobytes()
    signalling = (b"\0" * 6 + b"\xf4\x7f")[-8:] if kind == "ply" else b"\0\0\xa0\x7f"
    path.write_bytes(path.read_bytes().replace(kept, signalling))
    with pytest.raises(MeshError, match="vertex 0 is not finite"):
        mesh_of(load_scene(path))
