"""Scenes written as GLB and glTF, read back by ourselves and by trimesh."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gltf_files import PYRAMID, PYRAMID_FACES, area, read
from meshtide_codec.attributes import UPPER_LEFT, Attribute, Domain, Kind
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.gltf import write_gltf
from meshtide_codec.mesh_files.gltf.glb import unpack
from meshtide_codec.mesh_files.read import load_scene, mesh_of
from meshtide_codec.mesh_files.write import save_mesh, save_scene
from meshtide_codec.scene import Image, Material, Node, Scene
from meshtide_codec.testing import grid, shapes, tetrahedron

PNG = b"\x89PNG\r\n\x1a\n..."


def text_of(data: bytes) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(unpack(data).text)
    return found


def rich_scene() -> Scene:
    uv = Attribute(
        "TEXCOORD_0",
        Kind.TEXCOORD,
        Domain.VERTEX,
        np.arange(10, dtype="f4").reshape(5, 2),
        extra={"origin": UPPER_LEFT},
    )
    pyramid = Mesh.checked(PYRAMID, PYRAMID_FACES, [uv], np.array([0, 0, 1, 1, 1, 1]))
    turned = np.diag([2.0, 2, 2, 1])
    mirrored = np.diag([-1.0, 1, 1, 1])
    moved = np.eye(4)
    moved[:3, 3] = [5, 6, 7]
    nodes = (
        Node(None, turned, (1, 2), name="above", properties={"extras": {"k": [1]}}),
        Node(0, mirrored, name="left", properties={"extensions": {"KHR_lights_punctual": {"light": 0}}}),
        Node(1, instances=np.stack([np.eye(4), moved])),
        Node(1, moved),
    )
    pbr = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    materials = (Material("wood", pbr), Material("", {"mtl": ["Kd 1 0 0"], "extras": {"a": 1}}))
    images = (Image("wood", PNG, "image/png", {"extras": 3}), Image("gone.png", b"", "", {"uri": "gone.png"}))
    document = {
        "asset": {"version": "2.0", "copyright": "c", "generator": "other"},
        "textures": [{"source": 0}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}, "EXT_x": {"deep": [{"bufferView": 1}]}},
        "extensionsUsed": ["KHR_lights_punctual", "EXT_x", "KHR_draco_mesh_compression"],
        "extras": {"b": None},
    }
    return Scene((pyramid, tetrahedron()), nodes, (0, 3), materials, images, ("p", "t"), document)


@pytest.mark.parametrize("name", ["a.glb", "a.gltf"])
def test_a_scene_is_the_same_again(name: str, tmp_path: Path) -> None:
    scene = rich_scene()
    notes = save_scene(scene, tmp_path / name)
    again = load_scene(tmp_path / name)
    assert notes == ("EXT_x: left out, as it points into the file that was read",)
    assert np.array_equal(again.mesh().vertices, scene.mesh().vertices)
    assert np.array_equal(again.mesh().faces, scene.mesh().faces)
    assert again.names == ("p", "t")
    assert again.roots == (0, 3)
    assert [(node.name, node.properties) for node in again.nodes[:3]] == [
        (node.name, node.properties) for node in scene.nodes[:3]
    ]
    first = again.geometries[0]
    assert first.materials is not None
    assert first.materials.tolist() == [0, 0, 1, 1, 1, 1]
    assert np.array_equal(first.attributes[0].values, scene.geometries[0].attributes[0].values)
    assert [one.name for one in again.materials] == ["wood", ""]
    assert again.materials[0].properties == scene.materials[0].properties
    assert again.materials[1].properties == {"extras": {"a": 1, "mtl": ["Kd 1 0 0"]}}
    assert [(one.name, one.data) for one in again.images] == [("wood", PNG), ("gone.png", b"")]
    assert again.images[0].properties["extras"] == 3
    kept = {key: again.document[key] for key in ("textures", "extras", "extensionsUsed")}
    assert kept == {"textures": [{"source": 0}], "extras": {"b": None}, "extensionsUsed": ["KHR_lights_punctual"]}
    assert again.document["asset"] == {"version": "2.0", "copyright": "c", "generator": "meshtide"}
    assert list(again.document["extensions"]) == ["KHR_lights_punctual"]


def test_files_beside_are_named_after_the_file_and_stay_in_its_folder() -> None:
    images = (Image("../../evil", PNG, "image/png"), Image("/etc/b", b"x", "text/odd"))
    written = write_gltf(Scene((tetrahedron(),), (Node(0),), (0,), images=images), "my scan.gltf")
    assert sorted(written.companions) == ["my scan.bin", "my scan.image0.png", "my scan.image1.image"]
    root = json.loads(written.data)
    assert root["buffers"][0]["uri"] == "my%20scan.bin"
    assert root["images"][0]["uri"] == "my%20scan.image0.png"


def test_the_same_scene_gives_the_same_bytes() -> None:
    assert write_gltf(rich_scene(), "a.glb") == write_gltf(rich_scene(), "a.glb")


@pytest.mark.parametrize("name", [name for name, mesh in shapes().items() if len(mesh().faces)])
def test_plain_meshes_are_the_same_again_and_for_trimesh(name: str, tmp_path: Path) -> None:
    import trimesh

    mesh = shapes()[name]()
    mesh = Mesh.checked(mesh.vertices.astype(np.float32), mesh.faces)
    save_mesh(mesh, tmp_path / "a.glb")
    again = mesh_of(load_scene(tmp_path / "a.glb"), keep_unreferenced=True).mesh
    assert np.array_equal(again.vertices, mesh.vertices)
    assert np.array_equal(again.faces, mesh.faces)
    data = io.BytesIO((tmp_path / "a.glb").read_bytes())
    foreign = trimesh.load(data, file_type="glb", process=False).to_mesh()
    assert np.array_equal(foreign.vertices, mesh.vertices)
    assert np.array_equal(foreign.faces, mesh.faces)


def test_trimesh_sees_the_scene_that_we_wrote() -> None:
    import trimesh

    scene = rich_scene()
    written = write_gltf(Scene(scene.geometries, scene.nodes, scene.roots, scene.materials[1:] * 2), "a.glb")
    foreign = trimesh.load(io.BytesIO(written.data), file_type="glb", process=False).to_mesh()
    assert len(foreign.faces) == len(scene.mesh().faces)
    assert foreign.area == pytest.approx(area(scene.mesh()))


def test_what_the_validator_of_gltf_asks_for_is_there() -> None:
    root = text_of(write_gltf(rich_scene(), "a.glb").data)
    position = root["accessors"][root["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    assert position["min"] == [0, 0, 0]
    assert position["max"] == [3, 2, 1.5]
    assert {view.get("target") for view in root["bufferViews"]} == {34962, 34963, None}
    shared = [primitive["attributes"] for primitive in root["meshes"][0]["primitives"]]
    assert len(shared) == 2
    assert shared[0] == shared[1]
    assert root["nodes"][2]["children"] == [4, 5]
    assert "extensionsRequired" not in root


def test_integers_beyond_plain_gltf_ask_for_quantization() -> None:
    normals = Attribute("NORMAL", Kind.NORMAL, Domain.VERTEX, np.full((4, 3), 9, np.int8), normalized=True)
    mesh = tetrahedron()
    data = write_gltf(Scene.of(Mesh.checked(mesh.vertices, mesh.faces, [normals])), "a.glb").data
    root = text_of(data)
    assert root["extensionsRequired"] == root["extensionsUsed"] == ["KHR_mesh_quantization"]
    assert read(data).geometries[0].attributes[0].values.dtype == np.int8


def test_what_is_not_kept_is_told_in_one_line() -> None:
    inner = np.array([[False, False, True], [True, False, False]])
    five = Attribute("five", Kind.SCALAR, Domain.VERTEX, np.ones((4, 5)))
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    mesh = Mesh.checked(square, [[0, 1, 2], [0, 2, 3]], [five], polygons=inner)
    scene = Scene((mesh,), (Node(0), Node(0)), (0, 1), (Material("a"),), document={"animations": [{}]})
    line = "five (4), 1 animation, 1 polygon (now triangles): not kept"
    assert write_gltf(scene, "a.glb").notes == (line,)


def test_points_are_written_as_points() -> None:
    data = write_gltf(Scene.of(Mesh.checked([[1, 2, 3]], [])), "a.glb").data
    assert text_of(data)["meshes"][0]["primitives"][0]["mode"] == 0
    with pytest.raises(MeshFileError, match="only points"):
        read(data)


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (Scene(()), "nothing to write"),
        (Scene.of(Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64))), "nothing to write"),
        (Scene.of(Mesh(np.array([[np.nan, 0, 0]]), np.zeros((1, 3), np.int64))), "vertex 0 of geometry 0"),
        (Scene((tetrahedron(),), (Node(0),), (0,), document={"extras": {1j: 2}}), "cannot be written as JSON"),
        (Scene((tetrahedron(),), (Node(0),), (0,), document={"extras": float("nan")}), "cannot be written as JSON"),
    ],
)
def test_what_cannot_be_written_is_refused(scene: Scene, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        write_gltf(scene, "a.glb")


def test_materials_that_are_not_there_are_not_named() -> None:
    mesh = tetrahedron()
    data = write_gltf(Scene.of(Mesh.checked(mesh.vertices, mesh.faces, materials=np.array([0, 5, -1, 0]))), "a").data
    assert not any("material" in primitive for primitive in text_of(data)["meshes"][0]["primitives"])


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_random_meshes_are_the_same_again(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = grid(int(rng.integers(2, 7)), seed=seed % 100)
    count = len(mesh.vertices)
    kinds = [("COLOR_0", Kind.COLOR, "u1", 4), ("NORMAL", Kind.NORMAL, "f4", 3), ("_X", Kind.SCALAR, "i2", 1)]
    attributes = [
        Attribute(
            name, kind, Domain.VERTEX, rng.integers(0, 99, (count, width)).astype(dtype), normalized=dtype == "u1"
        )
        for name, kind, dtype, width in kinds
        if rng.random() < 0.7
    ]
    mesh = Mesh.checked(mesh.vertices.astype("f4"), mesh.faces, attributes)
    again = read(write_gltf(Scene.of(mesh), "a.glb").data).mesh()
    assert np.array_equal(again.vertices, mesh.vertices)
    assert np.array_equal(again.faces, mesh.faces)
    assert [one.name for one in again.attributes] == [one.name for one in mesh.attributes]
    for one, other in zip(again.attributes, mesh.attributes, strict=True):
        assert (one.values.dtype, one.normalized, one.kind) == (other.values.dtype, other.normalized, other.kind)
        assert np.array_equal(one.values, other.values)
