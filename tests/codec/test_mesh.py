from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.attributes import Attribute, Domain, Kind
from meshtide_codec.errors import MeshError
from meshtide_codec.mesh import Mesh, canonical_faces
from meshtide_codec.mesh_files.polygons import triangulated

CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        ([], [], "shape"),
        (np.zeros((0, 3)), [], "no vertices"),
        ([[0, 0]], [], "vertices must have shape"),
        (CORNERS, [[0, 1]], "faces must have shape"),
        (CORNERS, [[0, 1, 3]], "face 0 names vertex 3"),
        (CORNERS, [[0, 1, 2], [0, -1, 2]], "face 1 names vertex -1"),
        ([*CORNERS, [0, np.nan, 0]], [[0, 1, 2]], "vertex 3 is not finite"),
        ([[0, 0, np.inf]], [], "vertex 0 is not finite"),
        (CORNERS, [[0.0, 1.0, 2.0]], "must be integers"),
        ([["a", "b", "c"]], [], "not numeric"),
        ([[0, 0, 0], [1, 2]], [], "not numeric"),
    ],
)
def test_unusable_arrays_are_refused(vertices: object, faces: object, message: str) -> None:
    with pytest.raises(MeshError, match=message):
        Mesh.checked(vertices, faces)  # type: ignore[arg-type]


def test_any_numeric_type_becomes_the_standard_one() -> None:
    mesh = Mesh.checked(np.array(CORNERS, np.float32), np.array([[0, 1, 2]], np.uint8))
    assert mesh.vertices.dtype == np.float64
    assert mesh.faces.dtype == np.int64
    assert repr(mesh) == "Mesh(3 vertices, 1 faces)"
    assert mesh.diagonal == pytest.approx(2**0.5)


def test_points_without_faces_all_stay_referenced() -> None:
    mesh = Mesh.checked(CORNERS, [])
    assert mesh.referenced() is mesh


