from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings

from meshtide_codec.attributes import Attribute, Domain, Kind
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import load_scene, save_scene
from meshtide_codec.mesh_files.obj.write import write_obj
from meshtide_codec.scene import Image, Material, Node, Scene
from meshtide_codec.testing import grid, shapes
from obj_files import attribute, faces_of, read_bytes, written_in_random_ways
from plain_obj import Corner, read_plain_obj, turned

SQUARE = Mesh.checked(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.1, 1e-7, 2**0.5]],
    [[0, 1, 2], [0, 2, 3], [0, 1, 4]],
    polygons=np.array([[False, False, True], [True, False, False], [False, False, False]]),
)


def materials_of(scene: Scene) -> list[str | None]:
    rows = scene.geometries[0].materials
    return [] if rows is None else [None if row < 0 else scene.materials[row].name for row in rows.tolist()]


def with_attributes(*attributes: Attribute, materials: np.ndarray | None = None) -> Mesh:
    return Mesh.checked(SQUARE.vertices, SQUARE.faces, attributes, materials, SQUARE.polygons)


def test_polygons_and_exact_numbers() -> None:
    plain = read_plain_obj(write_obj(Scene.of(SQUARE), "a.obj").data)
    assert plain.positions == [tuple(row) for row in SQUARE.vertices.tolist()]
    assert [[v for v, _, _ in turned(face)] for face in plain.faces] == [[0, 1, 2, 3], [0, 1, 4]]


@settings(max_examples=40, deadline=None)
@given(written_in_random_ways())
def test_what_was_read_is_written_and_read_again(
    written: tuple[bytes, dict[str, list[tuple[float, ...]]], list[list[Corner]]],
) -> None:
    scene, _ = read_bytes(written[0])
    files = write_obj(scene, "a.obj")
    again, _ = read_bytes(files.data)
    one, other = scene.geometries[0], again.geometries[0]
    assert np.array_equal(one.vertices, other.vertices)
    assert faces_of(one) == faces_of(other)
    assert {a.name: a.values.tolist() for a in one.attributes} == {a.name: a.values.tolist() for a in other.attributes}
    assert materials_of(scene) == materials_of(again)
    assert write_obj(scene, "a.obj").data == files.data


@pytest.mark.parametrize("name", list(shapes()))
def test_meshes_of_all_kinds(name: str) -> None:
    mesh = shapes()[name]()
    again = read_bytes(write_obj(Scene.of(mesh), "a.obj").data)[0].geometries[0]
    assert np.array_equal(again.vertices, mesh.vertices)
    assert np.array_equal(again.faces, mesh.faces)


def test_materials_labels_colors_and_images(tmp_path: Path) -> None:
    mesh = with_attributes(
        Attribute(
            "TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, np.eye(2), np.array([[0, 1, 0], [0, 0, 1], [-1, -1, -1]])
        ),
        Attribute("NORMAL", Kind.NORMAL, Domain.FACE, np.eye(3)),
        Attribute(
            "COLOR_0",
            Kind.COLOR,
            Domain.VERTEX,
            np.array([[255, 0, 51, 255]], np.uint8),
            np.array([0, 0, -1, 0, 0]),
            normalized=True,
        ),
        Attribute(
            "group", Kind.LABEL, Domain.FACE, np.array([[0], [1]]), np.array([1, 1, 0]), extra={"names": ["x", "y"]}
        ),
        Attribute("smoothing", Kind.LABEL, Domain.FACE, np.array([[7], [7], [-3]])),
        materials=np.array([1, 1, 0]),
    )
    materials = (
        Material("plain", {"mtl": ["Kd 1 0 0"]}),
        Material("wood", {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}),
    )
    scene = Scene(
        (mesh,), (Node(0),), (0,), materials, (Image("../tex/w.png", b"wood"),), ("box",), {"textures": [{"source": 0}]}
    )
    assert save_scene(scene, tmp_path / "out put.obj") == ()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out put.mtl", "out put.obj", "w.png"]
    again = load_scene(tmp_path / "out put.obj")
    found = again.geometries[0]
    assert again.notes == ()
    assert again.names == ("box",)
    assert faces_of(found) == faces_of(mesh)
    assert attribute(found, "COLOR_0").per_element().tolist() == [[1, 0, 0.2, 1]] * 2 + [[0] * 4] + [[1, 0, 0.2, 1]] * 2
    groups = attribute(found, "group")
    assert [groups.extra["names"][row] for row in groups.rows()] == ["y", "y", "x"]
    smoothing = attribute(found, "smoothing")
    assert [smoothing.extra["names"][row] for row in smoothing.rows()] == ["7", "7", "-3"]
    assert found.materials is not None
    assert [again.materials[row].name for row in found.materials] == ["wood", "wood", "plain"]
    assert again.images[0].data == b"wood"


