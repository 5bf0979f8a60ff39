"""STL files of both kinds: told apart, welded, cut short, coloured."""

from __future__ import annotations

import struct
import tracemalloc
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.attributes import NONE, Domain
from meshtide_codec.errors import MeshError, MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.read import mesh_of, read_source
from meshtide_codec.mesh_files.source import Source
from meshtide_codec.mesh_files.stl import read_stl

LIMITS = FileLimits(vertices=1000, faces=2000)
TRIANGLES = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
POINTS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
FACES = [[0, 1, 2], [1, 3, 2]]


def read(data: bytes, limits: FileLimits = LIMITS) -> tuple[Mesh, list[str]]:
    source = Source("a.stl", ".stl", data)
    return read_stl(source, limits).mesh(), source.notes


def binary(triangles: Any = TRIANGLES, *, head: bytes = b"", count: int | None = None, extra: Any = 0) -> bytes:
    rows = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
    rows["corners"], rows["extra"] = triangles, extra
    return head.ljust(80, b"\0") + struct.pack("<I", len(rows) if count is None else count) + rows.tobytes()


def facet(triangle: Any) -> str:
    rows = "".join(f"      vertex {x!r} {y!r} {z!r}\n" for x, y, z in np.asarray(triangle).tolist())
    return f"  facet normal 0 0 1\n    outer loop\n{rows}    endloop\n  endfacet\n"


TEXT = "solid a square\n" + "".join(map(facet, TRIANGLES)) + "endsolid a square\n"


@pytest.mark.parametrize(
    "data",
    [
        binary(),
        binary(head=b"solid of a program that does not know better"),
        binary(head=b"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n"),
        TEXT.encode(),
        TEXT.upper().encode(),
        TEXT.replace("a square", "").encode(),
        TEXT.replace("a square", "vertex 1 2 3 endsolid facet normals").encode(),
        TEXT.replace("a square", "Stra\u00dfe \u7f51\u683c").encode(),
        TEXT.replace("a square", "Stra\u00dfe").encode("latin-1"),
        TEXT.replace("\n", "\r\n").encode(),
        TEXT.replace("\n", "\r").encode(),
        TEXT.replace(" ", "\t").encode(),
        TEXT[:-1].encode(),
        b"\xef\xbb\xbf\n  " + TEXT.encode(),
        TEXT.replace("\n", " ").encode(),
        TEXT.replace("1.0", "1e0").replace("0.0", "-0.0E+00").encode(),
        TEXT.replace("normal 0 0 1", "normal nan -nan(ind) inf").replace("-nan(ind)", "nan").encode(),
        TEXT.replace("    endloop\n", "").encode(),
        TEXT.replace("  endfacet\n", "").encode(),
        TEXT.replace("    outer loop\n", "").encode(),
        TEXT.replace("endsolid a square", "endsolid").encode(),
        (
            "solid one\n" + facet(TRIANGLES[0]) + "endsolid one\nsolid two\n" + facet(TRIANGLES[1]) + "endsolid\n"
        ).encode(),
        ("solid one\nendsolid\n" + TEXT + "\n\nsolid three\nendsolid three").encode(),
    ],
)
def test_one_square_in_many_spellings(data: bytes) -> None:
    mesh, notes = read(data)
    assert mesh.vertices.tolist() == POINTS
    assert mesh.faces.tolist() == FACES
    assert mesh.attributes == ()
    assert notes == []


def test_bytes_behind_the_facets_are_told() -> None:
    for head in (b"", b"solid"):
        mesh, notes = read(binary(head=head) + b"\0more")
        assert mesh.faces.tolist() == FACES
        assert notes == ["5 bytes follow the last facet: left out"]


def test_words_that_the_format_does_not_have_are_told() -> None:
    mesh, notes = read(TEXT.replace("  endfacet", "  color 0.5 0.5 1\n  endfacet").encode())
    assert mesh.faces.tolist() == FACES
    assert notes == ["2 words are not part of the format, such as 'color': left out"]


def test_zeros_of_both_signs_are_one_position_and_not_a_number_is_refused() -> None:
    triangles = np.array([[[0.0, -0.0, 0], [1, 0, 0], [0, 1, 0]], [[-0.0, 0, -0.0], [0, 1, 0], [0, 0, 1]]])
    mesh, _ = read(binary(triangles))
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert not np.signbit(mesh.vertices).any()
    triangles[1, 2, 0] = np.nan
    for data in (binary(triangles), ("solid\n" + "".join(map(facet, triangles)) + "endsolid\n").encode()):
        with pytest.raises(MeshError, match="vertex 3 is not finite"):
            mesh_of(read_source(Source("a.stl", ".stl", data), LIMITS))