def test_referenced_keeps_order_and_positions() -> None:
    mesh = Mesh.checked([*CORNERS, [9, 9, 9], [0, 0, 1]], [[4, 0, 2]])
    kept = mesh.referenced()
    assert kept.vertices.tolist() == [[0, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert kept.faces.tolist() == [[2, 0, 1]]


@given(st.lists(st.tuples(*[st.integers(0, 6)] * 3), max_size=40), st.randoms())
def test_canonical_faces_is_the_set_of_oriented_triangles(rows: list[tuple[int, int, int]], random: object) -> None:
    faces = np.array(rows, np.int64).reshape(-1, 3)
    expected = sorted({min((a, b, c), (b, c, a), (c, a, b)) for a, b, c in rows if len({a, b, c}) == 3})
    assert [tuple(row) for row in canonical_faces(faces).tolist()] == expected
    turned = np.array([np.roll(row, random.randint(0, 2)) for row in faces]).reshape(-1, 3)  # type: ignore[attr-defined]
    shuffled = turned[np.random.default_rng(len(rows)).permutation(len(turned))].astype(np.int32)
    again = canonical_faces(shuffled)
    assert again.dtype == np.int32
    assert np.array_equal(again, canonical_faces(faces))


def test_canonical_faces_of_large_indices_take_the_other_way() -> None:
    large = 1 << 22
    faces = np.array([[large, 1, 2], [1, 2, large], [2, 1, large], [5, 5, 6]])
    assert canonical_faces(faces).tolist() == [[1, 2, large], [1, large, 2]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"materials": np.zeros(2, np.int64)}, "materials must have shape .1,., not .2,."),
        ({"polygons": np.zeros((1, 2), bool)}, "polygons must have shape .1, 3., not .1, 2."),
        ({"attributes": [Attribute("a", Kind.SCALAR, Domain.FACE, np.zeros((3, 1)))]}, "'a': 3 values for 1 elements"),
    ],
)
def test_what_stands_beside_the_faces_has_their_number(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(MeshError, match=message):
        Mesh.checked(CORNERS, [[0, 1, 2]], **changes)


def mixed() -> Mesh:
    """A hexagon, a triangle and a square, their corners' values and materials, and a vertex that none uses."""
    outlines = [[0, 1, 2, 3, 4, 5], [5, 4, 6], [4, 3, 8, 7]]
    angles = np.arange(6) * np.pi / 3
    points = np.zeros((10, 3))
    points[:6, :2] = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points[6:] = np.random.default_rng(4).random((4, 3))
    cut = triangulated(points, np.array([6, 3, 4]), np.concatenate(outlines))
    flat = np.concatenate(outlines)
    attributes = [
        Attribute("corners", Kind.TEXCOORD, Domain.CORNER, np.arange(13.0)[:, None], cut.corners),
        Attribute("flat", Kind.SCALAR, Domain.CORNER, cut.corners.reshape(-1, 1) * 2.0),
        Attribute("faces", Kind.LABEL, Domain.FACE, cut.polygon[:, None]),
        Attribute("vertices", Kind.SCALAR, Domain.VERTEX, points[:, :1]),
    ]
    return Mesh.checked(points, flat[cut.corners], attributes, cut.polygon, cut.inner)


def named(mesh: Mesh, name: str) -> Attribute:
    return next(one for one in mesh.attributes if one.name == name)


def test_polygons_are_given_back_with_the_values_of_their_corners() -> None:
    mesh = mixed()
    assert [sorted(one) for one in mesh.polygons_as_lists()] == [[0, 1, 2, 3, 4, 5], [4, 5, 6], [3, 4, 7, 8]]
    rows = named(mesh, "corners").rows()
    assert [sorted(rows[one].tolist()) for one in mesh.polygon_corners()] == [
        [0, 1, 2, 3, 4, 5],
        [6, 7, 8],
        [9, 10, 11, 12],
    ]
    corners, counts = mesh.outlines()
    assert counts.tolist() == [6, 3, 4]
    assert corners.tolist() == np.concatenate(mesh.polygon_corners()).tolist()


def test_turned_round_all_goes_the_other_way() -> None:
    mesh = mixed()
    turned = mesh.reversed()
    assert [rotated(one[::-1]) for one in turned.polygons_as_lists()] == [
        rotated(one) for one in mesh.polygons_as_lists()
    ]
    for one in mesh.attributes:
        other = named(turned, one.name)
        other.check(10, len(mesh.faces))
        if one.domain is Domain.CORNER:
            of_vertex = dict(zip(mesh.faces[0].tolist(), one.per_element()[:3].tolist(), strict=True))
            assert [of_vertex[v] for v in turned.faces[0].tolist()] == other.per_element()[:3].tolist()
    twice = turned.reversed()
    assert np.array_equal(twice.faces, mesh.faces)
    assert np.array_equal(twice.polygons, mesh.polygons)  # type: ignore[arg-type]


def rotated(polygon: list[int]) -> list[int]:
    first = polygon.index(min(polygon))
    return polygon[first:] + polygon[:first]


def test_vertices_and_faces_that_stay_keep_their_values() -> None:
    mesh = mixed()
    fewer = mesh.referenced()
    assert (len(fewer.vertices), len(named(fewer, "vertices").values)) == (9, 9)
    kept = np.asarray(mesh.materials) == 2
    part = mesh.with_faces(kept)
    assert [sorted(one) for one in part.polygons_as_lists()] == [[3, 4, 7, 8]]
    assert part.materials is not None
    assert part.materials.tolist() == [2, 2]
    assert named(part, "faces").values.tolist() == [[2], [2]]
    assert named(part, "flat").values.reshape(-1).tolist() == (named(part, "corners").rows() * 2.0).tolist()
    for one in part.attributes:
        one.check(10, 2)


def test_edges_marked_all_around_a_vertex_are_refused() -> None:
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, -1, 0]]
    inner = np.array([[True, False, True]] * 3)
    mesh = Mesh.checked(points, [[0, 1, 2], [0, 2, 3], [0, 3, 1]], polygons=inner)
    with pytest.raises(MeshError, match="all edges around a vertex"):
        mesh.polygons_as_lists()


def test_marks_without_another_side_are_edges_of_the_outline() -> None:
    mesh = Mesh.checked(CORNERS, [[0, 1, 2]], polygons=np.ones((1, 3), bool))
    assert mesh.polygons_as_lists() == [[0, 1, 2]]
    assert Mesh.checked(CORNERS, [], polygons=np.zeros((0, 3), bool)).polygons_as_lists() == []


def test_a_polygon_of_many_corners_takes_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    size = 3000
    spans = np.arange(size - 2)
    faces = np.stack([0 * spans, spans + 1, spans + 2], axis=1)
    inner = np.ones((size - 2, 3), bool)
    inner[:, 1] = inner[0, 0] = inner[-1, 2] = False
    mesh = Mesh.checked(np.random.default_rng(0).random((size, 3)), faces, polygons=inner)
    steps = []
    monkeypatch.setattr(np, "minimum", lambda *arrays, original=np.minimum: steps.append(1) or original(*arrays))
    assert mesh.polygons_as_lists() == [list(range(size))]
    assert len(steps) <= 20
