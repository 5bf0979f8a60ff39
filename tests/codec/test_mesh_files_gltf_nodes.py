"""Nodes and scenes: transformations, depth, roots, instances; nodes that form no trees."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gltf_files import AREA, PYRAMID, TRIANGLE, GltfFile, area, pyramid_file, read, read_mesh, triangle_file, volume
from meshtide_codec.errors import MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.gltf.nodes import transforms

TURN = [0.0, 0.0, float(np.sqrt(0.5)), float(np.sqrt(0.5))]  # a quarter around z


def test_translation_rotation_and_scale_are_taken_in_their_order() -> None:
    file = triangle_file(nodes=[{"mesh": 0, "translation": [10, 0, 0], "rotation": TURN, "scale": [2, 3, 1]}])
    expected = [[10, 0, 0], [10, 2, 0], [7, 0, 0]]
    assert np.allclose(read_mesh(file).vertices, expected)


def test_a_matrix_is_read_by_columns() -> None:
    matrix = [0, 2, 0, 0, -3, 0, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1]
    assert np.allclose(
        read_mesh(triangle_file(nodes=[{"mesh": 0, "matrix": matrix}])).vertices, [[10, 0, 0], [10, 2, 0], [7, 0, 0]]
    )


def test_children_stand_in_the_coordinates_of_their_parents() -> None:
    nodes = [{"children": [1], "scale": [2, 2, 2]}, {"children": [2], "translation": [1, 0, 0]}, {"mesh": 0}]
    scene = read(triangle_file(nodes=nodes))
    assert np.array_equal(scene.mesh().vertices, TRIANGLE * 2 + [2, 0, 0])
    assert [node.children for node in scene.nodes] == [(1,), (2,), ()]
    assert scene.roots == (0,)


@given(st.lists(st.floats(-10, 10), min_size=4, max_size=4))
def test_rotations_keep_lengths_whatever_their_own_length(rotation: list[float]) -> None:
    check_rotation(rotation)


@pytest.mark.parametrize("rotation", [[0, 1e-162, 1e-162, 0], [5e-324, 0, 0, 5e-324], [1e300, -1e300, 0, 1e300]])
def test_rotations_whose_squares_are_no_numbers(rotation: list[float]) -> None:
    check_rotation(rotation)


def check_rotation(rotation: list[float]) -> None:
    matrix = transforms(np.ones((1, 3)), np.array([rotation]), np.ones((1, 3)))[0]
    assert np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3))
    assert np.linalg.det(matrix) == pytest.approx(1)


@pytest.mark.parametrize("scale", [[-1, 1, 1], [-1, -1, -1], [1, -2, 1], [-1, -1, 1], [1, 1, 1]])
def test_mirrored_nodes_keep_outward_faces(scale: list[float]) -> None:
    file = pyramid_file()
    file.root["nodes"][0]["scale"] = scale
    assert volume(read_mesh(file)) == pytest.approx(3 * abs(np.prod(scale)))


def test_a_mirror_in_a_mirror_is_none() -> None:
    nodes = [{"children": [1], "scale": [-1, 1, 1]}, {"mesh": 0, "scale": [1, 1, -1]}]
    file = pyramid_file(nodes=nodes)
    mesh = read_mesh(file)
    assert volume(mesh) == pytest.approx(3)
    assert np.array_equal(mesh.faces, read_mesh(pyramid_file()).faces)


def test_a_deep_chain_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    depth = 5000
    nodes: list[dict[str, Any]] = [{"children": [i + 1], "translation": [1, 0, 0]} for i in range(depth)]
    counted = []
    monkeypatch.setattr("meshtide_codec.mesh_files.gltf.nodes.numbers", _counting(counted))
    mesh = read_mesh(triangle_file(nodes=[*nodes, {"mesh": 0}]))
    assert np.array_equal(mesh.vertices, TRIANGLE + np.array([depth, 0, 0]))
    assert len(counted) == 3 * depth  # once for each part of each node


def _counting(counted: list[str]) -> Any:
    from meshtide_codec.mesh_files.gltf.document import numbers

    def count(row: Any, key: str, where: str, default: Any = None) -> list[float]:
        counted.append(where)
        return numbers(row, key, where, default)

    return count


def doubling(depth: int) -> list[dict[str, Any]]:
    """Nodes each of which shows the next one twice."""
    return [*({"children": [level + 1, level + 1]} for level in range(depth)), {"mesh": 0}]


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        (doubling(40), r"nodes\[1\] has two parents, nodes\[0\] and nodes\[0\]"),
        ([{"children": [2]}, {"children": [2]}, {"mesh": 0}], r"nodes\[2\] has two parents, nodes\[0\] and nodes\[1\]"),
        ([{"children": [1], "mesh": 0}, {"children": [0]}], r"nodes\[0\] is its own ancestor"),
        ([{"mesh": 0}, {"children": [1]}], r"nodes\[1\] is its own ancestor"),
        ([{"mesh": 0, "children": [7]}], r"nodes\[0\] has the child 7; the file has 1 nodes"),
        ([{"mesh": 0, "children": [-1]}], r"children of nodes\[0\] is not a number"),
        ([{"mesh": 0, "children": 1}], r"children of nodes\[0\] is not a list"),
        ([{"mesh": 7}], r"nodes\[0\] names meshes\[7\]; the file has 1 meshes"),
        ([{"mesh": 0, "matrix": [1] * 15}], r"matrix of nodes\[0\] is not a list of 16 numbers"),
        ([{"mesh": 0, "matrix": [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}], "last row is not 0 0 0 1"),
        ([{"mesh": 0, "scale": [1, 1]}], r"scale of nodes\[0\] is not a list of 3 numbers"),
        ([{"mesh": 0, "rotation": [0, 0, 0, "1"]}], "holds what is not a finite number"),
        ([{"scale": [1e200] * 3, "children": [1]}, {"scale": [1e200] * 3, "mesh": 0}], "matrix overflows"),
    ],
)
def test_nodes_that_form_no_trees_or_places_are_refused(nodes: list[dict[str, Any]], message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        read(triangle_file(nodes=nodes))


def test_many_nodes_of_one_mesh_are_counted_before_they_are_placed() -> None:
    nodes = [{"mesh": 0}] * 400
    file = triangle_file(nodes=nodes, scenes=[{"nodes": list(range(400))}])
    assert len(read(file, limits=FileLimits(vertices=1200)).mesh().faces) == 400
    with pytest.raises(MeshFileError, match="claims 1200 vertices; 1199"):
        read(file, limits=FileLimits(vertices=1199))


def test_the_default_scene_is_taken_and_told() -> None:
    nodes = [{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}]
    scenes = [{"nodes": [0]}, {"nodes": [1]}]
    scene = read(triangle_file(nodes=nodes, scenes=scenes, scene=1))
    assert np.array_equal(scene.mesh().vertices, TRIANGLE + np.array([5, 0, 0]))
    assert scene.notes == ("the file has 2 scenes: scene 1, its default, is taken",)
    assert len(scene.nodes) == 2


def test_without_a_default_the_first_scene_is_taken() -> None:
    nodes = [{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}]
    file = triangle_file(nodes=nodes, scenes=[{"nodes": [1]}, {"nodes": [0]}])
    del file.root["scene"]
    scene = read(file)
    assert scene.roots == (1,)
    assert scene.notes == ("the file has 2 scenes: scene 0, the first, is taken",)


def test_without_scenes_all_roots_are_taken_and_told() -> None:
    file = triangle_file(nodes=[{"children": [1]}, {"mesh": 0}, {"mesh": 0}])
    del file.root["scenes"]
    scene = read(file)
    assert scene.roots == (0, 2)
    assert scene.notes == ("the file has no scenes: all of its nodes are taken",)


def test_without_nodes_each_mesh_is_taken_once() -> None:
    file = triangle_file()
    del file.root["scenes"], file.root["nodes"]
    scene = read(file)
    assert len(scene.mesh().faces) == 1
    assert "no nodes" in scene.notes[0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scene": 3}, r"names scenes\[3\]; the file has 1 scenes"),
        ({"scene": "0"}, "scene of the file is not a number"),
        ({"scenes": [{"nodes": [4]}]}, r"scenes\[0\] shows nodes\[4\]; the file has 1 nodes"),
        ({"scenes": [{"nodes": {}}]}, r"nodes of scenes\[0\] is not a list"),
    ],
)
def test_scenes_that_show_what_is_not_there_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        read(triangle_file(**changes))


@pytest.mark.parametrize("named", [[0, 0], [0, 1], [1, 0], [0, 2], [2, 1, 0]])
def test_roots_that_hang_from_others_are_taken_once(named: list[int]) -> None:
    file = triangle_file(nodes=[{"children": [1]}, {"children": [2]}, {"mesh": 0}], scenes=[{"nodes": named}])
    scene = read(file)
    assert scene.roots == (0,)
    assert len(scene.mesh().faces) == 1
    assert "each is taken once" in scene.notes[0]


def instanced(parts: dict[str, tuple[Any, str]], **node: Any) -> GltfFile:
    file = pyramid_file()
    attributes = {
        name: file.accessor(values, dtype, normalized=dtype != "<f4") for name, (values, dtype) in parts.items()
    }
    file.root["nodes"] = [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}, **node}]
    return file


def test_instances_stand_in_the_coordinates_of_their_node() -> None:
    parts = {
        "TRANSLATION": ([[0, 0, 0], [9, 0, 0]], "<f4"),
        "ROTATION": ([[0, 0, 0, 127], [0, 0, 127, 0]], "<i1"),
        "SCALE": ([[1, 1, 1], [2, 2, -2]], "<f4"),
    }
    scene = read(instanced(parts, translation=[0, 0, 5]))
    mesh = scene.mesh()
    assert np.allclose(
        mesh.vertices, np.concatenate([PYRAMID + np.array([0, 0, 5]), PYRAMID * [-2, -2, -2] + [9, 0, 5]])
    )
    assert area(mesh) == pytest.approx(AREA * 5)
    assert len(scene.geometries) == 1
    assert scene.nodes[0].instances is not None


def test_no_instances_show_nothing() -> None:
    file = instanced({"TRANSLATION": (np.zeros((0, 3)), "<f4")})
    with pytest.raises(MeshFileError, match="shows no triangles"):
        read(file)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"TRANSLATION": ([[0, 0, 0]], "<f4"), "SCALE": ([[1, 1, 1]] * 2, "<f4")}, "attributes of 2 lengths"),
        ({}, "attributes of no lengths"),
        ({"TRANSLATION": ([[0, 0]], "<f4")}, "TRANSLATION of .* is of type VEC2"),
        ({"TRANSLATION": ([[np.nan, 0, 0]], "<f4")}, "holds what is not finite"),
    ],
)
def test_odd_instances_are_refused(parts: dict[str, Any], message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        read(instanced(parts))


def test_instances_are_counted_before_they_are_made() -> None:
    file = instanced({"TRANSLATION": ([[0, 0, 0]] * 100, "<f4")})
    with pytest.raises(MeshFileError, match="claims 500 vertices; 499"):
        read(file, limits=FileLimits(vertices=499))
    attributes = file.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]
    attributes["TRANSLATION"] = file.add("accessors", {"componentType": 5126, "count": 10**12, "type": "VEC3"})
    with pytest.raises(MeshFileError, match="claims 5000000000000 vertices"):
        read(file)


def test_what_a_node_says_beside_its_place_is_kept() -> None:
    extensions = {"KHR_lights_punctual": {"light": 0}}
    node = {"mesh": 0, "name": "here", "camera": 0, "extras": {"a": [1]}, "extensions": extensions}
    kept = read(triangle_file(nodes=[node])).nodes[0]
    assert kept.name == "here"
    assert kept.properties == {"camera": 0, "extras": {"a": [1]}, "extensions": extensions}


@pytest.mark.parametrize(("dtype", "kept"), [("<f4", np.float32), ("<i1", np.float32)])
def test_normals_of_nodes_that_are_moved_and_that_are_not_are_one_attribute(dtype: str, kept: type) -> None:
    file = pyramid_file()
    normal = file.accessor([[0, 0, 127]] * 5, dtype, stride=0 if dtype == "<f4" else 4, normalized=dtype != "<f4")
    file.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normal
    file.root["nodes"] = [{"mesh": 0, "rotation": TURN}, {"mesh": 0, "scale": [2, 2, -1]}]
    file.root["scenes"] = [{"nodes": [0, 1]}]
    (found,) = read_mesh(file).attributes
    assert found.values.dtype == kept
    assert np.allclose(found.values, [[0, 0, 1]] * 5 + [[0, 0, -1]] * 5)
