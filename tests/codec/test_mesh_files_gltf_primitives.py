"""Primitives: triangles, strips, fans, with indices and without; points and lines beside them; odd ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gltf_files import AREA, PYRAMID, PYRAMID_FACES, TRIANGLE, GltfFile, area, read, read_mesh, triangle_file
from meshtide_codec.errors import MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import canonical_faces


def indexed(indices: Any, dtype: str = "<u2", mode: int | None = 4, points: Any = PYRAMID) -> GltfFile:
    file = GltfFile()
    primitive = {"attributes": {"POSITION": file.accessor(points, "<f4")}}
    if indices is not None:
        primitive["indices"] = file.accessor(indices, dtype)
    file.mesh(primitive if mode is None else primitive | {"mode": mode})
    return file.shown({"mesh": 0})


@pytest.mark.parametrize("dtype", ["<u1", "<u2", "<u4"])
@pytest.mark.parametrize("mode", [4, None])
def test_triangles_keep_order_and_corners(dtype: str, mode: int | None) -> None:
    mesh = read_mesh(indexed(PYRAMID_FACES.reshape(-1), dtype, mode))
    assert np.array_equal(mesh.faces, PYRAMID_FACES)
    assert np.array_equal(mesh.vertices, PYRAMID)
    assert area(mesh) == pytest.approx(AREA)


def test_triangles_without_indices_stand_in_order() -> None:
    assert read_mesh(indexed(None, points=np.arange(21).reshape(7, 3))).faces.tolist() == [[0, 1, 2], [3, 4, 5]]


@pytest.mark.parametrize(
    ("mode", "indices", "faces"),
    [
        (5, [0, 1, 2, 3, 4], [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
        (5, None, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
        (5, [0, 1, 2, 2, 3, 3, 4], [[0, 1, 2]]),
        (6, [4, 0, 1, 2], [[0, 1, 4], [1, 2, 4]]),
        (6, None, [[1, 2, 0], [2, 3, 0], [3, 4, 0]]),
        (6, [0, 1, 1, 2], [[1, 2, 0]]),
    ],
)
def test_strips_turn_every_second_triangle_and_fans_none(mode: int, indices: Any, faces: Any) -> None:
    assert read(indexed(indices, mode=mode)).geometries[0].faces.tolist() == faces


@given(st.lists(st.integers(0, 4), min_size=3, max_size=30))
def test_strips_are_the_triangles_that_the_specification_lists(indices: list[int]) -> None:
    expected = [
        [indices[i], indices[i + 1 + i % 2], indices[i + 2 - i % 2]]
        for i in range(len(indices) - 2)
        if len({indices[i], indices[i + 1], indices[i + 2]}) == 3
    ]
    assert read(indexed(indices, mode=5)).geometries[0].faces.tolist() == expected


def test_triangles_of_one_line_stay_as_the_file_has_them() -> None:
    assert read_mesh(indexed([0, 0, 1, 0, 1, 2])).faces.tolist() == [[0, 0, 1], [0, 1, 2]]


@pytest.mark.parametrize(
    ("indices", "dtype", "message"),
    [
        ([0, 1, 5], "<u2", r"accessors\[1\] holds index 5, but meshes\[0\].primitives\[0\] has 5 vertices$"),
        ([0, 1, 65535], "<u2", "index 65535, .* would restart a strip"),
        ([0, 1, 2**32 - 1], "<u4", "index 4294967295, .* would restart"),
        ([0, 1, 255], "<u1", "index 255, .* would restart"),
        ([0, 1, 2], "<i2", r"accessors\[1\], the indices .*, are not unsigned integers"),
        ([0, 1, 2], "<f4", "are not unsigned integers"),
        ([[0, 1, 2]], "<u2", "are not unsigned integers"),
    ],
)
def test_indices_out_of_range_name_their_accessor(indices: Any, dtype: str, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        read(indexed(indices, dtype))


def test_the_largest_index_may_be_one_that_restarts_if_there_is_such_a_vertex() -> None:
    points = np.random.default_rng(0).random((256, 3))
    assert read_mesh(indexed([0, 1, 255], "<u1", points=points)).faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mode": 7}, r"meshes\[0\].primitives\[0\] is of an unknown mode: 7"),
        ({"mode": [5]}, r"mode of meshes\[0\].primitives\[0\] is not a number from 0 on"),
        ({"attributes": {}}, "has no POSITION"),
        ({"attributes": []}, "attributes of .* is not an object"),
        ({"attributes": {"POSITION": 9}}, r"names accessors\[9\]; the file has 1 accessors"),
        ({"attributes": {"POSITION": "0"}}, "POSITION of .* is not a number"),
        ({"indices": 9}, r"names accessors\[9\]"),
        ({"material": 0}, "has material 0; the file has 0"),
        ({"targets": [3]}, "targets of .* is not a list of objects"),
        ({"extensions": []}, "extensions of .* is not an object"),
    ],
)
def test_odd_primitives_are_refused_by_name(changes: dict[str, Any], message: str) -> None:
    file = triangle_file()
    file.root["meshes"][0]["primitives"][0] |= changes
    with pytest.raises(MeshFileError, match=message):
        read(file)


def test_positions_of_another_shape_are_refused() -> None:
    file = triangle_file()
    file.root["accessors"][0] |= {"type": "VEC2"}
    with pytest.raises(MeshFileError, match="the positions of .*, is of type VEC2"):
        read(file)


def test_lines_and_points_beside_triangles_are_told_once() -> None:
    file = triangle_file()
    plain = file.root["meshes"][0]["primitives"][0]
    file.root["meshes"][0]["primitives"] += [{**plain, "mode": mode} for mode in (0, 1, 2, 3)]
    scene = read(file)
    assert len(scene.mesh().faces) == 1
    assert scene.notes == ("lines (3 primitives), points (1 primitive): left out",)


def test_a_file_of_lines_and_points_alone_is_an_error() -> None:
    file = triangle_file()
    plain = file.root["meshes"][0]["primitives"][0]
    file.root["meshes"][0]["primitives"] = [{**plain, "mode": 0}, {**plain, "mode": 3}]
    with pytest.raises(MeshFileError, match=r"no triangles in it, only lines \(1 primitive\), points \(1 primitive\)"):
        read(file)


def test_a_scene_without_faces_is_an_error() -> None:
    with pytest.raises(MeshFileError, match="shows no triangles"):
        read(indexed([0, 1], "<u2"))
    file = triangle_file()
    file.root["scenes"] = [{}]
    with pytest.raises(MeshFileError, match="shows no triangles"):
        read(file)


def test_claims_are_held_against_the_limits() -> None:
    file = indexed(PYRAMID_FACES.reshape(-1))
    with pytest.raises(MeshFileError, match=r"claims 5 vertices; 4 are the most that is read \(FileLimits.vertices\)"):
        read(file, limits=FileLimits(vertices=4))
    with pytest.raises(MeshFileError, match="claims 6 faces; 5 are the most"):
        read(file, limits=FileLimits(faces=5))


def test_many_meshes_of_one_accessor_are_counted_before_they_are_made() -> None:
    file = GltfFile()
    position = file.accessor(np.zeros((3000, 3)), "<f4")
    for _ in range(1000):
        file.mesh({"attributes": {"POSITION": position}})
    file.shown({"mesh": 0})
    with pytest.raises(MeshFileError, match="claims 3000000 vertices"):
        read(file, limits=FileLimits(vertices=100_000))


def test_a_strip_covers_the_same_surface_as_its_triangles() -> None:
    strip = read_mesh(indexed([0, 1, 3, 2], mode=5))
    plain = read_mesh(indexed([0, 1, 3, 1, 2, 3]))
    assert np.array_equal(canonical_faces(strip.faces), canonical_faces(plain.faces))
    assert np.array_equal(TRIANGLE[0], strip.vertices[0])
