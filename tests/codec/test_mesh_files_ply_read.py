"""PLY files as scenes: what is read of them, what is told, what is refused."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.attributes import NONE, Domain, Kind
from meshtide_codec.errors import MeshError, MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files import load_mesh, load_scene, mesh_of
from ply_files import (
    BIG,
    FORMS,
    INDICES,
    LITTLE,
    SQUARE,
    TEXT,
    TRIANGLE,
    XYZ,
    Element,
    Style,
    Variant,
    face,
    mesh_in,
    outlines,
    ply,
    read,
    variants,
    vertex,
)

PYRAMID = ((0, 0, 0), (3, 0, 0), (0, 2, 0), (0, 0, 1.5), (3, 2, 1.5))
SIX = ([0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 4], [1, 4, 3], [2, 3, 4])
HEADER = b"ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
SIX_HEADER = HEADER + b"element face 6\nproperty list uchar int vertex_indices\nend_header\n"
TEXT_ROWS = b"0.0 0.0 0.0\n3.0 0.0 0.0\n0.0 2.0 0.0\n0.0 0.0 1.5\n3.0 2.0 1.5\n"
SIX_ROWS = b"3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 4\n3 1 4 3\n3 2 3 4\n"
ONE = ply(vertex(), face([0, 1, 2]))

READ_RIGHT: dict[str, tuple[bytes, int, int, float, str]] = {
    "blank lines": (SIX_HEADER + b"\n" + TEXT_ROWS + b"\n" + SIX_ROWS + b"\n\n", 5, 6, 18.866621, ""),
    "several faces on one line": (SIX_HEADER + TEXT_ROWS + SIX_ROWS.replace(b"\n", b" ", 1), 5, 6, 18.866621, ""),
    "all on one line": ((SIX_HEADER + (TEXT_ROWS + SIX_ROWS).replace(b"\n", b" ")), 5, 6, 18.866621, ""),
    "a word on each line": (SIX_HEADER + (TEXT_ROWS + SIX_ROWS).replace(b" ", b"\n"), 5, 6, 18.866621, ""),
    "names in capitals": (
        (SIX_HEADER + TEXT_ROWS + SIX_ROWS)
        .replace(b"x\n", b"X\n")
        .replace(b"y\n", b"Y\n")
        .replace(b"vertex ", b"VERTEX "),
        5,
        6,
        18.866621,
        "",
    ),
    "a byte order mark": (b"\xef\xbb\xbf" + SIX_HEADER + TEXT_ROWS + SIX_ROWS, 5, 6, 18.866621, ""),
    "bytes after the end": (
        ply(vertex(PYRAMID), face(*SIX), form=LITTLE) + bytes(17),
        5,
        6,
        18.866621,
        "17 bytes after the last row: not read",
    ),
    "words after the end": (SIX_HEADER + TEXT_ROWS + SIX_ROWS + b"3 0 1\n", 5, 6, 18.866621, "5 bytes after the last"),
    "the end of old systems": (SIX_HEADER + TEXT_ROWS + SIX_ROWS + b"\x1a\0", 5, 6, 18.866621, ""),
    "triangles and quads mixed": (
        ply(vertex(PYRAMID), face([0, 2, 1], [0, 1, 4, 3], [2, 3, 4]), form=LITTLE),
        5,
        4,
        13.327747,
        "",
    ),
    "strips, restarted": (
        ply(
            vertex(PYRAMID),
            Element("tristrips", ["list int int vertex_indices"], [([0, 1, 2, 3, 4, -1, 0, 2, 4],)]),
            form=LITTLE,
        ),
        5,
        4,
        14.431849,
        "",
    ),
    "a comment that is not UTF-8": (ONE.replace(b"element v", b"comment Gr\xf6\xdfe\nelement v"), 3, 1, 0.5, ""),
    "header lines that end in CR": (ply(vertex(), face([0, 1, 2]), style=Style(LITTLE, b"\r")), 3, 1, 0.5, ""),
    "a header line without comment": (
        ONE.replace(b"element v", b"Created by Some Exporter 1.0\nelement v"),
        3,
        1,
        0.5,
        "line 3 of the header is not a comment, but read as one: 'Created by Some Exporter 1.0'",
    ),
    "no line end at the end": (ONE[:-1], 3, 1, 0.5, "its last number may be cut short"),
    "an element that nobody knows": (
        ply(Element("edge", ["int a", "list uchar int b"], [(1, [2, 3])] * 4), vertex(), face([0, 1, 2])),
        3,
        1,
        0.5,
        "edge: 4 rows, not read",
    ),
    "a grid beside faces": (
        ply(vertex(), Element("range_grid", [INDICES], [([0],)] * 100), face([0, 1, 2]), form=BIG),
        3,
        1,
        0.5,
        "range_grid: 100 rows, not read",
    ),
    "a list of vertices that nobody knows": (
        ply(vertex([(*row, [1]) for row in TRIANGLE], "list uchar int friends"), face([0, 1, 2])),
        3,
        1,
        0.5,
        "the list friends of vertices: not read",
    ),
    "a value that its type does not hold": (
        ply(vertex([(*row, 300) for row in TRIANGLE], "uchar level"), face([0, 1, 2])),
        3,
        1,
        0.5,
        "level of vertex has values that its type does not hold: kept as doubles",
    ),
}


@pytest.mark.parametrize("case", READ_RIGHT)
def test_what_people_write_is_read(case: str, tmp_path: Path) -> None:
    data, vertices, faces, area, note = READ_RIGHT[case]
    path = tmp_path / "a.ply"
    path.write_bytes(data)
    found = mesh_of(load_scene(path))
    assert (len(found.mesh.vertices), len(found.mesh.faces)) == (vertices, faces)
    corners = found.mesh.vertices[found.mesh.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(cross, axis=1).sum() / 2 == pytest.approx(area, abs=1e-6)
    assert any(note in each for each in found.notes) if note else not found.notes


def test_a_vertex_that_is_no_number_and_of_no_face_is_left_out(tmp_path: Path) -> None:
    for word in (b"nan", b"-NaN", b"inf", b"-Infinity", b"1.#QNAN", b"-nan(ind)"):
        path = tmp_path / "a.ply"
        data = SIX_HEADER.replace(b"vertex 5", b"vertex 6") + TEXT_ROWS + b" ".join([word] * 3) + b"\n" + SIX_ROWS
        path.write_bytes(data)
        found = mesh_of(load_scene(path))
        assert len(found.mesh.vertices) == 5
        assert found.notes == ("1 vertex is not finite and of no face: left out",)
        path.write_bytes(data.replace(b"3 2 3 4", b"3 2 3 5"))
        with pytest.raises(MeshError, match="vertex 5 is not finite"):
            load_mesh(path)


SPLAT = ("float f_dc_0", "float opacity", "float scale_0", "float rot_0")
REFUSED: dict[str, tuple[bytes, str]] = {
    "points": (ply(vertex()), "3 points without faces"),
    "points and an empty face element": (ply(vertex(), face()), "3 points without faces"),
    "a Gaussian splat": (
        ply(vertex([(*row, 0, 0, 0, 0) for row in TRIANGLE], *SPLAT), form=LITTLE),
        "this is a Gaussian splat, not a mesh: 3 points",
    ),
    "a packed Gaussian splat": (
        ply(
            Element("chunk", ["float min_x"], [(0,)]),
            Element("vertex", [f"uint packed_{each}" for each in ("position", "rotation", "scale")], [(1, 2, 3)] * 256),
            form=LITTLE,
        ),
        "this is a Gaussian splat, not a mesh: 256 points without faces; chunk: 1 rows, not read",
    ),
    "a grid without faces": (
        ply(vertex(), Element("range_grid", [INDICES], [([0],)] * 100)),
        "3 points without faces .*range_grid: 100 rows, not read",
    ),
    "faces of two corners": (ply(vertex(), face([0, 1], [])), "none of its faces has three different corners"),
    "a strip of one vertex twice": (
        ply(vertex(), Element("tristrips", [INDICES], [([0, 0, 1],)])),
        "none of its faces",
    ),
    "no vertices": (ply(face([0, 1, 2])), "declares no vertices"),
    "no rows of vertices": (ply(vertex([]), face([0, 1, 2])), "declares no vertices"),
    "no z": (ply(Element("vertex", XYZ[:2], [(0, 0)] * 3), face([0, 1, 2])), "no property z"),
    "a list for z": (
        ply(Element("vertex", [*XYZ[:2], "list uchar int z"], [(0, 0, [1])] * 3), face([0, 1, 2])),
        "no property z",
    ),
    "no list of vertices": (ply(vertex(), Element("face", ["int a"], [(1,)])), "no list of vertices"),
    "faces of nothing": (ply(vertex(), Element("face", [], [], 10)), "no list of vertices"),
    "an index out of range": (ply(vertex(), face([0, 1, 2], [0, 1, 3])), r"row 1 of face \(line 14\) names vertex 3"),
    "an index below zero": (ply(vertex(), face([0, 1, 2], [0, -1, 2])), r"row 1 of face \(line 14\) names vertex -1"),
    "an index out of range, binary": (
        ply(vertex(), face([0, 1, 3]), form=BIG),
        "row 0 of face names vertex 3; there are 3",
    ),
    "an index with a fraction": (ONE.replace(b"3 0 1 2", b"3 0 1 1.5"), r"row 0 of face \(line 13\) names vertex 1.5"),
    "a strip out of range": (
        ply(vertex(), Element("tristrips", [INDICES], [([0, 1, 2],), ([0, 1, -2],)])),
        r"row 1 of tristrips \(line 14\) names vertex -2",
    ),
    "a count below zero": (ply(vertex(), Element("face", [INDICES], [], -5)), "line 7 .* not understood"),
    "a count of no file": (ply(vertex(), Element("face", [INDICES], [], "9" * 300)), "9+... rows, which no file holds"),
    "binary rows missing": (
        ply(vertex([TRIANGLE[0]] * 8), Element("face", [INDICES], [], 9), form=LITTLE),
        "at least 105 bytes of rows, but 96 follow",
    ),
    "text rows missing": (
        ply(Element("vertex", XYZ, TRIANGLE, 5), face([0, 1, 2])),
        "ends in row 4 of the 5 rows of vertex",
    ),
    "text faces missing": (
        ply(vertex(), Element("face", [INDICES], [([0, 1, 2],)], 2)),
        "ends in row 1 of the 2 rows of face",
    ),
    "text values missing": (ONE.replace(b"3 0 1 2", b"3 0 1"), "ends in row 0 of the 1 rows of face"),
    "many text rows missing": (
        ply(vertex(), Element("face", [INDICES], [([0, 1, 2],)], 1000)),
        "at least 1009 numbers",
    ),
    "no number": (ONE.replace(b"1.0 0.0 0.0", b"1.0 x 0.0"), "line 11: 'x' is not a number"),
    "a number with an underscore": (ONE.replace(b"1.0 0.0 0.0", b"1_0 0.0 0.0"), "line 11: '1_0' is not a number"),
    "numbers run together": (ONE.replace(b"1.0 0.0 0.0", b"1.0 0.0-0.0"), "line 11: '0.0-0.0' is not a number"),
    "a byte of nothing": (ONE.replace(b"1.0 0.0 0.0", b"1.0 \0 0.0"), "line 11: .* is not a number"),
    "a list of less than nothing": (ONE.replace(b"3 0 1 2", b"-3 0 1 2"), "row 0 of face: .* a list of -3 values"),
    "a list of a fraction": (ONE.replace(b"3 0 1 2", b"2.5 0 1 2"), "row 0 of face: .* a list of 2.5 values"),
    "a list of no number": (ONE.replace(b"3 0 1 2", b"nan 0 1 2"), "row 0 of face: .* a list of nan values"),
    "a list below zero, binary": (
        ply(vertex(), Element("face", ["list char int vertex_index"], [([0, 1, 2],)]), form=LITTLE).replace(
            b"\x03\0\0\0\0", b"\xfd\0\0\0\0"
        ),
        "row 0 of face: vertex_index is a list of -3 values",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_mesh_is_refused(case: str) -> None:
    data, message = REFUSED[case]
    with pytest.raises(MeshFileError, match=message):
        read(data)


def test_limits_hold_before_rows_are_read() -> None:
    limits = FileLimits(vertices=10, faces=5)
    for data, message in (
        (ply(Element("vertex", XYZ, [], 11), face([0, 1, 2])), "claims 11 vertices"),
        (ply(vertex(), Element("face", [INDICES], [], 6)), "claims 6 faces"),
        (ply(vertex(SQUARE * 2), face(list(range(8)))), "claims 6 faces"),
        (ply(vertex(), Element("tristrips", [INDICES], [([0, 1, 2, 0, 1, 2],)])), "claims 6 faces"),
    ):
        with pytest.raises(MeshFileError, match=message):
            read(data, limits)


@pytest.mark.parametrize(
    "data",
    [
        ply(Element("vertex", XYZ, [], 10**15), face([0, 1, 2]), form=LITTLE),
        ply(Element("vertex", XYZ, [], 10**15), face([0, 1, 2])),
        ply(vertex(), Element("face", [INDICES], [], 10**15), form=BIG),
        ply(vertex(), face([0, 1, 2]), Element("edge", [INDICES], [], 10**15), form=BIG),
        ply(vertex(), Element("face", ["list uint int vertex_indices"], [], 1), form=LITTLE) + b"\xff" * 64,
        ply(vertex(), Element("face", ["list uint64 int vertex_indices"], [], 1), form=LITTLE) + b"\xff" * 64,
        ply(vertex(), Element("face", ["list uint int vertex_indices"], [([0, 1, 2],)], 2)) + b"4000000000 1 2 3",
        ply(vertex(), Element("face", [INDICES], [([0, 1, 2],)], 2)) + b"99999999999999999999999 1 2 3",
    ],
)
def test_claims_cost_no_memory(data: bytes) -> None:
    limits = FileLimits(vertices=10**16, faces=10**16)
    tracemalloc.start()
    try:
        with pytest.raises(MeshFileError):
            read(data, limits)
        assert tracemalloc.get_traced_memory()[1] < 200_000
    finally:
        tracemalloc.stop()


@given(variants())
@settings(max_examples=120, deadline=None)
def test_any_legal_file_is_read(variant: Variant) -> None:
    mesh = mesh_in(variant.data)
    assert np.array_equal(mesh.vertices, variant.vertices)
    assert outlines(mesh) == [each[(at := each.index(min(each))) :] + each[:at] for each in variant.polygons]
    found = {one.name: one for one in mesh.attributes}
    assert set(found) == set(variant.scalars)
    for name, values in variant.scalars.items():
        one = found[name]
        assert (one.kind, one.domain) == (Kind.SCALAR, Domain.VERTEX if name[0] == "v" else Domain.FACE)
        assert one.values[:, 0].tolist() == values


@pytest.mark.parametrize("form", FORMS)
def test_a_file_that_is_cut_short_anywhere_is_refused(form: str) -> None:
    more = ["list uchar float texcoord", "uchar red"]
    rows = ([0, 1, 2], [0, 0, 1, 0, 0, 1], 9), ([0, 1, 2, 3], [], 8), ([3, 2, 1], [0, 0, 1, 0, 0, 1], 7)
    data = ply(vertex([(*row, 7) for row in SQUARE], "short level"), face(*rows, more=more), form=form)
    whole = mesh_in(data)
    assert len(whole.faces) == 4
    least = len(data.rstrip()) if form == TEXT else len(data)
    for length in range(least):
        with pytest.raises(MeshFileError):
            read(data[:length])
    assert len(mesh_in(data[:least]).faces) == 4


@given(variants(), st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=4))
@settings(max_examples=120, deadline=None)
def test_damage_is_told_or_leaves_a_mesh(variant: Variant, changes: list[tuple[float, int]]) -> None:
    data = bytearray(variant.data)
    for place, value in changes:
        data[int(place * len(data))] = value
    try:
        mesh_of(read(bytes(data))[0])
    except MeshError as error:
        assert str(error)


def test_comments_and_textures_become_a_document_and_materials(tmp_path: Path) -> None:
    lines = [b"comment hello", b"obj_info from a scanner", b"comment TextureFile a b.png", b"comment TextureFile c.jpg"]
    rows = [([0, 1, 2], 1), ([0, 1, 2], 0), ([0, 1, 2], -1)]
    data = ply(vertex(), face(*rows, more=["int texnumber"]), style=Style(lines=lines))
    (tmp_path / "a b.png").write_bytes(b"\x89PNG1234")
    scene, notes = read(data, folder=tmp_path)
    assert [(each.name, each.data, each.mime_type) for each in scene.images] == [
        ("a b.png", b"\x89PNG1234", "image/png"),
        ("c.jpg", b"", ""),
    ]
    assert scene.document == {
        "comments": ["hello", "obj_info from a scanner"],
        "textures": [{"source": 0}, {"source": 1}],
    }
    assert [each.name for each in scene.materials] == ["a b.png", "c.jpg"]
    assert scene.materials[1].properties == {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}
    materials = scene.mesh().materials
    assert materials is not None
    assert materials.tolist() == [1, 0, NONE]
    assert scene.mesh().attributes == ()
    assert notes == ["the texture 'c.jpg' is not there"]


def test_textures_elsewhere_are_told_and_not_read(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(b"secret")
    for name, folder, told in (
        (b"../secret", tmp_path / "in", "lies outside"),
        (str(tmp_path / "secret").encode(), tmp_path / "in", "lies outside"),
        (b"secret", None, "put everything into one file"),
        (b"in", tmp_path, "not a regular file"),
    ):
        (tmp_path / "in").mkdir(exist_ok=True)
        data = ply(vertex(), face([0, 1, 2]), style=Style(lines=[b"comment TextureFile " + name]))
        scene, notes = read(data, folder=folder)
        assert scene.images[0].data == b""
        assert len(notes) == 1
        assert told in notes[0]


def test_a_texture_that_may_not_be_read_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied", str(tmp_path))

    monkeypatch.setattr(Path, "open", refuse)
    (tmp_path / "a.png").touch()
    data = ply(vertex(), face([0, 1, 2]), style=Style(lines=[b"comment TextureFile a.png"]))
    _, notes = read(data, folder=tmp_path)
    assert notes == ["the texture 'a.png' is not read: the file names 'a.png', which cannot be read: Permission denied"]


def test_texture_numbers_that_name_nothing_stay_a_label() -> None:
    lines = [b"comment TextureFile a.png"]
    scene, notes = read(ply(vertex(), face(([0, 1, 2], 5), more=["int texnumber"]), style=Style(lines=lines)))
    mesh = scene.mesh()
    assert mesh.materials is None
    assert [(one.name, one.kind, one.values.tolist()) for one in mesh.attributes] == [("texnumber", Kind.LABEL, [[5]])]
    assert "texnumber names textures that no comment names: kept as a label" in notes
    scene, _ = read(ply(vertex(), face([0, 1, 2]), style=Style(lines=lines)))
    materials = scene.mesh().materials
    assert materials is not None
    assert materials.tolist() == [0]


def test_faces_and_strips_stand_side_by_side() -> None:
    strips = Element("tristrips", [INDICES], [([0, 1, 2, 3],)])
    texcoords = [0, 0, 1, 0, 1, 1, 0, 1]
    faces = face(([0, 1, 2, 3], texcoords, 7), more=["list uchar float texcoord", "uchar quality"])
    mesh = mesh_in(ply(vertex(SQUARE), strips, faces))
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2], [1, 3, 2]]
    assert outlines(mesh) == [[0, 1, 2, 3], [0, 1, 2], [1, 3, 2]]
    found = {one.name: one for one in mesh.attributes}
    assert found["quality"].rows().tolist() == [0, 0, NONE, NONE]
    assert found["TEXCOORD_0"].rows().tolist() == [0, 1, 2, 0, 2, 3] + [NONE] * 6


def test_text_is_read_in_the_declared_type() -> None:
    mesh = mesh_in(ONE.replace(b"1.0 0.0 0.0", b"0.1 0.0 0.0"))
    assert mesh.vertices[1, 0] == np.float32(0.1)
    mesh = mesh_in(ONE.replace(b"float", b"double").replace(b"1.0 0.0 0.0", b"0.1 0.0 0.0"))
    assert mesh.vertices[1, 0] == 0.1
