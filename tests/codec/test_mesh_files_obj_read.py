from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.errors import MeshError, MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.obj import lines as obj_lines
from obj_files import attribute, faces_of, read_bytes, written_in_random_ways
from plain_obj import Corner, read_plain_obj, turned

CASES = Path(__file__).parent / "mesh_files"
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
SOLID = "v 0 0 0\nv 3 0 0\nv 0 2 0\nv 0 0 1.5\nv 3 2 1.5\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 5\nf 2 5 4\nf 3 4 5\n"
BLOCK = "v {0} 0 0\nv {1} 0 0\nv {0} 1 0\nvn 0 0 1\nf -3//-1 -2//-1 -1//-1\n"


def area(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, place]] for place in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize(
    ("name", "vertices", "faces", "surface", "told"),
    [
        ("obj_rel_blocks", 12, 12, 7.098075, 0),
        ("obj_rel_vn", 8, 8, 4.73205, 0),
        ("obj_concave_L", 6, 4, 7.0, 0),
        ("obj_concave_quad", 4, 2, 6.0, 0),
        ("obj_tab_f", 5, 6, 18.866621, 0),
        ("obj_indentf", 5, 6, 18.866621, 0),
        ("obj_comment_eol", 5, 6, 18.866621, 0),
        ("obj_bom", 5, 6, 18.866621, 0),
        ("obj_cr", 5, 6, 18.866621, 0),
        ("obj_fo", 5, 6, 18.866621, 0),
        ("obj_cont_space", 5, 6, 18.866621, 0),
        ("no_mtl", 4, 2, 1.0, 1),
        ("two_materials", 4, 2, 1.0, 0),
        ("relative_vt", 3, 1, 0.5, 0),
        ("latin1", 3, 1, 0.5, 0),
    ],
)
def test_files_that_tools_misread(name: str, vertices: int, faces: int, surface: float, told: int) -> None:
    scene, notes = read_bytes((CASES / f"{name}.obj").read_bytes(), CASES)
    mesh = scene.mesh()
    assert (len(mesh.vertices), len(mesh.faces), len(notes)) == (vertices, faces, told)
    assert area(mesh.vertices, mesh.faces) == pytest.approx(surface, abs=1e-5)


def test_indices_from_0_are_refused() -> None:
    with pytest.raises(MeshFileError, match="line 6, 'f 0 2 1': index 0"):
        read_bytes((CASES / "obj_0based.obj").read_bytes())


@pytest.mark.parametrize(
    "change",
    [
        ("f ", "f\t"),
        ("f ", " f "),
        ("f ", "fo "),
        ("\n", " # note\n"),
        ("\n", "\r"),
        ("\n", "\r\n"),
        ("f 1 ", "f 1 \\ \n"),
        ("v 0 0 0", "\ufeffv 0 0 0"),
        ("v ", "v\t"),
        ("f 1", "\f\vf 1"),
        ("f 2 3 5", "f 2/ 3// 5"),
        ("1.5", "1.5e+0"),
        ("1.5", "+1.5 \\\n"),
    ],
    ids=repr,
)
def test_ways_to_write_the_same(change: tuple[str, str]) -> None:
    scene, notes = read_bytes(SOLID.replace(*change))
    mesh = scene.geometries[0]
    assert mesh.vertices.tolist() == [[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1.5], [3, 2, 1.5]]
    assert mesh.faces.tolist() == [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 4], [1, 4, 3], [2, 3, 4]]
    assert area(mesh.vertices, mesh.faces) == pytest.approx(18.866621, abs=1e-6)
    assert notes == []


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-16-le", "utf-8-sig"])
def test_byte_order_marks(encoding: str) -> None:
    mark = "" if encoding in {"utf-16", "utf-8-sig"} else "\ufeff"
    scene, _ = read_bytes((mark + "o Würfel\n" + SOLID).encode(encoding))
    assert (len(scene.geometries[0].vertices), scene.names) == (5, ("Würfel",))


def test_relative_indices_count_at_their_line() -> None:
    mesh = read_bytes("".join(BLOCK.format(start, start + 1) for start in range(4)))[0].geometries[0]
    assert mesh.faces.tolist() == [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(4)]
    assert attribute(mesh, "NORMAL").indices.tolist() == [[i, i, i] for i in range(4)]  # type: ignore[union-attr]


def test_relative_and_absolute_indices_mix_and_may_name_what_follows() -> None:
    mesh = read_bytes(f"v 9 9 9\nvt 0 0\nf -1/-1 3/2 4/-1\n{TRIANGLE}vt 1 1\n")[0].geometries[0]
    assert mesh.faces.tolist() == [[0, 2, 3]]
    assert attribute(mesh, "TEXCOORD_0").rows().tolist() == [0, 1, 0]


