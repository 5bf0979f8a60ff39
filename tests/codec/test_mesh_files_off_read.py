"""OFF files of every kind that the format knows: what is read, what is told, what is refused."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.attributes import NONE, Domain
from meshtide_codec.errors import MeshError, MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.read import mesh_of, read_source
from meshtide_codec.mesh_files.source import Source
from off_files import FACES, LIMITS, SQUARE, read, values

ROWS = b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"


@pytest.mark.parametrize(
    "data",
    [
        b"OFF\n4 2 0\n" + ROWS,
        b"OFF 4 2 0\n" + ROWS,
        b"OFF4 2 0\n" + ROWS,
        b"4 2 0\n" + ROWS,
        b"off\n4 2 5\n" + ROWS,
        b"OFF\n4 2\n" + ROWS,
        b"OFF 4 2\n" + ROWS,
        b"OFF\n4 2\n0\n" + ROWS,
        b"OFF\n4\n2\n0\n" + ROWS,
        b"\n\n  OFF\t4 2 0\n" + ROWS.replace(b" ", b"\t"),
        b"# by hand\nOFF # a square\n4 2 0# counts\n" + ROWS.replace(b"\n", b" # row\n\n"),
        b"\xef\xbb\xbfOFF\n4 2 0\n" + ROWS,
        ("OFF\n4 2 0\n" + ROWS.decode()).encode("utf-16"),
        (b"OFF\n4 2 0\n" + ROWS).replace(b"\n", b"\r"),
        (b"OFF\n4 2 0\n" + ROWS).replace(b"\n", b"\r\n"),
        b"OFF 4 2 0 " + ROWS.replace(b"\n", b" ") + b"\n",
        (b"OFF 4 2 0 " + ROWS).replace(b" ", b"\n"),
        b"OFF\n4 2 0\n0 0 0 1 0 0\n1 1 0 0 1 0\n3 0\n1\n2\n3 0 2\n3\n",
        b"OFF\n4 2 0\n0 0 0 1 0 0 1 1 0 0 1 0 3 0 1 2 3 0 2 3\n",
        b"OFF\n4 2 0\n0 0 0\n1.0 0e0 -0\n+1 1 .0\n0 1 0.\n3 0 1 2\n3 0 2 3\n",
        b"nOFF\n3\n4 2 0\n" + ROWS,
        b"nOFF 3 4 2 0\n" + ROWS,
        b"4OFF\n4 2 0\n0 0 0 1\n2 0 0 2\n4 4 0 4\n0 -1 0 -1\n3 0 1 2\n3 0 2 3\n",
        b"4nOFF\n3\n4 2 0\n0 0 0 1\n2 0 0 2\n4 4 0 4\n0 -1 0 -1\n3 0 1 2\n3 0 2 3\n",
    ],
)
def test_one_square_in_many_spellings(data: bytes) -> None:
    mesh, notes = read(data)
    assert mesh.vertices.tolist() == SQUARE
    assert mesh.faces.tolist() == FACES
    assert mesh.attributes == ()
    assert notes == []


def test_values_of_vertices_stand_in_the_order_of_the_manual() -> None:
    rows = b"0 0 0 0 0 1 255 128 0 9 .25 .5\n" * 3
    for keyword in (b"STCNOFF", b"NCSTOFF", b"stcnoff"):
        mesh, notes = read(keyword + b"\n3 1 0\n" + rows + b"3 0 1 2\n")
        assert values(mesh, "NORMAL") == [[0, 0, 1]] * 3
        assert values(mesh, "COLOR_0") == [[255, 128, 0, 9]] * 3
        assert values(mesh, "TEXCOORD_0") == [[0.25, 0.5]] * 3
        assert notes == []


@pytest.mark.parametrize(
    ("keyword", "colors", "kind", "expected"),
    [
        (b"COFF", b"255 0 7", "uint8", [255, 0, 7]),
        (b"COFF", b"255 0 7 9", "uint8", [255, 0, 7, 9]),
        (b"COFF", b".25 .5 1", "float64", [0.25, 0.5, 1]),
        (b"COFF", b"0 1 1 1", "float64", [0, 1, 1, 1]),
        (b"COFF", b"51.0 127.5 255", "float64", [0.2, 0.5, 1]),
        (b"OFF", b"255 0 7", "uint8", [255, 0, 7]),
        (b"OFF", b".25 .5 1 1", "float64", [0.25, 0.5, 1, 1]),
    ],
)
def test_colours_of_vertices_announced_or_not(keyword: bytes, colors: bytes, kind: str, expected: list[float]) -> None:
    mesh, notes = read(keyword + b"\n3 1 0\n" + (b"0 0 0 " + colors + b"\n") * 3 + b"3 0 1 2\n")
    (attribute,) = mesh.attributes
    assert (attribute.name, attribute.domain, attribute.values.dtype) == ("COLOR_0", Domain.VERTEX, np.dtype(kind))
    assert attribute.normalized == (kind == "uint8")
    assert attribute.values.tolist() == [expected] * 3
    assert notes == []


def test_announced_colours_in_a_stream_of_words() -> None:
    for colors, size in ((b"9 8 7 6 ", 4), (b"9 8 7 ", 3)):
        mesh, _ = read(b"COFF 3 1 0 " + (b"0 0 0 " + colors) * 3 + b"3 0 1 2\n")
        assert values(mesh, "COLOR_0") == [[9, 8, 7, 6][:size]] * 3


@pytest.mark.parametrize(
    ("row", "note"),
    [
        (b"0 0 0 300 0 0", "colours of vertices are outside of 0 to 255"),
        (b"0 0 0 -1 0 0", "colours of vertices are outside"),
        (b"0 0 0 nan 0 0", "colours of vertices are outside"),
        (b"0 0 0 1 2", "each vertex has 2 values that are not a colour"),
    ],
)
def test_what_stands_behind_a_vertex_and_is_no_colour_is_told(row: bytes, note: str) -> None:
    mesh, notes = read(b"OFF 3 1 0\n" + (row + b"\n") * 3 + b"3 0 1 2\n")
    assert mesh.attributes == ()
    assert mesh.vertices.tolist() == [[0, 0, 0]] * 3
    assert [line.startswith(note) for line in notes] == [True]


def test_colours_on_some_lines_of_vertices_are_left_out_and_told() -> None:
    mesh, notes = read(b"OFF 3 1 0\n0 0 0\n1 0 0 255 0 0\n0 1 0\n3 0 1 2\n")
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert notes == ["lines of vertices have more than the 3 words that the keyword announces: the rest is left out"]


def test_colours_of_faces_end_with_their_lines() -> None:
    rows = b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1\n2 3 255 0 9\n3 0 1 2 # none\n3 0 2 3 1 2 3 4\n3 1 2 3 17\n"
    mesh, notes = read(b"OFF 4 4 0\n" + rows)
    assert mesh.polygons_as_lists() == [[0, 1, 2, 3], [0, 1, 2], [0, 2, 3], [1, 2, 3]]
    color, index = mesh.attributes
    assert (color.name, color.domain, color.values.tolist()) == (
        "COLOR_0",
        Domain.FACE,
        [[255, 0, 9, 255], [1, 2, 3, 4]],
    )
    assert color.rows().tolist() == [0, 0, NONE, 1, NONE]
    assert (index.name, index.values.tolist()) == ("COLOR_INDEX", [[17]])
    assert index.rows().tolist() == [NONE, NONE, NONE, NONE, 0]
    assert notes == []
    for one in mesh.attributes:
        one.check(4, 5)


def test_floats_for_colours_of_faces() -> None:
    mesh, _ = read(b"OFF 4 2 0\n" + ROWS.replace(b"3 0 1 2\n", b"3 0 1 2 .5 .25 1\n"))
    (color,) = mesh.attributes
    assert color.values.tolist() == [[0.5, 0.25, 1]]
    assert not color.normalized
    assert color.rows().tolist() == [0, NONE]


@pytest.mark.parametrize(
    ("data", "note"),
    [
        (b"OFF 4 2 0\n" + ROWS + b"the end\n", "2 words follow the last face: left out"),
        (b"OFF 4 1 0\n" + ROWS, "4 words follow the last face: left out"),
        (b"OFF 4 2 0\n" + ROWS.replace(b"0 1 2\n", b"0 1 2 7 7\n"), "1 faces have something behind their corners"),
        (b"OFF 4 2 0\n" + ROWS[:-1], "its last line has no end"),
        (b"OFF 4 4 0\n" + ROWS + b"2 0 1\n3 0 1 1\n", "faces of fewer than three different corners, left out: "),
        (b"OFF 4 3 0\n" + ROWS + b"4 0 1 0 1\n", "faces of fewer than three different corners, left out: "),
        (b"OFF 4 2 0\n" + ROWS.replace(b"0 1 2\n", b"0 1 2 .5\n"), "rows of a colour map are not whole numbers"),
        (b"OFF 4 2 0\n" + ROWS.replace(b"0 1 2\n", b"0 1 2 5 6 999\n"), "colours of faces are outside of 0 to 255"),
    ],
)
def test_what_is_left_out_is_told(data: bytes, note: str) -> None:
    mesh, notes = read(data)
    assert mesh.faces[:2].tolist() == FACES[: len(mesh.faces)]
    assert [line.startswith(note) for line in notes] == [True]


REFUSED: dict[str, tuple[bytes, str]] = {
    "nothing": (b"", "does not begin with OFF"),
    "another word": (b"hello\n", "does not begin with OFF"),
    "a word that begins with it": (b"OFFER 3 1 0\n", "does not begin with OFF"),
    "a keyword twice": (b"CCOFF\n3 1 0\n", "keyword CCOFF is not understood"),
    "half a keyword": (b"SOFF\n3 1 0\n", "keyword SOFF is not understood"),
    "no counts": (b"OFF\n", "does not say how many"),
    "a count below zero": (b"OFF -3 1 0\n", "does not say how many"),
    "counts that are words": (b"OFF\nmany faces\n", "does not say how many"),
    "a count of no file": (b"OFF " + b"9" * 300 + b" 1 0\n", "does not say how many"),
    "other dimensions": (b"nOFF\n5\n3 1 0\n", "5 dimensions .nOFF."),
    "no dimension": (b"nOFF\nx\n", "no number follows"),
    "a trillion vertices": (b"OFF\n1000000000000 1 0\n", "claims 1000000000000 vertices; 1000 are the most"),
    "faces over the limit": (b"OFF\n3 2001 0\n", "claims 2001 faces"),
    "triangles over the limit": (b"OFF 3 1 0\n" + b"0 0 0\n" * 3 + b"2003" + b" 0" * 2003 + b"\n", "claims 2001 faces"),
    "rows missing": (b"OFF 900 5 0\n0 0 0\n", "cut short: it declares 900 vertices and 5 faces, but only 3 numbers"),
    "faces missing": (b"OFF 4 4 0\n" + ROWS, "cut short: 4 faces are declared, face 2 is not complete"),
    "a corner missing": (b"OFF 4 2 0\n" + ROWS.replace(b"3 0 1 2", b"3 0 1"), "face 0 .* has fewer corners than it"),
    "a corner too high": (
        b"OFF 4 2 0\n" + ROWS.replace(b"2 3\n", b"2 4\n"),
        "line 7: face 1 names vertex 4; the file has 4",
    ),
    "a corner below zero": (b"OFF 4 2 0\n" + ROWS.replace(b"2 3\n", b"2 -1\n"), "line 7: face 1 names vertex -1"),
    "a coordinate missing": (
        b"OFF 4 2 0\n" + ROWS.replace(b"1 1 0", b"1 1"),
        "line 4: vertex 2 .* fewer than 3 numbers",
    ),
    "a coordinate missing before quads": (
        b"OFF\n8 3 0\n0 0\n" + ROWS[6:24] + ROWS[:24] + b"4 0 1 2 3\n" * 3,
        "line 3: vertex 0 .* fewer than 3 numbers",
    ),
    "a face without corners": (b"OFF 4 2 0\n" + ROWS.replace(b"3 0 1 2", b"0"), "face 0 .* or none"),
    "half a corner": (b"OFF 4 2 0\n" + ROWS.replace(b"2 3\n", b"2 2.5\n"), "2.5 for a corner"),
    "a corner that is nan": (b"OFF 4 2 0\n" + ROWS.replace(b"2 3\n", b"2 nan\n"), "nan for a corner"),
    "faces of less than nothing": (b"OFF 4 2 0\n" + ROWS.replace(b"3 0 1 2", b"-3 0 1 2"), "fewer corners"),
    "faces of very many": (b"OFF 1 1 0\n0 0 0\n" + b"9" * 5000 + b"\n", "corner|complete|fewer"),
    "a word for a coordinate": (b"OFF 4 2 0\n" + ROWS.replace(b"1 1 0", b"1 x 0"), "line 4: .* where 'x' stands"),
    "two numbers in one": (b"OFF 4 2 0\n" + ROWS.replace(b"1 1 0", b"1 1-2 0"), "line 4: .* where '1-2' stands"),
    "a word for a corner": (b"OFF 4 2 0\n" + ROWS.replace(b"0 1 2", b"0 y 2"), "line 6: .* where 'y' stands"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(case: str) -> None:
    data, message = REFUSED[case]
    with pytest.raises(MeshFileError, match=message):
        read(data)


@pytest.mark.parametrize("case", ["a trillion vertices", "rows missing"])
def test_a_bomb_is_refused_before_memory_is_taken(case: str) -> None:
    data, _ = REFUSED[case]
    huge = FileLimits(vertices=1 << 60, faces=1 << 60)
    tracemalloc.start()
    try:
        with pytest.raises(MeshFileError, match="cut short"):
            read(data, huge)
        assert tracemalloc.get_traced_memory()[1] < 200_000
    finally:
        tracemalloc.stop()


def test_a_point_at_infinity_is_refused_where_a_face_uses_it() -> None:
    data = b"4OFF\n4 1 0\n0 0 0 1\n1 0 0 1\n0 1 0 %d\n0 0 0 0\n3 0 1 2\n"
    found = mesh_of(read_source(Source("a.off", ".off", data % 1), LIMITS))
    assert len(found.mesh.vertices) == 3
    assert found.notes == ("1 vertex is not finite and of no face: left out",)
    with pytest.raises(MeshError, match="vertex 2 is not finite"):
        mesh_of(read_source(Source("a.off", ".off", data % 0), LIMITS))


@given(st.integers(3, 6), st.data())
@settings(max_examples=60)
def test_a_coordinate_that_is_missing_is_never_made_up_for_by_the_next_row(side: int, data: st.DataObject) -> None:
    count = side * side
    rows = [[str(number) for number in (x, y, x * y)] for x in range(side) for y in range(side)]
    corners = [x * side + y for x in range(side - 1) for y in range(side - 1)]
    faces = [f"4 {c} {c + side} {c + side + 1} {c + 1}" for c in corners]
    row = data.draw(st.integers(0, count - 1))
    del rows[row][data.draw(st.integers(0, 2))]
    text = "\n".join([f"OFF\n{count} {len(faces)} 0", *map(" ".join, rows), *faces, ""])
    with pytest.raises(MeshFileError, match=f"line {row + 3}: vertex {row} of the OFF file has fewer than 3 numbers"):
        read(text.encode())


WHOLE = [
    b"OFF 4 2 0\n" + ROWS,
    b"COFF\n3 1 3\n" + b"0.5 1 -2 255 128 0\n" * 3 + b"3 0 1 2 0.5 0.25 1 1\n",
    b"OFF 4 2 0 " + ROWS.replace(b"\n", b" ") + b"\n",
]


@pytest.mark.parametrize("data", WHOLE)
def test_a_file_that_is_cut_off_anywhere_is_refused_or_told(data: bytes) -> None:
    whole, _ = read(data)
    read_anyway = 0
    for length in range(len(data)):
        try:
            mesh, notes = read(data[:length])
        except MeshFileError:
            continue
        read_anyway += 1
        assert any("its last line has no end" in note for note in notes)
        assert len(mesh.faces) == len(whole.faces)
    assert read_anyway <= 18  # cuts within the last row's last number or its colour


@given(st.sampled_from(WHOLE), st.data())
@settings(max_examples=150)
def test_damage_is_read_or_refused_with_a_reason(data: bytes, draw: st.DataObject) -> None:
    damaged = bytearray(data)
    for _ in range(draw.draw(st.integers(1, 4))):
        damaged[draw.draw(st.integers(0, len(data) - 1))] = draw.draw(
            st.one_of(st.integers(0, 255), st.sampled_from(b"0123456789.-enia \n#"))
        )
    try:
        mesh = mesh_of(read_source(Source("a.off", ".off", bytes(damaged)), LIMITS)).mesh
    except MeshError as error:
        assert str(error)
    else:
        assert len(mesh.faces) > 0


finite = st.floats(allow_nan=False, allow_infinity=False, width=64)
blanks = st.sampled_from([" ", "  ", "\t", " \t "])
breaks = st.sampled_from(["\n", "\r\n", "\n\n", " \n", " # 3 0 1 2\n", "\n# comment\n \n"])


@st.composite
def contents(draw: st.DrawFn) -> dict[str, Any]:
    """What a file is to hold."""
    count = draw(st.integers(3, 8))
    numbers = st.lists(st.lists(finite, min_size=3, max_size=3), min_size=count, max_size=count)
    polygon = st.lists(st.integers(0, count - 1), min_size=3, max_size=min(6, count), unique=True)
    colors = st.one_of(st.integers(0, 255), st.sampled_from([0.0, 0.5, 1.0]))
    return {
        "points": draw(numbers),
        "normals": draw(numbers) if draw(st.booleans()) else None,
        "colors": draw(st.integers(3, 4)) if draw(st.booleans()) else 0,
        "texture": draw(st.booleans()),
        "faces": draw(st.lists(polygon, min_size=1, max_size=6)),
        "bright": draw(st.lists(st.just(draw(colors)), min_size=4, max_size=4)),
    }


def spelt(content: dict[str, Any], draw: st.DrawFn) -> str:
    """A legal file with these contents."""
    normals, colors, texture = content["normals"], content["colors"], content["texture"]
    by_words = draw(st.booleans()) and colors != 3
    keyword = "ST" * texture + "C" * bool(colors) + "N" * (normals is not None) + "OFF"
    rows: list[list[str]] = []
    for place, point in enumerate(content["points"]):
        row = [*point, *(normals[place] if normals else [])]
        rows.append([repr(value) for value in [*row, *content["bright"][:colors], *([0.25, 0.5] if texture else [])]])
    behind = [] if by_words else content["bright"][:3]
    rows += [[str(value) for value in [len(face), *face, *behind]] for face in content["faces"]]
    text = keyword + draw(st.sampled_from(["\n", " ", ""]))
    text += f"{len(content['points'])} {len(content['faces'])} 7"
    for row in rows:
        text += draw(breaks)  # what followed a face on its line would be its colour
        for word in row[:-1]:
            text += word + (draw(st.one_of(blanks, breaks)) if by_words else draw(blanks))
        text += row[-1]
    return text + "\n"


@given(st.data())
@settings(max_examples=60)
def test_any_legal_spelling_reads_back_to_the_same_mesh(data: st.DataObject) -> None:
    content = data.draw(contents())
    text = data.draw(st.composite(lambda draw: spelt(content, draw))())
    mesh, notes = read(text.encode())
    assert [note for note in notes if "cross themselves" not in note] == []  # as random polygons may
    assert mesh.vertices.tolist() == content["points"]
    assert [rotated(row) for row in mesh.polygons_as_lists()] == [rotated(row) for row in content["faces"]]
    assert values(mesh, "NORMAL") == content["normals"]
    count = len(content["points"])
    of_vertices = [one for one in mesh.attributes if one.name == "COLOR_0" and one.domain is Domain.VERTEX]
    assert [one.values.tolist() for one in of_vertices] == [[content["bright"][: content["colors"]]] * count] * bool(
        content["colors"]
    )
    assert values(mesh, "TEXCOORD_0") == ([[0.25, 0.5]] * count if content["texture"] else None)
    of_faces = [one for one in mesh.attributes if one.domain is Domain.FACE]
    for one in of_faces:
        assert one.per_element().tolist() == [content["bright"][:3]] * len(mesh.faces)
    assert len(of_faces) <= 1


def rotated(polygon: list[int]) -> list[int]:
    first = polygon.index(min(polygon))
    return polygon[first:] + polygon[:first]
