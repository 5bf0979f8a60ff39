"""Faces of PLY files: lists of vertices by many names and types, strips, and what faces carry."""

from __future__ import annotations

import functools
import operator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.attributes import NONE, Domain, Kind
from meshtide_codec.errors import MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files import polygons
from meshtide_codec.mesh_files.ply import faces as ply_faces
from meshtide_codec.mesh_files.ply.faces import index_list, indices_of, triangles_of_strips
from meshtide_codec.mesh_files.ply.rows import Columns, ListColumn
from ply_files import FORMS, INTEGERS, SQUARE, Element, face, mesh_in, outlines, ply, read, vertex


def place(row: int) -> str:
    return f"row {row}"


def column(*rows: list[Any], kind: str = "i4") -> ListColumn:
    return ListColumn(
        np.array([len(row) for row in rows], np.int64), np.array(functools.reduce(operator.iadd, rows, []), kind)
    )


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", INTEGERS)
def test_lists_of_any_integer_type(form: str, kind: str) -> None:
    for length, item in ((kind, "int"), ("uchar", kind), (kind, "float")):
        rows = [([0, 1, 2],), ([0, 1, 2, 3],)]
        faces = Element("face", [f"list {length} {item} vertex_indices"], rows)
        assert outlines(mesh_in(ply(vertex(SQUARE), faces, form=form))) == [[0, 1, 2], [0, 1, 2, 3]]


@pytest.mark.parametrize("name", ["vertex_indices", "vertex_index", "VertexIndex", "indices", "vertices", "vert_ids"])
def test_the_list_of_vertices_has_many_names(name: str) -> None:
    faces = Element("face", ["list uchar float weights", f"list uchar int {name}"], [([0.5], [0, 1, 2])])
    scene, notes = read(ply(vertex(), faces))
    assert scene.mesh().faces.tolist() == [[0, 1, 2]]
    assert notes == ["the list weights of faces: not read"]


def test_the_best_name_wins() -> None:
    lists = {name: column() for name in ("some_index", "indices", "Vertex_Indices", "texcoord")}
    assert index_list(Columns({}, lists), "face") == "Vertex_Indices"
    with pytest.raises(MeshFileError, match="the element face has no list of vertices, such as vertex_indices"):
        index_list(Columns({}, {"texcoord": column()}), "face")


@pytest.mark.parametrize(
    ("items", "kind", "shown"),
    [
        ([0, 1, 3], "u1", "3"),
        ([0, -1, 2], "i1", "-1"),
        ([0, 1, 2**32 - 1], "u4", "4294967295"),
        ([0, 1, 2**64 - 1], "u8", "18446744073709551615"),
        ([0, 1, -(2**63)], "i8", "-9223372036854775808"),
        ([0, 1.5, 2], "f4", "1.5"),
        ([0, np.nan, 2], "f8", "nan"),
        ([0, 1e300, 2], "f8", r"1e\+300"),
    ],
)
def test_an_item_that_is_no_vertex_is_named(items: list[Any], kind: str, shown: str) -> None:
    lists = ListColumn(np.array([2, 0, 3]), np.array([0, 1, *items], kind))
    with pytest.raises(MeshFileError, match=f"^row 2 names vertex {shown}; there are 3"):
        indices_of(lists, 3, place)
    table = ListColumn(np.array([3, 3]), np.array([[0, 1, 2], items], kind))
    with pytest.raises(MeshFileError, match=f"^row 1 names vertex {shown}; there are 3"):
        indices_of(table, 3, place)


def test_polygons_are_cut_alike_in_parts_of_any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    rows = [([*rng.permutation(9)[: rng.integers(1, 7)].tolist()],) for _ in range(40)]
    data = ply(vertex(rng.random((9, 3)).round(3).tolist()), Element("face", ["list uchar int vertex_index"], rows))
    whole, notes = read(data)
    monkeypatch.setattr(ply_faces, "_BLOCK", 3)
    monkeypatch.setattr(polygons, "_PART", 3)
    parts, told = read(data)
    assert outlines(whole.mesh()) == [row[(at := row.index(min(row))) :] + row[:at] for (row,) in rows if len(row) >= 3]
    assert parts.mesh().faces.tolist() == whole.mesh().faces.tolist()
    assert outlines(parts.mesh()) == outlines(whole.mesh())
    assert told == notes
    assert [note.split(",")[0][-7:] for note in notes] == ["corners", "overlap"]


