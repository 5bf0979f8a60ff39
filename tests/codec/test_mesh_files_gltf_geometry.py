"""Meshes of primitives: shared vertices, the order of faces, attributes that some lack, materials."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gltf_files import PYRAMID, PYRAMID_FACES, TRIANGLE, GltfFile, read, read_mesh, refusal_peak
from meshtide_codec.attributes import Kind
from meshtide_codec.errors import MeshFileError


def attributed(tables: dict[str, tuple[Any, str]], **more: Any) -> GltfFile:
    file = GltfFile()
    attributes = {"POSITION": file.accessor(TRIANGLE)}
    for name, (values, dtype) in tables.items():
        attributes[name] = file.accessor(values, dtype, **more)
    file.mesh({"attributes": attributes})
    return file.shown({"mesh": 0})


@pytest.mark.parametrize(
    ("name", "width", "dtype", "kind"),
    [
        ("NORMAL", 3, "<f4", Kind.NORMAL),
        ("NORMAL", 3, "<i1", Kind.NORMAL),
        ("TANGENT", 4, "<f4", Kind.SCALAR),
        ("TEXCOORD_0", 2, "<f4", Kind.TEXCOORD),
        ("TEXCOORD_7", 2, "<u2", Kind.TEXCOORD),
        ("COLOR_0", 3, "<f4", Kind.COLOR),
        ("COLOR_1", 4, "<u1", Kind.COLOR),
        ("JOINTS_0", 4, "<u2", Kind.SCALAR),
        ("WEIGHTS_0", 4, "<u1", Kind.SCALAR),
        ("_TEMPERATURE", 1, "<i2", Kind.SCALAR),
        ("_FEATURE_ID_0", 1, "<u4", Kind.SCALAR),
    ],
)
@pytest.mark.parametrize("normalized", [True, False])
def test_attributes_keep_name_type_and_normalization(
    name: str, width: int, dtype: str, kind: Kind, normalized: bool
) -> None:
    values = np.arange(3 * width).reshape(3, width).astype(dtype)
    mesh = read_mesh(attributed({name: (values, dtype)}, normalized=normalized))
    assert len(mesh.attributes) == 1
    found = mesh.attributes[0]
    assert (found.name, found.kind, found.values.dtype) == (name, kind, values.dtype)
    assert found.normalized is (normalized and dtype != "<f4")
    assert np.array_equal(found.values, values)
    assert found.indices is None


def test_attributes_of_another_length_are_refused() -> None:
    with pytest.raises(MeshFileError, match=r"accessors\[1\], NORMAL of .*, has 4 elements for 3 vertices"):
        read(attributed({"NORMAL": ([[0, 0, 1]] * 4, "<f4")}))


def split(*faces: Any, attributes: Any = None, materials: Any = None) -> GltfFile:
    """The pyramid as primitives; of each its faces, whether it has normals, its material."""
    file = GltfFile()
    position, normal = file.accessor(PYRAMID), file.accessor([[0, 0, 1]] * 5, "<f4")
    primitives = []
    for number, chosen in enumerate(faces):
        given = {"POSITION": position}
        if attributes is None or attributes[number]:
            given["NORMAL"] = normal
        indices = file.accessor(PYRAMID_FACES[chosen].reshape(-1), "<u2")
        primitives.append({"attributes": given, "indices": indices})
        if materials is not None and materials[number] >= 0:
            primitives[-1]["material"] = materials[number]
    file.mesh(*primitives, name="pyramid")
    for name in ("a", "b"):
        file.add("materials", {"name": name})
    return file.shown({"mesh": 0})


def test_primitives_on_the_same_vertices_share_them() -> None:
    scene = read(split([0, 1], [2, 3], [4, 5], materials=[1, -1, 0]))
    mesh = scene.mesh()
    assert np.array_equal(mesh.vertices, PYRAMID)
    assert np.array_equal(mesh.faces, PYRAMID_FACES)
    assert mesh.materials is not None
    assert mesh.materials.tolist() == [1, 1, -1, -1, 0, 0]
    assert scene.names == ("pyramid",)


def test_without_any_material_there_is_no_table_of_them() -> None:
    assert read(split([0, 1], [2])).mesh().materials is None


def test_an_attribute_that_a_primitive_lacks_has_no_rows_there_and_faces_keep_their_order() -> None:
    mesh = read(split([0, 1], [2, 3], [4, 5], attributes=[True, False, True], materials=[0, 1, 0])).mesh()
    assert len(mesh.vertices) == 10
    assert np.array_equal(mesh.vertices[mesh.faces], PYRAMID[PYRAMID_FACES])
    assert mesh.materials is not None
    assert mesh.materials.tolist() == [0, 0, 1, 1, 0, 0]
    normals = mesh.attributes[0]
    assert normals.indices is not None
    assert (normals.indices[mesh.faces] == -1).all(axis=1).tolist() == [False, False, True, True, False, False]
    normals.check(10, 6)


def test_meshes_on_one_accessor_take_the_vertices_of_their_faces() -> None:
    file = GltfFile()
    points = np.arange(3000).reshape(1000, 3)
    position, color = file.accessor(points, "<f4"), file.accessor(np.arange(1000)[:, None], "<u2")
    for first in (0, 500):
        indices = file.accessor([first + 2, first, first + 1, first + 2, first + 1, first + 9], "<u2")
        file.mesh({"attributes": {"POSITION": position, "_N": color}, "indices": indices})
    scene = read(file.shown({"mesh": 0}, {"mesh": 1}))
    second = scene.geometries[1]
    assert [len(geometry.vertices) for geometry in scene.geometries] == [4, 4]
    assert np.array_equal(second.vertices, points[[500, 501, 502, 509]])
    assert second.faces.tolist() == [[2, 0, 1], [2, 1, 3]]
    assert second.attributes[0].values.reshape(-1).tolist() == [500, 501, 502, 509]


def test_a_mesh_of_its_own_accessor_keeps_all_vertices() -> None:
    file = GltfFile()
    position = file.accessor(np.arange(30).reshape(10, 3), "<f4")
    file.mesh({"attributes": {"POSITION": position}, "indices": file.accessor([2, 0, 1], "<u2")})
    assert len(read(file.shown({"mesh": 0})).geometries[0].vertices) == 10


def test_many_meshes_of_one_large_accessor_cost_only_what_they_use() -> None:
    """A thousand times 20 000 vertices would be 480 MB."""
    import tracemalloc

    file = GltfFile()
    position = file.accessor(np.zeros((20_000, 3)), "<f4")
    indices = file.accessor([0, 1, 2], "<u2")
    for _ in range(1000):
        file.mesh({"attributes": {"POSITION": position}, "indices": indices})
    data = file.shown(*({"mesh": i} for i in range(1000))).glb()
    tracemalloc.start()
    scene = read(data)
    assert tracemalloc.get_traced_memory()[1] < 30_000_000
    tracemalloc.stop()
    assert scene.counts() == (3000, 1000)


def test_attributes_without_number_do_not_multiply_the_file() -> None:
    file = GltfFile()
    position, other = file.accessor(np.zeros((9999, 3)), "<f4"), file.accessor(np.zeros((9999, 3)), "<f4")
    many = {f"_{i}": position for i in range(1000)}
    file.mesh({"attributes": {"POSITION": position, **many}}, {"attributes": {"POSITION": other}})
    assert refusal_peak(file.shown({"mesh": 0}).glb(), r"meshes\[0\] makes .* bytes, more than a file of") < 20_000_000


def test_values_of_a_mesh_of_one_group_are_not_copied() -> None:
    data = attributed({"_N": (np.arange(3)[:, None], "<u4")}).glb()
    values = read(data).geometries[0].attributes[0].values
    assert np.shares_memory(values, np.frombuffer(data, np.uint8))
