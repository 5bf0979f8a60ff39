"""Scenes: nodes that place geometries, and all of them as one mesh."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.attributes import NONE, UPPER_LEFT, Attribute, Domain, Kind
from meshtide_codec.mesh import Mesh
from meshtide_codec.scene import Node, Scene, joined, placed
from meshtide_codec.testing import grid, tetrahedron


def moved(x: float, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def scaled(x: float, y: float, z: float) -> np.ndarray:
    return np.diag([x, y, z, 1.0])


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float((np.cross(a, b) * c).sum() / 6)


def test_a_file_of_one_mesh_is_a_scene_of_one_node() -> None:
    scene = Scene.of(tetrahedron(), notes=["a line"])
    assert scene.mesh() is scene.geometries[0]
    assert scene.counts() == (4, 4)
    assert scene.notes == ("a line",)


def test_nodes_place_their_children_and_instances() -> None:
    nodes = (
        Node(None, scaled(2, 2, 2), (1, 2)),
        Node(0, moved(1), (3,)),
        Node(1, np.eye(4), (), np.stack([moved(0, 5), moved(0, 7)])),
        Node(0, moved(10)),
        Node(1, moved(100)),  # hangs from no root
    )
    scene = Scene((tetrahedron(), grid(3)), nodes, (0,))
    found = [(index, matrix[:3, 3].tolist(), matrix[0, 0]) for index, matrix in scene.placements()]
    assert found == [(0, [2, 0, 0], 2), (0, [22, 0, 0], 2), (1, [0, 10, 0], 2), (1, [0, 14, 0], 2)]
    assert scene.counts() == (2 * 4 + 2 * 9, 2 * 4 + 2 * 8)
    mesh = scene.mesh()
    assert (len(mesh.vertices), len(mesh.faces)) == scene.counts()
    assert mesh.vertices[4].tolist() == [22, 0, 0]


def test_no_node_no_mesh() -> None:
    mesh = Scene((tetrahedron(),)).mesh()
    assert (mesh.vertices.shape, mesh.faces.shape) == ((0, 3), (0, 3))
    assert Scene((tetrahedron(),)).counts() == (0, 0)


def test_a_long_chain_of_nodes_is_walked_without_recursion() -> None:
    nodes = [Node(None, moved(1), (i + 1,)) for i in range(20_000)]
    scene = Scene((tetrahedron(),), (*nodes, Node(0)), (0,))
    ((_, matrix),) = scene.placements()
    assert matrix[0, 3] == 20_000
    assert scene.counts() == (4, 4)


@given(st.lists(st.sampled_from([-2.0, -1.0, 0.5, 3.0]), min_size=3, max_size=3), st.integers(0, 2**32 - 1))
def test_faces_stay_outward_and_normals_upright_under_any_matrix(scale: list[float], seed: int) -> None:
    random = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3, :3] = (
        np.linalg.qr(random.normal(size=(3, 3)))[0] @ np.diag(scale) @ np.linalg.qr(random.normal(size=(3, 3)))[0]
    )
    matrix[:3, 3] = random.normal(size=3)
    mesh = tetrahedron()
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * 7
    attribute = Attribute("NORMAL", Kind.NORMAL, Domain.FACE, normals)
    found = placed(Mesh(mesh.vertices, mesh.faces, (attribute,)), matrix)
    assert volume(found) * np.sign(volume(mesh)) > 0 or np.allclose(found.vertices.mean(axis=0), 0)
    corners = found.vertices[found.faces]
    expected = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.allclose(found.attributes[0].values, expected)


def test_a_matrix_without_volume_or_of_huge_numbers_does_not_warn() -> None:
    normal = Attribute("NORMAL", Kind.NORMAL, Domain.VERTEX, np.eye(4, 3))
    mesh = Mesh(tetrahedron().vertices, tetrahedron().faces, (normal,))
    for matrix in (scaled(0, 0, 0), scaled(1e300, -1e300, 1e300), np.full((4, 4), np.nan), np.full((4, 4), np.inf)):
        assert placed(mesh, matrix).faces.shape == (4, 3)


def with_attributes(mesh: Mesh, *attributes: Attribute) -> Mesh:
    return Mesh.checked(mesh.vertices, mesh.faces, attributes)


def test_attributes_of_one_name_become_one() -> None:
    uv = Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.VERTEX, np.arange(8.0).reshape(4, 2))
    first = with_attributes(tetrahedron(), uv)
    (alike,) = joined([first, first]).attributes
    assert alike.indices is None
    assert alike.values.tolist() == uv.values.tolist() * 2
    lacking = joined([tetrahedron(), first])
    (partial,) = lacking.attributes
    assert partial.rows().tolist() == [NONE] * 4 + [0, 1, 2, 3]
    partial.check(8, 8)
    corner = Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, np.ones((2, 2)), np.full((4, 3), 1))
    face = Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.FACE, np.zeros((1, 2)), np.array([0, NONE, 0, NONE]))
    mixed = joined([first, with_attributes(tetrahedron(), corner), with_attributes(tetrahedron(), face)])
    (one,) = mixed.attributes
    one.check(12, 12)
    assert one.domain is Domain.CORNER
    assert one.per_element()[:12].tolist() == uv.values[first.faces.reshape(-1)].tolist()
    assert one.rows()[12:].tolist() == [5] * 12 + [6, 6, 6, NONE, NONE, NONE] * 2
    other = Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.VERTEX, np.zeros((4, 2), np.uint16), normalized=True)
    assert len(joined([first, with_attributes(tetrahedron(), other)]).attributes) == 2


def test_two_attributes_of_one_name_in_one_mesh_stay_two() -> None:
    twice = [Attribute("a", Kind.SCALAR, Domain.VERTEX, np.full((4, 1), value)) for value in (1.0, 2.0)]
    mesh = with_attributes(tetrahedron(), *twice)
    found = joined([mesh, tetrahedron(), mesh])
    assert [one.values.reshape(-1).tolist() for one in found.attributes] == [[1.0] * 8, [2.0] * 8]


def test_materials_and_polygons_of_some_are_kept() -> None:
    inner = np.array([[False, False, True], [True, False, False]])
    square = Mesh.checked(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], (), np.array([3, 3]), inner
    )
    mesh = joined([tetrahedron(), square, square])
    assert mesh.materials is not None
    assert mesh.materials.tolist() == [NONE] * 4 + [3] * 4
    assert mesh.polygons_as_lists()[4:] == [[4, 5, 6, 7], [8, 9, 10, 11]]


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_polygons_survive_a_mirror(mirror: float) -> None:
    inner = np.array([[False, False, True], [True, False, False]])
    square = Mesh.checked([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], polygons=inner)
    found = Scene((square,), (Node(0, scaled(mirror, 1, 1)),), (0,)).mesh()
    (outline,) = found.polygons_as_lists()
    points = found.vertices[outline, :2]
    following = np.roll(points, -1, axis=0)
    assert (points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]).sum() / 2 == pytest.approx(1)


@pytest.mark.parametrize("kind", ["f4", "f8", "i1"])
@pytest.mark.parametrize("scale", [(1, 1, 1), (2, 1, 1), (-1, 1, 1), (-1, -3, 1), (-1, -1, -1)])
def test_tangents_turn_with_the_surface_and_keep_their_side(kind: str, scale: tuple[int, int, int]) -> None:
    one = 127 if kind == "i1" else 1
    normals = np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0]], kind) * one
    tangents = np.array([[1, 0, 0, 1], [0, 0, 1, -1], [0, 1, 0, 1]], kind) * np.array(one, kind)
    attributes = [
        Attribute("NORMAL", Kind.NORMAL, Domain.VERTEX, normals, normalized=kind == "i1"),
        Attribute("TANGENT", Kind.SCALAR, Domain.VERTEX, tangents, normalized=kind == "i1"),
    ]
    mesh = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], attributes)
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    matrix = np.eye(4)
    matrix[:3, :3] = turn @ np.diag(scale)
    normal, tangent = (each.values for each in placed(mesh, matrix).attributes)
    if scale != (1, 1, 1):
        assert tangent.dtype == np.dtype("f4" if kind == "i1" else kind)
    assert np.allclose(np.linalg.norm(tangent[:, :3], axis=1), 1, atol=1e-6)
    before = np.cross(normals / one, tangents[:, :3] / one) * np.sign(tangents[:, 3:])
    after = np.cross(normal, tangent[:, :3]) * tangent[:, 3:]
    moved_before = before @ matrix[:3, :3].T
    moved_before /= np.linalg.norm(moved_before, axis=1, keepdims=True)
    assert np.allclose(after, moved_before, atol=1e-6)


def test_texture_coordinates_of_two_origins_are_joined_as_those_of_the_first() -> None:
    uv = np.array([[0.0, 0.1], [1, 0.25], [0, 1]], "f4")
    lower = Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.VERTEX, uv)
    upper = Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.VERTEX, uv, extra={"origin": UPPER_LEFT})
    meshes = [Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], [one]) for one in (lower, upper)]
    flipped = np.array([[0, np.float32(1) - uv[0, 1]], [1, 0.75], [0, 0]], "f4")
    for first, second in (meshes, meshes[::-1]):
        (found,) = joined([first, second]).attributes
        assert np.array_equal(found.values, np.concatenate([uv, flipped]))
        assert found.extra == first.attributes[0].extra
    (same,) = joined([meshes[1], meshes[1]]).attributes
    assert np.array_equal(same.values, np.concatenate([uv, uv]))
