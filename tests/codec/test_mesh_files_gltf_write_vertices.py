"""Meshes as glTF holds them: wedges, faces that lack an attribute, names and types."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.attributes import UPPER_LEFT, Attribute, Domain, Kind
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.gltf.write_vertices import Losses, Part, parts
from meshtide_codec.testing import grid

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def square(*attributes: Attribute, **more: Any) -> Mesh:
    return Mesh.checked(SQUARE, HALVES, attributes, **more)


def corner_values(part: Part, name: str) -> Any:
    values = next(one.values for one in part.attributes if one.name == name)
    return np.concatenate([values[faces] for _, faces in part.primitives])


def test_a_plain_mesh_keeps_its_vertices_in_their_order() -> None:
    losses = Losses()
    (part,) = parts(square(), "x", losses)
    assert np.array_equal(part.positions, SQUARE)
    assert part.primitives[0][0] == -1
    assert np.array_equal(part.primitives[0][1], HALVES)
    assert losses.notes() == ()


def test_corners_that_differ_split_their_vertex_and_others_do_not() -> None:
    values = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
    seam = Attribute(
        "uv", Kind.TEXCOORD, Domain.CORNER, values, np.array([[0, 1, 2], [4, 2, 3]]), extra={"origin": UPPER_LEFT}
    )
    (part,) = parts(square(seam), "x", Losses())
    assert len(part.positions) == 5
    faces = part.primitives[0][1]
    assert np.array_equal(part.positions[faces], SQUARE[HALVES])
    assert np.array_equal(corner_values(part, "TEXCOORD_0"), values[[[0, 1, 2], [4, 2, 3]]])


def test_values_of_faces_go_to_their_corners() -> None:
    colors = Attribute(
        "color", Kind.COLOR, Domain.FACE, np.array([[255, 0, 0], [0, 255, 0]], np.uint8), normalized=True
    )
    (part,) = parts(square(colors), "x", Losses())
    assert len(part.positions) == 6
    assert corner_values(part, "COLOR_0").tolist() == [[[255, 0, 0]] * 3, [[0, 255, 0]] * 3]


def test_faces_that_lack_an_attribute_stand_on_vertices_of_their_own() -> None:
    rows = np.array([[-1, -1, -1], [0, 1, 2]])
    seam = Attribute("uv", Kind.TEXCOORD, Domain.CORNER, np.eye(3)[:, :2], rows)
    found = parts(square(seam), "x", Losses())
    assert [[one.name for one in part.attributes] for part in found] == [["TEXCOORD_0"], []]
    assert [len(part.positions) for part in found] == [3, 3]
    assert np.array_equal(found[1].positions[found[1].primitives[0][1]], SQUARE[HALVES[:1]])


def test_faces_that_have_it_at_some_corners_get_zeros_and_it_is_told() -> None:
    losses = Losses()
    seam = Attribute(
        "uv",
        Kind.TEXCOORD,
        Domain.CORNER,
        np.ones((1, 2)),
        np.array([[0, 0, -1], [0, 0, 0]]),
        extra={"origin": UPPER_LEFT},
    )
    (part,) = parts(square(seam), "x", losses)
    assert corner_values(part, "TEXCOORD_0")[0].tolist() == [[1, 1], [1, 1], [0, 0]]
    assert losses.notes() == ("TEXCOORD_0: some faces have it at some corners only; zeros stand at the others",)


def test_materials_become_primitives_on_the_same_vertices() -> None:
    (part,) = parts(square(materials=np.array([3, 1])), "x", Losses())
    assert [(material, faces.tolist()) for material, faces in part.primitives] == [(1, [[0, 2, 3]]), (3, [[0, 1, 2]])]


def test_rounding_is_told_once_with_its_largest_error() -> None:
    losses = Losses()
    for scale in (0.1, 1000.1):
        parts(Mesh.checked(SQUARE * scale, HALVES), "x", losses)
    expected = abs(float(np.float32(9 * 1000.1)) - 9 * 1000.1)
    assert losses.notes() == (f"positions: rounded to 32-bit floats, by {expected:.3g} at most",)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_positions_beyond_all_numbers_are_refused(value: float) -> None:
    vertices = SQUARE.copy()
    vertices[2, 1] = value
    with pytest.raises(MeshFileError, match="vertex 2 of x is not a number of 32 bits"):
        parts(Mesh(vertices, HALVES), "x", Losses())


@pytest.mark.parametrize(
    ("name", "kind", "dtype", "normalized", "width", "written"),
    [
        ("TEXCOORD_3", Kind.TEXCOORD, "f8", False, 2, ("TEXCOORD_3", "<f4", False)),
        ("uv", Kind.TEXCOORD, "u2", True, 2, ("TEXCOORD_0", "<u2", True)),
        ("uv", Kind.TEXCOORD, "f4", False, 3, ("_uv", "<f4", False)),
        ("rgb", Kind.COLOR, "u1", True, 3, ("COLOR_0", "|u1", True)),
        ("rgb", Kind.COLOR, "u1", False, 3, ("_rgb", "|u1", False)),
        ("rgb", Kind.COLOR, "i1", True, 3, ("COLOR_0", "<f4", False)),
        ("rgb", Kind.COLOR, "f8", False, 2, ("_rgb", "<f4", False)),
        ("normal", Kind.NORMAL, "i2", True, 3, ("NORMAL", "<i2", True)),
        ("normal", Kind.NORMAL, "u2", False, 3, ("NORMAL", "<f4", False)),
        ("JOINTS_0", Kind.SCALAR, "u2", False, 4, ("JOINTS_0", "<u2", False)),
        ("WEIGHTS_0", Kind.SCALAR, "u1", True, 4, ("WEIGHTS_0", "|u1", True)),
        ("TANGENT", Kind.SCALAR, "f4", False, 4, ("TANGENT", "<f4", False)),
        ("TANGENT", Kind.SCALAR, "f4", False, 3, ("_TANGENT", "<f4", False)),
        ("quality", Kind.SCALAR, ">f8", False, 1, ("_quality", "<f4", False)),
        ("_FEATURE_ID_0", Kind.SCALAR, "u4", False, 1, ("_FEATURE_ID_0", "<f4", False)),
        ("label", Kind.LABEL, ">i2", False, 1, ("_label", "<i2", False)),
    ],
)
def test_names_and_types_are_those_of_gltf(
    name: str, kind: Kind, dtype: str, normalized: bool, width: int, written: tuple[str, str, bool]
) -> None:
    values = np.ones((5, width), dtype)
    (part,) = parts(square(Attribute(name, kind, Domain.VERTEX, values, normalized=normalized)), "x", Losses())
    one = part.attributes[0]
    assert (one.name, one.values.dtype.newbyteorder("<").str, one.normalized) == written


def test_names_that_meet_are_kept_apart() -> None:
    names = ["uv", "TEXCOORD_0", "uv", "a", "_a", "a", "NORMAL"]
    kinds = [Kind.TEXCOORD] * 3 + [Kind.SCALAR] * 3 + [Kind.NORMAL]
    widths = [2, 2, 2, 1, 1, 1, 3]
    given_ = [
        Attribute(name, kind, Domain.VERTEX, np.ones((5, width), "f4"))
        for name, kind, width in zip(names, kinds, widths, strict=True)
    ]
    normals = Attribute("other", Kind.NORMAL, Domain.VERTEX, np.ones((5, 3), "f4"))
    (part,) = parts(square(*given_, normals), "x", Losses())
    written = [one.name for one in part.attributes]
    assert written == ["TEXCOORD_1", "TEXCOORD_0", "TEXCOORD_2", "_a", "_a_1", "_a_2", "NORMAL", "_other"]


def test_five_components_are_left_out() -> None:
    losses = Losses()
    five = Attribute("five", Kind.SCALAR, Domain.VERTEX, np.ones((5, 5)))
    (part,) = parts(square(five), "x", losses)
    assert part.attributes == ()
    assert losses.attributes == [five]


def test_integers_that_floats_cannot_hold_are_told() -> None:
    losses = Losses()
    values = np.array([[0], [1], [2], [3], [2**31 + 1]], np.uint32)
    parts(square(Attribute("_ID", Kind.LABEL, Domain.VERTEX, values)), "x", losses)
    assert losses.notes() == ("_ID: rounded to 32-bit floats, by 1 at most",)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_every_corner_keeps_its_values(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = grid(5)
    faces = len(mesh.faces)
    rows = rng.integers(0, 6, (faces, 3))
    rows[rng.random(faces) < 0.3] = -1
    attributes = (
        Attribute(
            "uv", Kind.TEXCOORD, Domain.CORNER, rng.random((6, 2)).astype("f4"), rows, extra={"origin": UPPER_LEFT}
        ),
        Attribute("n", Kind.NORMAL, Domain.VERTEX, rng.random((25, 3)).astype("f4")),
        Attribute("f", Kind.SCALAR, Domain.FACE, rng.random((faces, 1)).astype("f4")),
    )
    mesh = Mesh.checked(mesh.vertices, mesh.faces, attributes, rng.integers(-1, 3, faces))
    found = []
    for part in parts(mesh, "x", Losses()):
        for material, corners in part.primitives:
            tables = {one.name: one.values for one in part.attributes}
            uv = tables.get("TEXCOORD_0", np.full((len(part.positions), 2), -1))
            columns = [part.positions, uv, tables["NORMAL"], tables["_f"]]
            rows_of = np.concatenate(columns, axis=1)[corners].reshape(len(corners), -1)
            found += [(material, *row) for row in rows_of.tolist()]
    wanted = []
    for face in range(faces):
        corners = mesh.faces[face]
        uv = np.where(rows[face][:, None] >= 0, attributes[0].values[rows[face]], -1)
        normal, scalar = attributes[1].values[corners], np.repeat(attributes[2].values[face : face + 1], 3, axis=0)
        row = np.concatenate([mesh.vertices[corners].astype("f4"), uv, normal, scalar], axis=1)
        wanted.append((int(mesh.materials[face]) if mesh.materials is not None else -1, *row.reshape(-1).tolist()))
    assert sorted(found) == sorted(wanted)
