from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import MeshError
from meshtide_codec.mesh import Mesh, canonical_faces

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
