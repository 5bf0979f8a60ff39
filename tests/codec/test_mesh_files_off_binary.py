"""OFF files in binary form: big-endian, colours behind the faces, no line that ends anything."""

from __future__ import annotations

import struct
import tracemalloc
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.attributes import NONE, Domain
from meshtide_codec.errors import MeshError, MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.read import mesh_of, read_source
from meshtide_codec.mesh_files.source import Source
from off_files import FACES, LIMITS, SQUARE, read, values


def binary(header: bytes, *rows: tuple[str, list[float]]) -> bytes:
    return header + b"\n" + b"".join(struct.pack(f">{kind}", *numbers) for kind, numbers in rows)


def test_binary_files() -> None:
    points: list[tuple[str, list[float]]] = [("3f", point) for point in SQUARE]
    faces: list[tuple[str, list[float]]] = [("5i", [3, 0, 1, 2, 0]), ("6i3f", [4, 0, 1, 2, 3, 3, 0.5, 1, 0])]
    mesh, notes = read(binary(b"OFF BINARY", ("3i", [4, 2, 0]), *points, *faces))
    assert mesh.vertices.tolist() == SQUARE
    assert mesh.polygons_as_lists() == [[0, 1, 2], [0, 1, 2, 3]]
    assert values(mesh, "COLOR_0") == [[0.5, 1, 0]]
    assert notes == []
    same = [("5i", [3, 0, 1, 2, 0]), ("5i", [3, 0, 2, 3, 0])]
    mesh, notes = read(b"# by hand\n" + binary(b"nOFF BINARY\r", ("4i", [3, 4, 2, 0]), *points, *same) + b"end")
    assert mesh.faces.tolist() == FACES
    assert notes == ["3 bytes follow the last face: left out"]


@pytest.mark.parametrize("size", [3, 4])
def test_binary_colours_of_vertices(size: int) -> None:
    row = [0.0, 0, 0, 0, 0, 1, *[0.5, 1, 0, 0.25][:size], 0.75, 0.5]
    rows: list[tuple[str, list[float]]] = [(f"{len(row)}f", row)] * 3
    mesh, _ = read(binary(b"STCNOFF BINARY", ("3i", [3, 1, 0]), *rows, ("5i", [3, 0, 1, 2, 0])))
    assert values(mesh, "NORMAL") == [[0, 0, 1]] * 3
    assert values(mesh, "COLOR_0") == [[0.5, 1, 0, 0.25][:size]] * 3
    assert values(mesh, "TEXCOORD_0") == [[0.75, 0.5]] * 3


BINARY = binary(b"OFF BINARY", ("3i", [3, 2, 0]), ("9f", [0.0] * 9), ("5i", [3, 0, 1, 2, 0]), ("2i", [0, 0]))

REFUSED: dict[str, tuple[bytes, str]] = {
    "other dimensions": (binary(b"nOFF BINARY", ("4i", [4, 3, 1, 0])), "4 dimensions"),
    "cut in its counts": (BINARY[:20], "ends within its counts"),
    "below zero": (binary(b"OFF BINARY", ("3i", [-1, 1, 0])), "declares -1 vertices and 1 faces"),
    "two billion": (binary(b"OFF BINARY", ("3i", [2**31 - 1, 1, 0])), "claims 2147483647 vertices"),
    "rows missing": (binary(b"OFF BINARY", ("3i", [900, 5, 0])), "900 vertices and 5 faces .*, 0 bytes follow"),
    "a corner too high": (BINARY[:-20] + struct.pack(">5i", 1, 3, 0, 0, 0), "face 0 names vertex 3"),
    "a colour of seven": (BINARY[:-12] + struct.pack(">3i", 7, 0, 0), "colour of 7 values"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(case: str) -> None:
    data, message = REFUSED[case]
    with pytest.raises(MeshFileError, match=message):
        read(data)


@pytest.mark.parametrize("case", ["two billion", "rows missing"])
def test_a_bomb_is_refused_before_memory_is_taken(case: str) -> None:
    data, _ = REFUSED[case]
    tracemalloc.start()
    try:
        with pytest.raises(MeshFileError, match="cut short"):
            read(data, FileLimits(vertices=1 << 60, faces=1 << 60))
        assert tracemalloc.get_traced_memory()[1] < 200_000
    finally:
        tracemalloc.stop()


WHOLE = [
    BINARY,
    binary(b"COFF BINARY", ("3i", [3, 1, 0]), ("21f", [0.5] * 21), ("5i4f", [3, 0, 1, 2, 4, 1, 1, 1, 1])),
]


@pytest.mark.parametrize("data", WHOLE)
def test_a_file_that_is_cut_off_anywhere_is_refused(data: bytes) -> None:
    assert read(data)[1] == (["faces of fewer than three different corners, left out: 1"] if data == BINARY else [])
    for length in range(len(data)):
        with pytest.raises(MeshFileError):
            read(data[:length])


@given(st.sampled_from(WHOLE), st.data())
@settings(max_examples=100)
def test_damage_is_read_or_refused_with_a_reason(data: bytes, draw: st.DataObject) -> None:
    damaged = bytearray(data)
    for _ in range(draw.draw(st.integers(1, 4))):
        damaged[draw.draw(st.integers(0, len(data) - 1))] = draw.draw(st.integers(0, 255))
    try:
        mesh = mesh_of(read_source(Source("a.off", ".off", bytes(damaged)), LIMITS)).mesh
    except MeshError as error:
        assert str(error)
    else:
        assert len(mesh.faces) > 0


single = st.floats(allow_nan=False, allow_infinity=False, width=32)


@given(st.data(), st.integers(3, 8))
@settings(max_examples=60)
def test_any_binary_file_reads_back_to_the_same_mesh(data: st.DataObject, count: int) -> None:
    normal, color, texture = (data.draw(st.booleans()) for _ in range(3))
    width = 3 + 3 * normal + 4 * color + 2 * texture
    part = st.floats(0, 1, width=32)
    rows = data.draw(st.lists(st.tuples(single, single, single, *[part] * (width - 3)), min_size=count, max_size=count))
    polygon = st.lists(st.integers(0, count - 1), min_size=3, max_size=min(6, count), unique=True)
    faces = data.draw(st.lists(st.tuples(polygon, st.sampled_from([0, 3, 4])), min_size=1, max_size=5))
    keyword = b"ST" * texture + b"C" * color + b"N" * normal + b"OFF BINARY"
    body: list[tuple[str, list[Any]]] = [(f"{width}f", list(row)) for row in rows]
    body += [(f"{len(one) + 2}i{size}f", [len(one), *one, size, *[0.5] * size]) for one, size in faces]
    mesh, notes = read(binary(keyword, ("3i", [count, len(faces), 0]), *body))
    assert [note for note in notes if "cross themselves" not in note] == []  # as random polygons may
    assert mesh.vertices.tolist() == [list(row[:3]) for row in rows]
    assert [rotated(one) for one in mesh.polygons_as_lists()] == [rotated(one) for one, _ in faces]
    assert values(mesh, "NORMAL") == ([list(row[3:6]) for row in rows] if normal else None)
    assert values(mesh, "TEXCOORD_0") == ([list(row[-2:]) for row in rows] if texture else None)
    of_faces = [one for one in mesh.attributes if one.domain is Domain.FACE]
    colored = [size > 0 for one, size in faces for _ in one[2:]]
    assert [(one.rows() != NONE).tolist() for one in of_faces] == [colored] * any(colored)


def rotated(polygon: list[int]) -> list[int]:
    first = polygon.index(min(polygon))
    return polygon[first:] + polygon[:first]
