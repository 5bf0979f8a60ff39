"""OBJ files for tests: read from bytes, taken apart, and written in random legal ways."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import strategies as st

from meshtide_codec.attributes import Attribute, Domain
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.obj import read_obj
from meshtide_codec.mesh_files.source import Source
from plain_obj import Corner, turned

if TYPE_CHECKING:
    from pathlib import Path

    from meshtide_codec.mesh import Mesh
    from meshtide_codec.scene import Scene

Rows = list[tuple[float, ...]]


def read_bytes(
    data: bytes | str, folder: Path | None = None, limits: FileLimits | None = None
) -> tuple[Scene, list[str]]:
    """The scene of an OBJ file, and what its reader told."""
    source = Source("a.obj", ".obj", data.encode() if isinstance(data, str) else data, folder)
    return read_obj(source, limits or FileLimits()), source.notes


def attribute(mesh: Mesh, name: str) -> Attribute:
    return next(one for one in mesh.attributes if one.name == name)


def faces_of(mesh: Mesh) -> list[list[Corner]]:
    """The polygons of a mesh as a plain reader has them, each from its smallest corner on."""
    tables = {one.name: one for one in mesh.attributes}
    vertices = mesh.faces.reshape(-1)

    def row(name: str, corner: int) -> int | None:
        one = tables.get(name)
        if one is None:
            return None
        places = {Domain.VERTEX: vertices[corner], Domain.CORNER: corner, Domain.FACE: corner // 3}
        found = int(one.rows()[places[one.domain]])
        return None if found < 0 else found

    return [
        turned([(int(vertices[corner]), row("TEXCOORD_0", corner), row("NORMAL", corner)) for corner in outline])
        for outline in mesh.polygon_corners()
    ]


_COORDINATES = st.floats(-1e6, 1e6) | st.floats(-1, 1) | st.integers(-99, 99).map(float)
_SPELLINGS = st.sampled_from(["{!r}", "{:.17g}", "{:.17e}", "{:+.17g}", "{:.17E}"])
_GAPS = st.sampled_from([" ", "  ", "\t", " \t ", " \\\n", "\\ \t\n  "])
_LINES_BETWEEN = st.sampled_from(
    ["", "# v 1 2 3", " \t", "g a b", "s 1", "usemtl m", "l 1 2", "vp 1 2", "# end \\", "o x"]
)


@st.composite
def written_in_random_ways(draw: st.DrawFn) -> tuple[bytes, dict[str, Rows], list[list[Corner]]]:
    """An OBJ file, the tables of its v, vt and vn, and its faces."""
    tables = {
        word: draw(st.lists(st.tuples(*[_COORDINATES] * width), min_size=least, max_size=7))
        for word, width, least in (("v", 3, 3), ("vt", 2, 0), ("vn", 3, 0))
    }
    faces = draw(st.lists(_faces({word: len(rows) for word, rows in tables.items()}), min_size=1, max_size=6))
    before = dict.fromkeys(tables, 0)  # how much of each table stands before the next face
    lines: list[str] = []
    for face in faces:
        for place, (word, rows) in enumerate(tables.items()):
            known = draw(st.integers(before[word], len(rows)))
            lines += [_row(draw, word, row) for row in rows[before[word] : known]]
            before[word] = known
            del place
        lines.append(_face(draw, face, before))
        lines.append(draw(_LINES_BETWEEN))
    for word, rows in tables.items():
        lines += [_row(draw, word, row) for row in rows[before[word] :]]
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    text = "\n".join([*lines, ""]).replace("\n", end)
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]))
    return text.encode(encoding), tables, [turned(face) for face in faces]


@st.composite
def _faces(draw: st.DrawFn, sizes: dict[str, int]) -> list[Corner]:
    count = draw(st.integers(3, min(6, sizes["v"])))
    vertices = draw(st.permutations(range(sizes["v"])))[:count]
    others = [
        [draw(st.integers(0, sizes[word] - 1)) for _ in vertices]
        if sizes[word] and draw(st.booleans())
        else [None] * count
        for word in ("vt", "vn")
    ]
    return list(zip(vertices, *others, strict=True))


def _row(draw: st.DrawFn, word: str, row: tuple[float, ...]) -> str:
    return _line(draw, [word, *(draw(_SPELLINGS).format(number) for number in row)])


def _face(draw: st.DrawFn, face: list[Corner], before: dict[str, int]) -> str:
    words = [draw(st.sampled_from(["f", "fo"]))]
    for corner in face:
        parts = []
        for row, known in zip(corner, before.values(), strict=True):
            relative = row is not None and row < known and draw(st.booleans())
            parts.append("" if row is None else str(row - known if relative else row + 1))
        slashes = draw(st.booleans())  # those at the end may be left out
        words.append("/".join(parts) if slashes else "/".join(parts).rstrip("/"))
    return _line(draw, words)


def _line(draw: st.DrawFn, words: list[str]) -> str:
    gaps = [draw(_GAPS) for _ in words[1:]]
    start = draw(st.sampled_from(["", "", " ", "\t"]))
    end = draw(st.sampled_from(["", "", " ", " # note", "\t#"]))
    return start + words[0] + "".join(gap + word for gap, word in zip(gaps, words[1:], strict=True)) + end