def test_wedges_are_kept_and_vertices_are_not_split() -> None:
    text = (
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\nvt .5 .5\nf 1/1 2/2 3/3\nf 3/5 2/2 4/4\n"
    )
    mesh = read_bytes(text)[0].geometries[0]
    texcoord = attribute(mesh, "TEXCOORD_0")
    assert len(mesh.vertices) == 4
    assert texcoord.domain == "corner"
    assert texcoord.values.tolist() == [[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0.5]]
    assert texcoord.rows().tolist() == [0, 1, 2, 4, 1, 3]


def test_texture_coordinates_of_vertices_are_told_as_such() -> None:
    mesh = read_bytes(TRIANGLE + "vt 0 0 0\nvt 1 0 0\nvt 0 1 0\nf 3/3 1/1 2/2\n")[0].geometries[0]
    texcoord = attribute(mesh, "TEXCOORD_0")
    assert (texcoord.domain, texcoord.indices, texcoord.values.shape) == ("vertex", None, (3, 2))


def test_a_third_texture_coordinate_and_a_missing_second_one() -> None:
    mesh = read_bytes(TRIANGLE + "vt 0.5\nvt 1 0 2\nf 1/1 2/2 3\n")[0].geometries[0]
    assert attribute(mesh, "TEXCOORD_0").values.tolist() == [[0.5, 0, 0], [1, 0, 2]]
    assert attribute(mesh, "TEXCOORD_0").rows().tolist() == [0, 1, -1]


@pytest.mark.parametrize(
    ("lines", "positions", "colors", "rows"),
    [
        (["0 0 0 1 0 .5"] * 3, [[0, 0, 0]] * 3, [[1, 0, 0.5]] * 3, None),
        (["0 0 0 1 0 .5 .25"] * 3, [[0, 0, 0]] * 3, [[1, 0, 0.5, 0.25]] * 3, None),
        (["2 4 6 2"] * 3, [[1, 2, 3]] * 3, None, None),
        (["1 2 3", "2 4 6 2", "0 0 0 1 1 0"], [[1, 2, 3], [1, 2, 3], [0, 0, 0]], [[1, 1, 0]], [-1, -1, 0]),
        (["1 2 3 4 5"] + ["0 0 0 1 1 0 0 9"] * 2, [[1, 2, 3], [0, 0, 0], [0, 0, 0]], [[1, 1, 0, 0]] * 2, [-1, 0, 1]),
        (["0 0 0 1 1 0", "0 0 0 1 1 0 .5", "0 0 0"], [[0, 0, 0]] * 3, [[1, 1, 0, 1], [1, 1, 0, 0.5]], [0, 1, -1]),
    ],
)
def test_numbers_after_the_position(
    lines: list[str], positions: list[list[float]], colors: list[list[float]] | None, rows: list[int] | None
) -> None:
    scene, notes = read_bytes("".join(f"v {line}\n" for line in lines) + "f 1 2 3\n")
    mesh = scene.geometries[0]
    assert mesh.vertices.tolist() == positions
    if colors is None:
        assert mesh.attributes == ()
    else:
        color = attribute(mesh, "COLOR_0")
        assert (color.kind, color.domain, color.values.tolist()) == ("color", "vertex", colors)
        assert (None if color.indices is None else color.indices.tolist()) == rows
    assert len(notes) == any(len(line.split()) in {5, 8} for line in lines)


def test_a_point_at_infinity_warns_nobody_and_is_not_finite() -> None:
    mesh = read_bytes("v 1 0 0 0\nv 0 0 0 0\n" + TRIANGLE + "f 3 4 5\n")[0].geometries[0]
    assert not np.isfinite(mesh.vertices[:2]).any(axis=1).all()
    assert np.isfinite(mesh.vertices[2:]).all()


