"""Morph targets and skins, held against sums that are written out one vertex at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gltf_files import PYRAMID, PYRAMID_FACES, TRIANGLE, GltfFile, read, read_mesh, volume
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files import read as reading
from meshtide_codec.mesh_files.gltf.nodes import transforms


def skinned(
    joints: Any, weights: Any, nodes: list[dict[str, Any]], inverse: Any = None, dtype: str = "<u1"
) -> GltfFile:
    """The pyramid in a skin; node 0 shows it, the others are the joints."""
    file = GltfFile()
    attributes = {
        "POSITION": file.accessor(PYRAMID),
        "NORMAL": file.accessor([[0, 0, 1]] * 5, "<f4"),
        "JOINTS_0": file.accessor(joints, dtype),
        "WEIGHTS_0": file.accessor(weights, "<f4"),
    }
    file.mesh({"attributes": attributes, "indices": file.accessor(PYRAMID_FACES.reshape(-1), "<u2")})
    skin: dict[str, Any] = {"joints": list(range(1, len(nodes) + 1))}
    if inverse is not None:
        columns = np.asarray(inverse).transpose(0, 2, 1).reshape(-1, 16)
        skin["inverseBindMatrices"] = file.accessor(columns, "<f4")
    file.add("skins", skin)
    return file.shown({"mesh": 0, "skin": 0, "translation": [100, 0, 0]}, *nodes)


ALONE = [[0, 0, 0, 0]] * 5, [[1, 0, 0, 0]] * 5


def test_the_transformation_of_the_node_does_not_count() -> None:
    scene = read(skinned(*ALONE, [{"scale": [10, 10, 10]}]))
    assert np.allclose(scene.mesh().vertices, PYRAMID * 10)
    assert scene.notes == ("skin: in its bind pose",)
    assert scene.nodes[0].geometry is None
    assert scene.nodes[scene.roots[-1]].geometry == 0


def test_instances_of_a_skin_are_taken_once_and_told() -> None:
    file = skinned(*ALONE, [{}])
    attributes = {"TRANSLATION": file.accessor([[0, 0, 0], [9, 0, 0]], "<f4")}
    file.root["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    scene = read(file)
    assert scene.counts() == (5, 6)
    assert scene.notes == ("skin: in its bind pose", "instances of a mesh in a skin: taken once")


def test_the_bind_pose_is_undone() -> None:
    nodes = [{"translation": [1, 2, 3], "scale": [2, 2, 2]}]
    world = transforms(np.array([[1.0, 2, 3]]), np.array([[0.0, 0, 0, 1]]), np.full((1, 3), 2.0))
    mesh = read_mesh(skinned(*ALONE, nodes, np.linalg.inv(world)))
    assert np.allclose(mesh.vertices, PYRAMID)
    assert np.allclose(mesh.attributes[0].values, [[0, 0, 1]] * 5)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_vertices_are_the_weighted_sum_of_where_joints_put_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    nodes: list[dict[str, Any]] = [
        {"translation": rng.normal(size=3).tolist(), "rotation": rng.normal(size=4).tolist()} for _ in range(3)
    ]
    nodes[0]["children"] = [2]
    joints, weights = rng.integers(0, 3, (5, 4)), rng.random((5, 4)).astype("<f4")
    inverse = rng.normal(size=(3, 4, 4)).astype("<f4")
    inverse[:, 3] = [0, 0, 0, 1]
    file = skinned(joints, weights, nodes, inverse)
    file.root["scenes"][0]["nodes"] = [0, 1, 3]
    local = [
        transforms(*(np.array([node.get(key, [1.0, 1, 1])]) for key in ("translation", "rotation", "scale")))[0]
        for node in nodes
    ]
    world = [local[0], local[0] @ local[1], local[2]]
    expected = np.zeros((5, 3))
    for vertex in range(5):
        for joint, weight in zip(joints[vertex], weights[vertex] / weights[vertex].sum(), strict=True):
            expected[vertex] += weight * (world[joint] @ inverse[joint] @ [*PYRAMID[vertex], 1])[:3]
    assert np.allclose(read(file).mesh().vertices, expected, atol=1e-4)


def test_a_second_set_of_joints_counts_and_weights_may_be_integers() -> None:
    file = skinned(*ALONE, [{}, {"translation": [8, 0, 0]}])
    attributes = file.root["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_1"] = file.accessor([[1, 9, 9, 9]] * 5, "<u2")  # joints without weight may be anything
    attributes["WEIGHTS_1"] = file.accessor([[255, 0, 0, 0]] * 5, "<u1", normalized=True)
    assert np.allclose(read_mesh(file).vertices, PYRAMID + np.array([4, 0, 0]))


def test_vertices_without_weights_go_with_their_first_joint() -> None:
    file = skinned([[0, 0, 0, 0]] * 5, [[0, 0, 0, 0]] * 5, [{"translation": [0, 7, 0]}])
    assert np.allclose(read_mesh(file).vertices, PYRAMID + np.array([0, 7, 0]))


def test_a_skin_that_mirrors_keeps_outward_faces() -> None:
    assert volume(read_mesh(skinned(*ALONE, [{"scale": [-1, 1, 1]}]))) == pytest.approx(3)


@pytest.mark.parametrize(("scale", "side"), [([-1, 1, 1], -1), ([-1, -2, 1], 1), ([1, 1, 3], 1)])
def test_tangents_change_their_side_where_a_skin_mirrors(scale: list[int], side: int) -> None:
    file = skinned(*ALONE, [{"scale": scale}])
    tangents = file.accessor([[1, 0, 0, 1]] * len(PYRAMID), "<f4")
    file.root["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = tangents
    found = next(one for one in read_mesh(file).attributes if one.name == "TANGENT")
    assert found.values.tolist() == [[np.sign(scale[0]), 0, 0, side]] * len(PYRAMID)


def test_a_mesh_without_joints_in_a_skin_stands_in_its_node() -> None:
    file = skinned(*ALONE, [{"scale": [10, 10, 10]}])
    for name in ("JOINTS_0", "WEIGHTS_0"):
        del file.root["meshes"][0]["primitives"][0]["attributes"][name]
    assert np.allclose(read_mesh(file).vertices, PYRAMID + np.array([100, 0, 0]))


def test_one_mesh_in_two_skins_becomes_two_geometries() -> None:
    file = skinned(*ALONE, [{"scale": [2, 2, 2]}, {"scale": [3, 3, 3]}])
    file.root["skins"][0]["joints"] = [1]
    file.add("skins", {"joints": [2]})
    file.shown({"mesh": 0, "skin": 1})
    file.root["scenes"] = [{"nodes": [0, 1, 2, 3]}]
    scene = read(file)
    assert len(scene.geometries) == 2
    assert np.allclose(scene.mesh().vertices, np.concatenate([PYRAMID * 2, PYRAMID * 3]))


def test_each_skin_has_its_own_joints_and_mirrors_by_itself() -> None:
    nodes: list[dict[str, Any]] = [{"scale": [2, 2, 2]}, {"scale": [-1, 1, 1]}, {"scale": [1, 1, -3]}]
    file = skinned(*ALONE, nodes, [np.diag([5.0, 5, 5, 1])])
    inverse = file.root["skins"][0]["inverseBindMatrices"]
    file.root["skins"] = [
        {"joints": [2, 3]},
        {"joints": [1], "inverseBindMatrices": inverse},
        {"joints": [2, 1]},
        {"joints": [1, 2]},
    ]
    file.root["nodes"] += [{"mesh": 0, "skin": 1}, {"mesh": 0, "skin": 2}, {"mesh": 0, "skin": 3}]
    file.root["scenes"] = [{"nodes": list(range(7))}]
    meshes = read(file).geometries
    scales: list[Any] = [[-1, 1, 1], 10, [-1, 1, 1], 2]
    for mesh, scale in zip(meshes, scales, strict=True):
        assert np.array_equal(mesh.vertices, PYRAMID * scale)
    assert [volume(mesh) for mesh in meshes] == pytest.approx([3, 3000, -3, 24])  # the third mirrors in part


def test_columns_without_weights_between_others_are_passed_over() -> None:
    nodes = [{"translation": [8, 0, 0]}, {"translation": [0, 8, 0]}, {"translation": [0, 0, 8]}]
    weights = [[0, 1, 0, 0], [0, 1, 0, 1], [0, 0, 0, 2], [0, 3, 0, 1], [0, np.nan, 0, 1]]
    moved = [[8, 0, 0], [4, 0, 4], [0, 0, 8], [6, 0, 2], [0, 0, 8]]
    mesh = read_mesh(skinned([[9, 0, 1, 2]] * 5, weights, nodes))
    assert np.array_equal(mesh.vertices, PYRAMID + moved)


@pytest.mark.parametrize(
    ("skin", "message"),
    [
        ({"joints": []}, r"skins\[0\] has joints that are not nodes"),
        ({"joints": [9]}, "joints that are not nodes"),
        ({"joints": "1"}, r"joints of skins\[0\] is not a list"),
        ({"joints": [1, 1], "inverseBindMatrices": 0}, r"accessors\[0\] has no matrix for each of the 2 joints"),
        ({"joints": [1, 1], "inverseBindMatrices": 5}, r"accessors\[5\] has no matrix for each of the 2 joints"),
    ],
)
def test_odd_skins_are_refused(skin: dict[str, Any], message: str) -> None:
    file = skinned(*ALONE, [{}], [np.eye(4)])
    file.root["skins"][0] = skin
    with pytest.raises(MeshFileError, match=message):
        read(file)


def test_odd_joints_are_refused() -> None:
    with pytest.raises(MeshFileError, match="vertices of joint 3; its skin has 1 joints"):
        read(skinned([[3, 0, 0, 0]] * 5, [[1, 0, 0, 0]] * 5, [{}]))
    with pytest.raises(MeshFileError, match="JOINTS_0 and WEIGHTS_0 of .* do not fit together"):
        read(skinned([[0, 0, 0]] * 5, [[1, 0, 0, 0]] * 5, [{}]))
    with pytest.raises(MeshFileError, match="JOINTS_0 and WEIGHTS_0 of .* do not fit together"):
        read(skinned(*ALONE, [{}], dtype="<f4"))
    file = skinned(*ALONE, [{}])
    file.root["nodes"][0]["skin"] = 4
    with pytest.raises(MeshFileError, match=r"nodes\[0\] names skins\[4\]"):
        read(file)


def morphing(weights: Any, *targets: Any, node: Any = None, name: str = "POSITION") -> GltfFile:
    file = GltfFile()
    attributes = {"POSITION": file.accessor(TRIANGLE), "NORMAL": file.accessor([[0, 0, 1]] * 3, "<f4")}
    rows = [{name: file.accessor(target, "<f4")} for target in targets]
    file.mesh({"attributes": attributes, "targets": rows}, **({} if weights is None else {"weights": weights}))
    return file.shown({"mesh": 0, **({} if node is None else {"weights": node})})


FIRST, SECOND = [[0, 0, 0], [4, 0, 0], [0, 0, 0]], [[0, 0, 8]] * 3


@pytest.mark.parametrize(
    ("weights", "node", "moved"),
    [
        ([1, 0], None, (1, 0)),
        ([0.5, 0.25], None, (0.5, 0.25)),
        ([1, 1], [0, -1], (0, -1)),
        (None, None, (0, 0)),
        (None, [1], (1, 0)),
        ([1, 0, 5], None, (1, 0)),
    ],
)
def test_morph_targets_count_by_the_weights_of_node_or_mesh(weights: Any, node: Any, moved: Any) -> None:
    scene = read(morphing(weights, FIRST, SECOND, node=node))
    expected = TRIANGLE + moved[0] * np.array(FIRST) + moved[1] * np.array(SECOND)
    assert np.array_equal(scene.mesh().vertices, expected)
    assert scene.notes == ("morph targets: taken at their default weights",)


def test_other_attributes_morph_too() -> None:
    mesh = read_mesh(morphing([0.5], [[0, 2, 0]] * 3, name="NORMAL"))
    assert mesh.attributes[0].values.tolist() == [[0, 1, 1]] * 3
    assert np.array_equal(mesh.vertices, TRIANGLE)


def test_sparse_targets_of_no_view_are_read() -> None:
    file = morphing([1], FIRST)
    row = file.root["accessors"][2]
    sparse = {
        "count": 1,
        "indices": {"bufferView": file.view(b"\2"), "componentType": 5121},
        "values": {"bufferView": file.view(np.array([0, 0, 6], "<f4").tobytes())},
    }
    file.root["accessors"][2] = {"componentType": 5126, "count": row["count"], "type": "VEC3", "sparse": sparse}
    assert read_mesh(file).vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 6]]


def test_nodes_of_other_weights_share_what_is_alike() -> None:
    file = morphing(None, FIRST)
    file.root["nodes"] = [{"mesh": 0, "weights": [weight]} for weight in (0, 1, 1, 0)]
    file.root["scenes"] = [{"nodes": [0, 1, 2, 3]}]
    scene = read(file)
    assert len(scene.geometries) == 2
    assert [node.geometry for node in scene.nodes] == [0, 1, 1, 0]


def test_nodes_that_are_not_shown_make_no_geometries_of_their_own() -> None:
    file = morphing(None, FIRST)
    file.root["nodes"] += [{"mesh": 0, "weights": [weight]} for weight in range(1, 50)]
    assert len(read(file).geometries) == 1


@pytest.mark.parametrize("target", [[[0, 0, 0]] * 4, [[0, 0]] * 3])
def test_targets_of_another_size_are_refused(target: Any) -> None:
    with pytest.raises(MeshFileError, match=r"accessors\[2\], POSITION of a target of .*; the primitive has 3 of 3"):
        read(morphing([1], target))


def test_numbers_beyond_all_bounds_are_refused_without_a_warning() -> None:
    scene = read(morphing([1e299], [[3e38, 0, 0]] * 3))
    with pytest.raises(MeshFileError.__mro__[1], match="not finite"):
        reading.mesh_of(scene)
