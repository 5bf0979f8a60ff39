"""PLY files in all legal variants, made value by value, for the tests of their reader."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from hypothesis import strategies as st

from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.ply import read_ply
from meshtide_codec.mesh_files.source import Source
from meshtide_codec.scene import Scene

LITTLE, BIG, TEXT = "binary_little_endian", "binary_big_endian", "ascii"
FORMS = (TEXT, LITTLE, BIG)
CODES = {
    **dict.fromkeys(("char", "int8"), "b"),
    **dict.fromkeys(("uchar", "uint8"), "B"),
    **dict.fromkeys(("short", "int16"), "h"),
    **dict.fromkeys(("ushort", "uint16"), "H"),
    **dict.fromkeys(("int", "int32"), "i"),
    **dict.fromkeys(("uint", "uint32"), "I"),
    "int64": "q",
    "uint64": "Q",
    **dict.fromkeys(("float", "float32"), "f"),
    **dict.fromkeys(("double", "float64"), "d"),
}
INTEGERS = tuple(name for name, code in CODES.items() if code not in "fd")
XYZ = ("float x", "float y", "float z")
INDICES = "list uchar int vertex_indices"
TRIANGLE = ((0, 0, 0), (1, 0, 0), (0, 1, 0))
SQUARE = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))


@dataclass
class Element:
    """An element: its name, its properties as the header has them, and its rows; a list stands as a list."""

    name: str
    properties: Sequence[str] = ()
    rows: Sequence[Sequence[Any]] = ()
    count: object = None


@dataclass
class Style:
    """How a file is written: its form, what ends header lines, what stands between words, other header lines."""

    form: str = TEXT
    end: bytes = b"\n"
    between: Callable[[], bytes] = field(default=lambda: b" ")
    after_row: Callable[[], bytes] = field(default=lambda: b"\n")
    lines: Sequence[bytes] = ()
    mark: bytes = b""


def ply(*elements: Element, form: str = TEXT, style: Style | None = None) -> bytes:
    """The file of some elements."""
    style = style or Style(form)
    lines = [b"ply", f"format {style.form} 1.0".encode(), *style.lines]
    body = []
    for each in elements:
        count = len(each.rows) if each.count is None else each.count
        lines.append(f"element {each.name} {count}".encode())
        lines += [f"property {one}".encode() for one in each.properties]
        kinds = [one.split()[:-1] for one in each.properties]
        body += [_row(kinds, row, style) for row in each.rows]
    return style.mark + b"".join(line + style.end for line in [*lines, b"end_header"]) + b"".join(body)


def _row(kinds: Sequence[Sequence[str]], row: Sequence[Any], style: Style) -> bytes:
    values: list[tuple[str, Any]] = []
    for kind, value in zip(kinds, row, strict=True):
        if len(kind) == 1:
            values.append((kind[0], value))
        else:
            values += [(kind[1], len(value)), *((kind[2], item) for item in value)]
    if style.form == TEXT:
        words = [_word(kind, value) for kind, value in values]
        return b"".join(word + style.between() for word in words[:-1]) + words[-1] + style.after_row()
    order = "<" if style.form == LITTLE else ">"
    return b"".join(struct.pack(order + CODES[kind.lower()], value) for kind, value in values)


def _word(kind: str, value: Any) -> bytes:
    return repr(float(value)).encode() if CODES[kind.lower()] in "fd" else str(value).encode()


def vertex(rows: Sequence[Sequence[Any]] = TRIANGLE, *more: str) -> Element:
    return Element("vertex", (*XYZ, *more), rows)


def face(*rows: Sequence[Any], more: Sequence[str] = ()) -> Element:
    """Faces; a row is the list of vertices, or that and the values of `more`."""
    return Element("face", (INDICES, *more), rows if more else [(row,) for row in rows])


def read(data: bytes, limits: FileLimits | None = None, **source: Any) -> tuple[Scene, list[str]]:
    """The scene of a file, and what is told of it."""
    opened = Source("a.ply", ".ply", data, **source)
    return read_ply(opened, limits or FileLimits()), opened.notes


def mesh_in(data: bytes, limits: FileLimits | None = None) -> Mesh:
    scene, _ = read(data, limits)
    mesh = scene.geometries[0]
    return Mesh.checked(mesh.vertices, mesh.faces, mesh.attributes, mesh.materials, mesh.polygons)


def outlines(mesh: Mesh) -> list[list[int]]:
    """The polygons of a mesh, each from its smallest vertex on."""
    found = mesh.polygons_as_lists()
    return [each[(at := each.index(min(each))) :] + each[:at] for each in found]


@dataclass
class Variant:
    """A file and what it holds."""

    data: bytes
    vertices: np.ndarray[Any, Any]
    polygons: list[list[int]]
    scalars: dict[str, list[Any]]


@st.composite
def variants(draw: st.DrawFn, forms: Sequence[str] = FORMS) -> Variant:
    """A mesh of some polygons in a legal file of any style."""
    count = draw(st.integers(3, 9))
    quarters = st.integers(-40, 40).map(lambda value: value / 4)
    positions = draw(st.lists(st.tuples(quarters, quarters, quarters), min_size=count, max_size=count))
    shuffled = st.permutations(range(count))
    polygons = [list(draw(shuffled)[: draw(st.integers(3, min(count, 6)))]) for _ in range(draw(st.integers(1, 5)))]
    scalars: dict[str, list[Any]] = {}
    kind = draw(st.sampled_from(["float", "double", "float32", "float64"]))
    columns = [(f"{kind} {axis}", [row[at] for row in positions]) for at, axis in enumerate("xyz")]
    columns += draw(_more_columns("v", count, scalars))
    own = draw(st.sampled_from(["vertex_indices", "vertex_index", "Vertex_Indices"]))
    list_type, item_type = draw(st.sampled_from(INTEGERS)), draw(st.sampled_from(INTEGERS))
    faces = [(f"list {list_type} {item_type} {own}", polygons), *draw(_more_columns("f", len(polygons), scalars))]
    elements = [
        _element(draw(_cased("vertex")), draw(st.permutations(columns))),
        _element(draw(_cased("face")), draw(st.permutations(faces))),
        *draw(st.lists(_unknown_elements(), max_size=2, unique_by=lambda each: each.name)),
    ]
    blanks = st.sampled_from([b" ", b"\t", b"\n", b"\r\n", b"  ", b" \n\n "])
    style = Style(
        draw(st.sampled_from(forms)),
        draw(st.sampled_from([b"\n", b"\r\n", b"\r", b" \n"])),
        draw(st.sampled_from([lambda: b" ", lambda: draw(blanks)])),
        draw(st.sampled_from([lambda: b"\n", lambda: draw(blanks)])),
        draw(st.lists(st.sampled_from([b"comment \xe4\xf6", b"", b"obj_info x", b"Comment Y", b"made by me"]))),
        draw(st.sampled_from([b"", b"\xef\xbb\xbf"])),
    )
    return Variant(ply(*draw(st.permutations(elements)), style=style), np.array(positions), polygons, scalars)


def _cased(name: str) -> st.SearchStrategy[str]:
    return st.sampled_from([name, name.upper(), name.capitalize()])


@st.composite
def _more_columns(draw: st.DrawFn, letter: str, rows: int, scalars: dict[str, list[Any]]) -> list[tuple[str, Any]]:
    columns: list[tuple[str, Any]] = []
    for at in range(draw(st.integers(0, 2))):
        kind = draw(st.sampled_from(sorted(CODES)))
        small = st.lists(st.integers(0, 100), min_size=rows, max_size=rows)
        if draw(st.booleans()):
            scalars[f"{letter}value{at}"] = draw(small)
            columns.append((f"{kind} {letter}value{at}", scalars[f"{letter}value{at}"]))
        else:
            lengths = draw(st.lists(st.integers(0, 3), min_size=rows, max_size=rows))
            length_type = draw(st.sampled_from(INTEGERS))
            columns.append((f"list {length_type} {kind} {letter}more{at}", [[7] * length for length in lengths]))
    return columns


@st.composite
def _unknown_elements(draw: st.DrawFn) -> Element:
    rows = draw(st.integers(0, 3))
    columns = draw(_more_columns("u", rows, {}))
    if not columns:
        return Element(draw(st.sampled_from(["nothing", "none"])), (), [], draw(st.integers(0, 10**15)))
    return _element(draw(st.sampled_from(["edge", "camera"])), columns)


def _element(name: str, columns: Sequence[tuple[str, Sequence[Any]]]) -> Element:
    rows = list(zip(*(values for _, values in columns), strict=True))
    return Element(name, [declared for declared, _ in columns], rows)