def strips(rows: list[list[int]], kind: str = "i4", vertices: int = 99) -> list[list[int]]:
    columns = Columns({}, {"vertex_indices": column(*rows, kind=kind)})
    return triangles_of_strips(columns, vertices, FileLimits(), place).tolist()


def plain_strips(rows: list[list[int]]) -> list[list[int]]:
    """The same, vertex by vertex."""
    triangles = []
    for row in rows:
        strip: list[int] = []
        for item in row:
            strip = [] if item == -1 else [*strip, item]
            if item != -1 and len(strip) >= 3:
                a, b, c = strip[-3:]
                triangle = [a, b, c] if len(strip) % 2 else [a, c, b]
                if len(set(triangle)) == 3:
                    triangles.append(triangle)
    return triangles


@given(st.lists(st.lists(st.integers(-1, 5), max_size=12), min_size=1, max_size=4))
@settings(deadline=None)
def test_strips_are_what_a_loop_makes_of_them(rows: list[list[int]]) -> None:
    assert strips(rows) == plain_strips(rows)


def test_strips_turn_every_second_triangle() -> None:
    assert strips([[0, 1, 2, 3, -1, 4, 5, 6, 7]]) == [[0, 1, 2], [1, 3, 2], [4, 5, 6], [5, 7, 6]]
    for kind, restart in (("u4", 2**32 - 1), ("u1", 255), ("u8", 2**64 - 1)):
        assert strips([[0, 1, 2, restart, 4, 5, 6]], kind) == [[0, 1, 2], [4, 5, 6]]
    with pytest.raises(MeshFileError, match="row 0 names vertex -2; there are 9"):
        strips([[0, 1, -2]], vertices=9)


def test_values_of_faces_follow_their_triangles() -> None:
    texcoords = [0, 0, 1, 0, 1, 1, 0, 1]
    more = ["list uchar float texcoord", "uchar Red", "uchar Green", "uchar Blue", "short quality", "int texnumber"]
    rows = (
        ([0, 1], [], 9, 9, 9, 9, 9),
        ([0, 1, 2, 3], texcoords, 1, 2, 3, 4, 0),
        ([2, 1, 0], [], 5, 6, 7, 8, 1),
        ([0, 1, 3], [1, 2, 3], 5, 6, 7, 8, 2),
    )
    scene, notes = read(ply(vertex(SQUARE), face(*rows, more=more)))
    mesh = scene.mesh()
    assert notes == [
        "faces of fewer than three different corners, left out: 1",
        "faces with texture coordinates for another number of corners: 1, of these none are read",
    ]
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [2, 1, 0], [0, 1, 3]]
    found = {one.name: one for one in mesh.attributes}
    corners = found["TEXCOORD_0"]
    assert (corners.kind, corners.domain, corners.values.dtype) == (Kind.TEXCOORD, Domain.CORNER, np.float32)
    assert corners.rows().tolist() == [0, 1, 2, 0, 2, 3] + [NONE] * 6
    colours = found["COLOR_0"]
    assert (colours.kind, colours.domain, colours.normalized) == (Kind.COLOR, Domain.FACE, True)
    assert colours.per_element().tolist() == [[1, 2, 3], [1, 2, 3], [5, 6, 7], [5, 6, 7]]
    assert found["quality"].per_element()[:, 0].tolist() == [4, 4, 8, 8]
    assert (found["texnumber"].kind, found["texnumber"].per_element()[:, 0].tolist()) == (Kind.LABEL, [0, 0, 1, 2])


def test_names_that_vertices_have_are_changed() -> None:
    colours = ("uchar red", "uchar green", "uchar blue", "float quality")
    more = ["list uchar float texcoord", *colours]
    rows = [(*row, 1, 2, 3, 0.5, 0, 1) for row in SQUARE]
    data = ply(vertex(rows, *colours, "float s", "float t"), face(([0, 1, 2], [0] * 6, 4, 5, 6, 7), more=more))
    mesh = mesh_in(data)
    assert [(one.name, one.domain) for one in mesh.attributes] == [
        ("COLOR_0", Domain.VERTEX),
        ("TEXCOORD_1", Domain.VERTEX),
        ("quality", Domain.VERTEX),
        ("TEXCOORD_0", Domain.CORNER),
        ("FACE_COLOR", Domain.FACE),
        ("face_quality", Domain.FACE),
    ]
    assert mesh.attributes[-1].extra == {"property": "quality"}