def test_faces_without_material_or_group_among_others() -> None:
    mesh = with_attributes(
        Attribute("object", Kind.LABEL, Domain.FACE, np.array([[0]]), np.array([-1, -1, 0]), extra={"names": ["o"]}),
        materials=np.array([0, 0, -1]),
    )
    again = read_bytes(write_obj(Scene.of(mesh, [Material()]), "a.obj").data)[0]
    found = again.geometries[0]
    assert found.materials is not None
    assert found.materials.tolist() == [0, 0, -1]
    assert attribute(found, "object").rows().tolist() == [-1, -1, 0]
    assert again.materials[0].name == "material_0"


def test_what_cannot_be_held_is_told() -> None:
    mesh = with_attributes(
        Attribute("quality", Kind.SCALAR, Domain.VERTEX, np.zeros((5, 1))),
        Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.VERTEX, np.zeros((5, 2))),
        Attribute("TEXCOORD_1", Kind.TEXCOORD, Domain.VERTEX, np.zeros((5, 2))),
        Attribute("COLOR_0", Kind.COLOR, Domain.FACE, np.zeros((3, 3))),
    )
    scene = Scene((mesh,), (Node(0), Node(0)), (0, 1), (Material("m", {"doubleSided": True}),))
    written = write_obj(scene, "a.obj.gz")
    others = "quality (10), texture coordinates TEXCOORD_1 (10), colours (6), 2 nodes (their meshes become one)"
    assert written.notes == (
        f"{others}: not kept",
        "materials with properties that MTL has no words for: 1",
    )
    assert list(written.companions) == ["a.mtl"]
    assert write_obj(Scene((SQUARE,), (Node(0),), (0,), images=(Image("a", b"b"),)), "a.obj").notes == (
        "1 image: not kept",
    )


def test_names_cannot_break_the_file() -> None:
    scene = Scene((SQUARE,), (Node(0),), (0,), names=("a\nv 9 9 9\n\\",))
    again = read_bytes(write_obj(scene, "x\ny.obj").data)[0]
    assert len(again.geometries[0].vertices) == 5
    assert again.names == ("a v 9 9 9 _",)


def test_trimesh_reads_what_is_written(tmp_path: Path) -> None:
    mesh = grid(9)
    normals = Attribute("NORMAL", Kind.NORMAL, Domain.VERTEX, mesh.vertices)
    materials = np.arange(len(mesh.faces)) // 64
    rich = Mesh.checked(mesh.vertices, mesh.faces, [normals], materials)
    save_scene(Scene.of(rich, [Material("a", {"mtl": ["Kd 1 0 0"]}), Material("b")]), tmp_path / "a.obj")
    save_scene(Scene.of(SQUARE), tmp_path / "b.obj")
    found = trimesh.load(tmp_path / "a.obj", process=False, force="mesh")
    assert found.area == pytest.approx(trimesh.Trimesh(mesh.vertices, mesh.faces).area)
    plain = trimesh.load(tmp_path / "b.obj", process=False, maintain_order=True)
    assert np.array_equal(plain.vertices, SQUARE.vertices)
    assert len(plain.faces) == 3
