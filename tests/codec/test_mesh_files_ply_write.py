"""Scenes as PLY files: what is written reads back, here and by another reader; what is lost is told."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.attributes import NONE, Attribute, Domain, Kind
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import load_scene, save_scene
from meshtide_codec.mesh_files.ply import write_ply
from meshtide_codec.scene import Image, Material, Scene
from meshtide_codec.testing import grid, random_meshes, soup, tetrahedron
from ply_files import SQUARE, TRIANGLE, Variant, mesh_in, outlines, read, variants

TRIANGLES = [[0, 1, 2], [0, 2, 3]]
INNER = np.array([[False, False, True], [True, False, False]])


def square(*attributes: Attribute, polygon: bool = False, materials: Any = None) -> Mesh:
    inner = INNER if polygon else None
    chosen = None if materials is None else np.array(materials)
    return Mesh.checked(SQUARE, TRIANGLES, attributes, chosen, inner)


def written(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    result = write_ply(Scene.of(mesh), "a.ply")
    assert write_ply(Scene.of(mesh), "a.ply").data == result.data
    return mesh_in(result.data), result.notes


def of_vertices(name: str, kind: Kind, values: Any, **more: Any) -> Attribute:
    return Attribute(name, kind, Domain.VERTEX, np.asarray(values), **more)


def test_a_mesh_without_attributes_is_positions_and_triangles() -> None:
    mesh = grid(5)
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment written by meshtide\n"
        "element vertex 25\nproperty double x\nproperty double y\nproperty double z\n"
        "element face 32\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(32, [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, mesh.faces
    result = write_ply(Scene.of(mesh), "a.ply")
    assert result.data == header.encode() + mesh.vertices.astype("<f8").tobytes() + rows.tobytes()
    assert (result.companions, result.notes) == ({}, ())


@given(random_meshes())
@settings(max_examples=40, deadline=None)
def test_any_mesh_reads_back(mesh: Mesh) -> None:
    data = write_ply(Scene.of(mesh), "a.ply").data
    if len(mesh.faces) == 0:
        assert b"element face 0" in data
        return
    found = mesh_in(data)
    assert np.array_equal(found.vertices, mesh.vertices)
    assert np.array_equal(found.faces, mesh.faces)


@given(variants())
@settings(max_examples=60, deadline=None)
def test_what_was_read_of_any_file_reads_back(variant: Variant) -> None:
    mesh = mesh_in(variant.data)
    found, notes = written(mesh)
    assert notes == ()
    assert np.array_equal(found.vertices, mesh.vertices)
    assert outlines(found) == outlines(mesh)
    assert _values(found) == _values(mesh)


def _values(mesh: Mesh) -> list[tuple[Any, ...]]:
    return [
        (one.name, one.kind, one.domain, one.normalized, one.values.dtype.str, one.values.tolist(), one.rows().tolist())
        for one in sorted(mesh.attributes, key=lambda one: (one.domain, one.name))
    ]


KINDS: dict[str, Attribute] = {
    "bytes of colour": of_vertices("COLOR_0", Kind.COLOR, np.arange(12, dtype="u1").reshape(4, 3), normalized=True),
    "with alpha": of_vertices("COLOR_0", Kind.COLOR, np.arange(16, dtype="u2").reshape(4, 4), normalized=True),
    "colours of floats": of_vertices("COLOR_0", Kind.COLOR, np.linspace(0, 1, 12, dtype="f4").reshape(4, 3)),
    "normals": of_vertices("NORMAL", Kind.NORMAL, np.arange(12.0).reshape(4, 3)),
    "texture coordinates": of_vertices("TEXCOORD_0", Kind.TEXCOORD, np.arange(8, dtype="f4").reshape(4, 2)),
    "a scalar": of_vertices("Quality", Kind.SCALAR, np.array([[1.5], [np.nan], [np.inf], [0]], "f4")),
    "large integers": of_vertices("id", Kind.SCALAR, np.array([[2**62 + 1], [-1], [0], [5]])),
    "of faces": Attribute("quality", Kind.SCALAR, Domain.FACE, np.array([[1], [2]], "i2")),
    "colours of faces": Attribute(
        "COLOR_0", Kind.COLOR, Domain.FACE, np.arange(6, dtype="u1").reshape(2, 3), None, True
    ),
    "normals of faces": Attribute("NORMAL", Kind.NORMAL, Domain.FACE, np.arange(6, dtype="f4").reshape(2, 3)),
    "corners": Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, np.arange(12.0).reshape(6, 2)),
}


@pytest.mark.parametrize("kind", KINDS)
def test_an_attribute_reads_back(kind: str) -> None:
    mesh = square(KINDS[kind])
    found, notes = written(mesh)
    assert notes == ()
    assert str(_values(found)) == str(_values(mesh))  # as text, where NaN is NaN


def test_all_of_them_read_back_beside_each_other() -> None:
    mesh = square(
        of_vertices("COLOR_0", Kind.COLOR, np.arange(12, dtype="u1").reshape(4, 3), normalized=True),
        of_vertices("COLOR_1", Kind.COLOR, np.arange(12, dtype="u1").reshape(4, 3), normalized=True),
        of_vertices("NORMAL", Kind.NORMAL, np.arange(12.0).reshape(4, 3)),
        of_vertices("TEXCOORD_1", Kind.TEXCOORD, np.arange(8, dtype="f4").reshape(4, 2)),
        of_vertices("quality", Kind.SCALAR, np.arange(4.0)[:, None]),
        KINDS["corners"],
        Attribute("FACE_COLOR", Kind.COLOR, Domain.FACE, np.arange(6, dtype="u1").reshape(2, 3), None, True),
        Attribute("face_quality", Kind.SCALAR, Domain.FACE, np.ones((2, 1)), extra={"property": "quality"}),
    )
    result = write_ply(Scene.of(mesh), "a.ply")
    assert result.notes == ()
    assert b"property double quality\nelement face" in result.data
    assert b"property double quality\nend_header" in result.data
    assert _values(mesh_in(result.data)) == _values(mesh)


def test_polygons_keep_their_lists_and_values() -> None:
    texcoords = Attribute(
        "TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, np.arange(8.0).reshape(4, 2), np.array([[0, 1, 2], [0, 2, 3]])
    )
    level = Attribute("level", Kind.SCALAR, Domain.FACE, np.array([[3], [3]], "u1"))
    result = write_ply(Scene.of(square(texcoords, level, polygon=True)), "a.ply")
    assert result.notes == ()
    assert b"element face 1\n" in result.data
    found = mesh_in(result.data)
    assert outlines(found) == [[0, 1, 2, 3]]
    corners = next(one for one in found.attributes if one.domain is Domain.CORNER)
    assert {int(v): row for v, row in zip(found.faces.flat, corners.per_element().tolist(), strict=True)} == {
        at: [2.0 * at, 2.0 * at + 1] for at in range(4)
    }
    _, notes = written(square(Attribute("level", Kind.SCALAR, Domain.FACE, np.array([[3], [4]])), polygon=True))
    assert notes == ("level: differs between the triangles of a polygon, that of the first is kept",)


def test_polygons_of_many_corners_take_longer_counts() -> None:
    angle = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    faces = np.stack([np.zeros(298, int), np.arange(1, 299), np.arange(2, 300)], axis=1)
    inner = np.ones((298, 3), bool)
    inner[:, 1] = inner[0, 0] = inner[-1, 2] = False
    texcoords = Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, ring[:, :2], faces)
    result = write_ply(Scene.of(Mesh.checked(ring, faces, [texcoords], None, inner)), "a.ply")
    assert b"property list int int vertex_indices\nproperty list int double texcoord" in result.data
    found = mesh_in(result.data)
    assert outlines(found) == [list(range(300))]
    assert np.array_equal(found.attributes[0].per_element(), ring[found.faces.reshape(-1), :2])


def test_values_of_corners_that_agree_become_those_of_vertices() -> None:
    faces = np.array(TRIANGLES)
    agreeing = Attribute("NORMAL", Kind.NORMAL, Domain.CORNER, np.arange(12.0).reshape(4, 3), faces)
    found, notes = written(square(agreeing))
    assert notes == ()
    assert [(one.name, one.domain, one.values.tolist()) for one in found.attributes] == [
        ("NORMAL", Domain.VERTEX, np.arange(12.0).reshape(4, 3).tolist())
    ]
    for one in (
        Attribute("NORMAL", Kind.NORMAL, Domain.CORNER, np.arange(18.0).reshape(6, 3)),
        Attribute(
            "NORMAL", Kind.NORMAL, Domain.CORNER, np.arange(12.0).reshape(4, 3), np.where(faces == 3, NONE, faces)
        ),
    ):
        found, notes = written(square(one))
        assert found.attributes == ()
        assert notes == (f"normals ({len(one.values)}): not kept",)


def test_what_has_no_value_is_told() -> None:
    rows = np.array([[0, 1, 2], [NONE, NONE, NONE]])
    texcoords = Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, np.arange(6.0).reshape(3, 2), rows)
    found, notes = written(square(texcoords))
    assert notes == ()
    assert found.attributes[0].rows().tolist() == [0, 1, 2, NONE, NONE, NONE]
    rows[1, 0] = 1
    found, notes = written(square(Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, texcoords.values, rows)))
    assert notes == ("TEXCOORD_0: corner values that are missing are written as 0 (2)",)
    assert found.attributes[0].per_element().tolist()[3:] == [[2.0, 3.0], [0, 0], [0, 0]]
    _, notes = written(square(of_vertices("a", Kind.SCALAR, [[1.0]], indices=np.array([0, NONE, 0, 0]))))
    assert notes == ("a: vertex values that are missing are written as 0 (1)",)


def test_names_and_widths_that_the_format_lacks() -> None:
    found, notes = written(
        square(
            of_vertices("x", Kind.SCALAR, np.ones((4, 1))),
            of_vertices("two words\nend_header", Kind.SCALAR, np.ones((4, 1))),
            of_vertices("", Kind.SCALAR, np.ones((4, 1))),
            of_vertices("value", Kind.SCALAR, np.ones((4, 1), "f2")),
            of_vertices("JOINTS_0", Kind.SCALAR, np.ones((4, 2), "u2")),
        )
    )
    assert notes == ("JOINTS_0: written as 2 numbers without a meaning",)
    assert [(one.name, one.values.dtype) for one in found.attributes] == [
        ("x_", np.float64),
        ("two_words_end_header", np.float64),
        ("value", np.float64),
        ("value_", np.float32),
        ("JOINTS_0_0", np.uint16),
        ("JOINTS_0_1", np.uint16),
    ]


def textured(materials: Any, *names: str, texture: str = "baseColorTexture") -> Scene:
    images = tuple(Image(name, b"picture of " + name.encode(), "image/png") for name in names)
    styles = tuple(Material(f"m{at}", {"pbrMetallicRoughness": {texture: {"index": at}}}) for at in range(len(images)))
    scene = Scene.of(square(materials=materials), styles)
    document = {"textures": [{"source": at} for at in range(len(images))], "comments": ["a\nb", "obj_info c"]}
    return Scene(scene.geometries, scene.nodes, scene.roots, styles, images, document=document)


def test_textures_stand_beside_the_file(tmp_path: Path) -> None:
    notes = save_scene(textured([1, 0], "a.png", "in/b c.png"), tmp_path / "mesh.ply")
    assert notes == ()
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.png", "b c.png", "mesh.ply"]
    scene = load_scene(tmp_path / "mesh.ply")
    assert [(each.name, each.data) for each in scene.images] == [
        ("a.png", b"picture of a.png"),
        ("b c.png", b"picture of in/b c.png"),
    ]
    materials = scene.mesh().materials
    assert materials is not None
    assert materials.tolist() == [1, 0]
    assert scene.document["comments"] == ["written by meshtide", "a b", "obj_info c"]
    again = write_ply(scene, "mesh.ply").data
    assert again == (tmp_path / "mesh.ply").read_bytes()


@pytest.mark.parametrize(
    ("names", "written_names"),
    [
        (("mesh.ply", "MESH.ply"), ["mesh_.ply", "MESH__.ply"]),
        (("../../etc/passwd", "..\\..\\b.png"), ["passwd.png", "b.png"]),
        (("", "a\nb"), ["texture_0.png", "a_b.png"]),
        (("..", "a/"), ["texture_0.png", "a.png"]),
    ],
)
def test_textures_never_leave_the_folder_or_replace_the_mesh(names: tuple[str, ...], written_names: list[str]) -> None:
    result = write_ply(textured([0, 1], *names), "mesh.ply")
    assert list(result.companions) == written_names
    assert [line for line in result.data.split(b"\n") if b"TextureFile" in line] == [
        f"comment TextureFile {name}".encode() for name in written_names
    ]


def test_materials_without_textures_are_told() -> None:
    result = write_ply(textured([0, 1], "a", "b", texture="other"), "mesh.ply")
    assert result.notes == ("2 materials, 2 images: not kept",)
    assert result.companions == {}
    assert b"texnumber" not in result.data
    one = write_ply(textured([0, NONE], "a.png"), "mesh.ply")
    scene, _ = read(one.data)
    materials = scene.mesh().materials
    assert materials is not None
    assert materials.tolist() == [0, NONE]


@pytest.mark.filterwarnings("ignore")  # another library's
@pytest.mark.parametrize("name", ["tetrahedron", "grid", "soup"])
def test_another_reader_reads_the_same(name: str) -> None:
    mesh = {"tetrahedron": tetrahedron(), "grid": grid(9), "soup": soup(30, 60, seed=2)}[name]
    count = len(mesh.vertices)
    colours = np.random.default_rng(1).integers(0, 256, (count, 4)).astype("u1")
    level = np.random.default_rng(2).random((count, 1)).astype("f4")
    attributes = [of_vertices("COLOR_0", Kind.COLOR, colours), of_vertices("level", Kind.SCALAR, level)]
    data = write_ply(Scene.of(Mesh.checked(mesh.vertices, mesh.faces, attributes)), "a.ply").data
    found: Any = trimesh.load(io.BytesIO(data), file_type="ply", process=False, maintain_order=True)
    assert np.array_equal(found.vertices, mesh.vertices)
    assert np.array_equal(found.faces, mesh.faces)
    assert np.array_equal(found.visual.vertex_colors, colours)
    assert np.array_equal(found.metadata["_ply_raw"]["vertex"]["data"]["level"], level[:, 0])


@pytest.mark.filterwarnings("ignore")  # another library's
@given(st.integers(0, 2**32 - 1), st.sampled_from(["ascii", "binary"]))
@settings(max_examples=20, deadline=None)
def test_what_another_writer_writes_is_read(seed: int, encoding: str) -> None:
    mesh = soup(12, 20, seed=seed)
    other = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, validate=False)
    found = mesh_in(other.export(file_type="ply", encoding=encoding))
    assert np.array_equal(found.faces, mesh.faces)
    assert np.allclose(found.vertices, mesh.vertices, atol=1e-6)


def test_no_triangle_is_no_error_to_the_writer() -> None:
    data = write_ply(Scene.of(Mesh.checked(TRIANGLE, [])), "a.ply").data
    assert data.endswith(b"end_header\n" + np.array(TRIANGLE, "<f8").tobytes())