def test_numbers_that_are_not_finite_are_read_as_such() -> None:
    mesh = read_bytes("v nan 1.#QNAN -nan(ind)\nv -inf 1.#INF -1.#INF00\n" + TRIANGLE + "f 3 4 5\n")[0].geometries[0]
    assert np.isnan(mesh.vertices[0]).all()
    assert mesh.vertices[1].tolist() == [-np.inf, np.inf, -np.inf]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TRIANGLE + "\n# note\nf 1 2 0\n", "line 6, 'f 1 2 0': index 0;"),
        (TRIANGLE + "f 1 2 -0\n", "line 4.*index 0;"),
        (TRIANGLE + "f 1 \\\n 2 4\nf 1 2 3\n", "line 4, .*index 4 is out of range; vertices in the file: 3"),
        ("\\\n\n" + TRIANGLE + "f 1 2 3\nf 1 2 4", "line 7, 'f 1 2 4'"),
        (TRIANGLE + "f -4 -2 -1\n", "line 4.*index -4 is out of range; vertices before it: 3"),
        (TRIANGLE + "f 1 2 3\nvt 0 0\nf 1/1 2/2 3/1\n", "line 6.*index 2 .* texture coordinates in the file: 1"),
        (TRIANGLE + "f 1//1 2//1 3//1\n", "line 4.*index 1 is out of range; normals in the file: 0"),
        (TRIANGLE + "f 1 2 99999999999\n", "line 4.*index 99999999999"),
        (TRIANGLE + "f 1 2 -99999999999\n", "line 4.*index -99999999999"),
        (TRIANGLE + "f 1 2 99999999999999999999999\n", "line 4.*a corner is v, v/vt"),
        (TRIANGLE + "f 1 2 3.0\n", "line 4.*a corner is"),
        (TRIANGLE + "f 1 2 x\n", "line 4.*a corner is"),
        (TRIANGLE + "f 1/1/1/1 2 3\n", "line 4.*a corner is"),
        (TRIANGLE + "f 1 /2 3\n", "line 4.*a corner is"),
        (TRIANGLE + "f 1 2-3 3\n", "line 4.*a corner is"),
        (TRIANGLE + "f 1///2 2 3\n", "line 4.*a corner is"),
        ("v 0 0\n" + TRIANGLE, "line 1, 'v 0 0': a vertex has at least 3 numbers"),
        ("v\n" + TRIANGLE, "line 1, 'v': a vertex has at least 3 numbers"),
        (TRIANGLE + "vn 0 1\n", "line 4.*a normal has at least 3"),
        (TRIANGLE + "vt\n", "line 4.*a texture coordinate has at least 1 number$"),
        (TRIANGLE + "v 1 2 three\n", "line 4, 'v 1 2 three': these are not all numbers"),
        (TRIANGLE + "v 1 2 1_000\n", "line 4.*not all numbers"),
        (TRIANGLE + "v 1 2 1.2.3\n", "line 4.*not all numbers"),
        (TRIANGLE + "v 1,0 2,0 3,0\n", "line 4.*not all numbers"),
        (TRIANGLE + "v 1-2 3 4\n", "line 4.*not all numbers"),
        ("", "there are no vertices"),
        ("this is not a mesh\n", "there are no vertices"),
        ("f 1 2 3\n", "there are no vertices"),
        (TRIANGLE + "f 1 2\nf 1 1 2 2\n", r"none of its faces has three different vertices \(2 faces\)"),
    ],
)
def test_files_that_are_refused(text: str, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        read_bytes(text)


def test_polygons_are_cut_inside_and_come_back() -> None:
    scene, notes = read_bytes("v 0 0 0\nv 4 0 0\nv 4 1 0\nv 1 1 0\nv 1 4 0\nv 0 4 0\nf 1 2 3\nf 3 4 5 6 1 2\nf 1 2\n")
    mesh = scene.geometries[0]
    assert len(mesh.faces) == 5
    assert area(mesh.vertices, mesh.faces[1:]) == pytest.approx(7)
    assert [turned([(v, None, None) for v in one])[0][0] for one in mesh.polygons_as_lists()] == [0, 0]
    assert notes == ["faces of fewer than three different vertices, left out: 1"]


def test_labels_and_materials_follow_the_polygons() -> None:
    text = (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl a\ng x\nf 1 2 3 4\nusemtl b\nf 1 2 3\ng\nusemtl a\nf 1 3 4\nf 1 2\n"
    )
    scene, notes = read_bytes(text)
    mesh = scene.geometries[0]
    assert [material.name for material in scene.materials] == ["a", "b"]
    assert mesh.materials is not None
    assert mesh.materials.tolist() == [0, 0, 1, 0]
    assert attribute(mesh, "group").rows().tolist() == [0, 0, 0, -1]
    assert attribute(mesh, "group").extra == {"names": ["x"]}
    assert notes[0] == "materials that no material file describes: 2 ('a', 'b')"


def test_one_group_is_no_label() -> None:
    scene, _ = read_bytes("o cube\ng all\ns off\n" + SOLID)
    assert scene.geometries[0].attributes == ()
    assert scene.names == ("cube",)


def test_what_is_not_read_is_told_in_one_line() -> None:
    text = SOLID + "l 1 2\nl 2 3\np 1\ncurv 0 1 1 2\nsurf 0 1 0 1 1 2\nxyz\nbevel on\nmtllib\n"
    told = "2 lines, 1 points, 2 statements of curves and surfaces, 3 statements of other kinds (the first is 'xyz')"
    assert read_bytes(text)[1] == [f"not read: {told}"]


def test_tables_that_no_face_names_are_told() -> None:
    assert read_bytes(SOLID + "vt 0 0\nvn 0 0 1\nvn 0 1 0\n")[1] == [
        "texture coordinates that no face names, left out: 1",
        "normals that no face names, left out: 2",
    ]


@pytest.mark.parametrize(
    ("last", "told"), [("f 1 2 3", True), ("v 1 2 3", True), ("# end", False), ("f 1 2 3\n", False)]
)
def test_a_last_line_without_an_end_is_told(last: str, *, told: bool) -> None:
    assert read_bytes(SOLID + last)[1] == ["the last line has no end: the file may be cut short"] * told


def test_names_that_are_not_utf_8_are_read_with_replacement() -> None:
    scene, _ = read_bytes(b"# Gr\xf6\xdfe\no W\xfcrfel\nusemtl gr\xfcn\n" + SOLID.encode())
    assert scene.names == ("W\ufffdrfel",)
    assert scene.materials[0].name == "gr\ufffdn"


def test_limits_are_held_before_more_is_read() -> None:
    with pytest.raises(MeshFileError, match="5 vertices; 4 are the most"):
        read_bytes(SOLID, limits=FileLimits(vertices=4))
    with pytest.raises(MeshFileError, match="6 faces; 5 are the most"):
        read_bytes(SOLID, limits=FileLimits(faces=5))


@pytest.mark.parametrize("size", [16, 64, 256])
def test_blocks_of_any_size_read_alike(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "".join(
        f"v {i} 0 0 # {i}\nvt {i} \\\n 0\nv 0 {i} 1\nv 1 1 {i}\nusemtl m{i % 3}\nf -3/-1 -2/-1 \\\n -1/-1\n"
        for i in range(40)
    )
    whole = read_bytes(text)[0]
    monkeypatch.setattr(obj_lines, "_BLOCK", size)
    cut = read_bytes(text)[0]
    for one, other in zip((whole.geometries[0],), (cut.geometries[0],), strict=True):
        assert np.array_equal(one.vertices, other.vertices)
        assert np.array_equal(one.faces, other.faces)
        assert np.array_equal(one.materials, other.materials)  # type: ignore[arg-type]
        assert np.array_equal(attribute(one, "TEXCOORD_0").rows(), attribute(other, "TEXCOORD_0").rows())
    with pytest.raises(MeshFileError, match="line 321, 'f 1 2 999'"):
        read_bytes(text + "f 1 2 999\n")


@settings(max_examples=40, deadline=None)
@given(written_in_random_ways())
def test_random_legal_files_read_back(
    written: tuple[bytes, dict[str, list[tuple[float, ...]]], list[list[Corner]]],
) -> None:
    data, tables, faces = written
    mesh = read_bytes(data)[0].geometries[0]
    assert np.array_equal(mesh.vertices, np.array(tables["v"]))
    assert faces_of(mesh) == faces
    for name, word in (("TEXCOORD_0", "vt"), ("NORMAL", "vn")):
        found = [one for one in mesh.attributes if one.name == name]
        assert len(found) == any(corner[["v", "vt", "vn"].index(word)] is not None for face in faces for corner in face)
        for one in found:
            assert one.values.tolist() == [list(row) for row in tables[word]]


def test_cut_at_every_byte_it_is_an_error_or_the_mesh_of_its_lines() -> None:
    tables = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\n"
    data = tables + b"f 1/1/1 2/2/1 3/1/1\nf 1//1 3//1 \\\n 4//1 2//1\n"
    read = 0
    for end in range(len(data)):
        try:
            scene, notes = read_bytes(data[:end])
        except MeshFileError:
            continue
        read += 1
        plain = read_plain_obj(data[:end])
        mesh = scene.geometries[0]
        assert mesh.vertices.tolist() == [list(row) for row in plain.positions]
        assert faces_of(mesh) == [turned(face) for face in plain.faces if len(face) > 2]
        assert ("the last line has no end: the file may be cut short" in notes) == (data[end - 1 : end] != b"\n")
    assert read > 40


@settings(max_examples=80, deadline=None)
@given(st.binary(max_size=80), st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), max_size=6))
def test_other_bytes_are_an_error_of_ours_or_a_mesh(noise: bytes, changes: list[tuple[int, int]]) -> None:
    mutated = bytearray((SOLID + "vt 0 .5e1\nusemtl a\nf 1/1 2/1 3/1\ng b\nf -1//1 2 \\\n 3\n").encode() + noise)
    for place, value in changes:
        mutated[place % len(mutated)] = value
    for data in (noise, b"v 0 0 0\nf " + noise, b"v " + noise, bytes(mutated)):
        try:
            mesh = read_bytes(data)[0].geometries[0]
        except MeshError:
            continue
        assert mesh.faces.size == 0 or 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices)