def test_visible_colours() -> None:
    red, blue, none = 0x8000 | 31 << 10, 0x8000 | 31, 0
    triangles = np.concatenate([TRIANGLES, TRIANGLES[:1] + 5])
    mesh, notes = read(binary(triangles, extra=[red, none, blue]))
    (color,) = mesh.attributes
    assert (color.name, color.domain, color.normalized, color.values.dtype) == ("COLOR_0", Domain.FACE, True, np.uint8)
    assert color.values.tolist() == [[255, 0, 0], [0, 0, 255]]
    assert color.rows().tolist() == [0, NONE, 1]
    assert notes == []
    (color,) = read(binary(triangles, extra=[red, red, blue]))[0].attributes
    assert color.indices is None
    head = b"made by hand COLOR=\x01\x02\x03\xff,MATERIAL="
    (color,) = read(binary(triangles, head=head, extra=[31, 0x8000, 31 << 10 | 16]))[0].attributes
    assert color.per_element().tolist() == [[255, 0, 0, 255], [1, 2, 3, 255], [132, 0, 255, 255]]
    mesh, notes = read(binary(triangles, extra=[0, 7, 9]))
    assert mesh.attributes == ()
    assert notes == ["2 facets have two bytes of unknown meaning behind them: left out"]
    assert read(binary(triangles, head=b"x" * 74 + b"COLOR="))[0].attributes == ()


STL_TEXT = TEXT.encode()
REFUSED: dict[str, tuple[bytes, str]] = {
    "nothing": (b"", "no STL"),
    "something short": (b"hello", "no STL"),
    "half a facet": (STL_TEXT.replace(b"endsolid", b"facet\nvertex 0 0 0\nendsolid"), "3 facets and 7 vertices"),
    "four vertices": (STL_TEXT.replace(b"endloop", b"vertex 1 1 1\nendloop"), "2 facets and 8 vertices"),
    "two and four": (
        STL_TEXT.replace(b"      vertex 0.0 0.0 0.0\n", b"").replace(b"endsolid", b"vertex 0 0 0\nendsolid"),
        "2 facets and 6 vertices, which are three for each facet",
    ),
    "no facets": (b"solid\nendsolid\n", "0 facets and 0 vertices"),
    "only a name": (b"solid", "0 facets and 0 vertices"),
    "no end": (STL_TEXT[: STL_TEXT.rindex(b"endsolid")], "cut short: no endsolid follows"),
    "the second solid has no end": (STL_TEXT + b"solid b\n" + facet(TRIANGLES[0]).encode(), "cut short: no endsolid"),
    "two numbers": (STL_TEXT.replace(b"1.0 1.0 0.0", b"1.0 1.0"), "line 12: vertex 1 of facet 1 .* not three numbers"),
    "a word": (STL_TEXT.replace(b"1.0 1.0 0.0", b"1.0 x 0.0"), "line 12: vertex 1 of facet 1 .* not three numbers"),
    "numbers that touch": (STL_TEXT.replace(b"1.0 1.0 0.0", b"1.0 1.0-0.0 2"), "vertex 1 of facet 1"),
    "the last vertex": (b"solid\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex\nendsolid\n", "within its last vertex"),
    "many text facets": (b"solid\n" + facet(TRIANGLES[0]).encode() * 400 + b"endsolid\n", "claims 1200 vertices"),
    "facets over the limit": (binary(np.zeros((400, 3, 3))), "claims 1200 vertices; 1000 are the most"),
    "four billion facets": (
        binary(count=2**32 - 1),
        "cut short: it declares 4294967295 facets, but its size is that of 2",
    ),
    "no facets, but bytes": (binary(count=0), "declares 0 facets, and 100 bytes follow"),
    "no facets at all": (binary(np.zeros((0, 3, 3))), "declares 0 facets, and 0 bytes follow"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(case: str) -> None:
    data, message = REFUSED[case]
    with pytest.raises(MeshFileError, match=message):
        read(data)


@pytest.mark.parametrize("data", [binary(), binary(head=b"solid"), STL_TEXT, STL_TEXT.replace(b"a square", b"")])
def test_a_file_that_is_cut_off_anywhere_is_refused(data: bytes) -> None:
    ended = data.rindex(b"endsolid") + len(b"endsolid") if b"endsolid" in data else len(data)
    for length in range(len(data)):
        if length >= ended:  # the name behind endsolid is of no use
            assert read(data[:length])[0].faces.tolist() == FACES
            continue
        with pytest.raises(MeshFileError):
            read(data[:length])


def test_a_bomb_is_refused_before_memory_is_taken() -> None:
    huge = FileLimits(vertices=1 << 60, faces=1 << 60)
    tracemalloc.start()
    try:
        with pytest.raises(MeshFileError, match="cut short"):
            read(binary(count=2**32 - 1), huge)
        assert tracemalloc.get_traced_memory()[1] < 100_000
    finally:
        tracemalloc.stop()


@given(st.sampled_from([binary(), binary(head=b"solid") + b"more", STL_TEXT]), st.data())
@settings(max_examples=150)
def test_damage_is_read_or_refused_with_a_reason(data: bytes, draw: st.DataObject) -> None:
    damaged = bytearray(data)
    for _ in range(draw.draw(st.integers(1, 4))):
        byte = draw.draw(st.one_of(st.integers(0, 255), st.sampled_from(b"0123456789.-envfsld \n")))
        damaged[draw.draw(st.integers(0, len(data) - 1))] = byte
    try:
        mesh = mesh_of(read_source(Source("a.stl", ".stl", bytes(damaged)), LIMITS)).mesh
    except MeshError as error:
        assert str(error)
    else:
        assert len(mesh.faces) > 0


coordinates = st.sampled_from([0.0, -0.0, 1.0, -2.5, 0.1, 1e-30, 3e38, -7.0])
corner = st.tuples(coordinates, coordinates, coordinates)
blanks = st.sampled_from([" ", "\n", "\t", "\r\n", "   \n\n"])


@st.composite
def spellings(draw: st.DrawFn) -> tuple[list[Any], bytes]:
    """Triangles, and a legal text file of them, of one or more solids."""
    triangles = draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=8))
    text = ""
    name = draw(st.sampled_from(["", " part", " facet 3 of solid vertex"]))
    for place, triangle in enumerate(triangles):
        if place == 0 or draw(st.booleans()):
            text += ("endsolid\n" if place else "") + f"solid{name}\n"
        words = ["facet normal 0 nan -1e5", "outer loop"]
        words += [
            "vertex " + " ".join(draw(st.sampled_from([repr(x), f"{x:.17e}", f"{x:g}"])) for x in one)
            for one in triangle
        ]
        words += ["endloop"] * draw(st.booleans()) + ["endfacet"] * draw(st.booleans())
        text += "".join(word + draw(blanks) for word in " ".join(words).split()).rstrip() + "\n"
    text += f"endsolid{name}\n"
    return triangles, (text.upper() if draw(st.booleans()) else text).encode()


def first_occurrences(triangles: list[Any]) -> tuple[list[Any], list[list[int]]]:
    numbers: dict[Any, int] = {}
    faces = [[numbers.setdefault(tuple(x + 0.0 for x in one), len(numbers)) for one in each] for each in triangles]
    return [list(point) for point in numbers], faces


@given(spellings())
@settings(max_examples=80)
def test_any_legal_text_reads_back_to_the_same_mesh(spelling: tuple[list[Any], bytes]) -> None:
    triangles, data = spelling
    mesh, notes = read(data)
    points, faces = first_occurrences(triangles)
    assert notes == []
    assert mesh.vertices.tolist() == points
    assert mesh.faces.tolist() == faces


@given(
    st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=8), st.binary(max_size=60), st.binary(max_size=80)
)
@settings(max_examples=100)
def test_any_binary_file_reads_back_to_the_same_mesh(triangles: list[Any], behind: bytes, head: bytes) -> None:
    mesh, notes = read(binary(np.array(triangles), head=head) + behind)
    rounded = np.array(triangles, np.float32).astype(float)
    points, faces = first_occurrences([[tuple(one) for one in each] for each in rounded.tolist()])
    assert mesh.vertices.tolist() == points
    assert mesh.faces.tolist() == faces
    assert notes == [f"{len(behind)} bytes follow the last facet: left out"] * bool(behind)
