"""Text formats in every encoding of Unicode, and with bytes that no text has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.encodings import decoded, has_control, plain_text, wide_encoding, without_control
from meshtide_codec.mesh_files.read import read_source
from meshtide_codec.mesh_files.source import Source

if TYPE_CHECKING:
    from pathlib import Path

    from meshtide_codec.mesh import Mesh

WIDE = ("utf-16-le", "utf-16-be", "utf-32-le", "utf-32-be")
POSITIONS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
PLY_HEADER = (
    "ply\nformat ascii 1.0\ncomment é\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
)
TEXTS = {
    ".obj": "# é\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    ".off": "OFF # é\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    ".ply": f"{PLY_HEADER}0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    ".stl": (
        "solid é\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
        "endsolid é\n"
    ),
}
"""The same triangle in each format of text; the last line of each is not a name but in STL."""
HARMLESS = {
    ".obj": (1, 3),
    ".off": (5, 7),
    ".ply": (TEXTS[".ply"].index("comment") + 8, TEXTS[".ply"].index("\nelement")),
    ".stl": (6, 7),
}
"""Where the comment or the name is, up to the end of its line."""


def read(suffix: str, data: bytes) -> Mesh:
    return read_source(Source("a", suffix, data), FileLimits()).mesh()


@pytest.mark.parametrize("suffix", TEXTS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16", "utf-32", *WIDE])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_text_is_read_in_each_encoding(suffix: str, encoding: str, end: str) -> None:
    text = TEXTS[suffix].replace("\n", end)
    assert read(suffix, text.encode(encoding)).vertices.tolist() == POSITIONS
    if encoding in WIDE:
        assert read(suffix, f"\ufeff{text}".encode(encoding)).vertices.tolist() == POSITIONS


@pytest.mark.parametrize("suffix", TEXTS)
@given(place=st.floats(0, 1), code=st.integers(0, 31), instead=st.booleans())
def test_a_control_byte_in_a_number_or_statement_is_refused(
    suffix: str,
    place: float,
    code: int,
    instead: bool,
) -> None:
    text = TEXTS[suffix]
    at = int(place * (text.rindex("endfacet") if suffix == ".stl" else len(text) - 2))
    first, last = HARMLESS[suffix]
    if chr(code) in "\t\n\v\f\r" or (at == last and instead):  # then the comment goes on
        return
    damaged = (text[:at] + chr(code) + text[at + instead :]).encode()
    if first <= at <= last:
        assert read(suffix, damaged).vertices.tolist() == POSITIONS
    else:
        with pytest.raises(MeshFileError):
            read(suffix, damaged)


@pytest.mark.parametrize(
    ("suffix", "old", "new", "line"),
    [
        (".obj", "v 1 0 0", "v 1\x000 0", 3),
        (".obj", "v 1 0 0", "v\x001 0 0", 3),
        (".obj", "v 1 0 0", "\x1cv 1 0 0", 3),
        (".obj", "f 1 2 3", "f 1 2\x1f3", 5),
        (".obj", "f 1 2 3", "\0\0\0\0", 5),
        (".obj", "f 1 2 3", "use\0mtl a\nf 1 2 3", 5),
        (".off", "\n1 0 0", "\n1\x000 0", 4),
        (".off", "3 1 0", "3 1 \x010", 2),
        (".ply", "\n1 0 0", "\n1\x1c0 0", 12),
        (".ply", "element vertex 3", "element vertex\x1c3", 4),
        (".stl", "vertex 1 0 0", "vertex 1\x000 0", 5),
        (".stl", "outer loop", "outer\x1floop", 3),
    ],
)
def test_a_control_byte_is_refused_with_its_line(suffix: str, old: str, new: str, line: int) -> None:
    data = TEXTS[suffix].replace(old, new, 1).encode()
    with pytest.raises(MeshFileError, match=rf"line {line}\b.*control byte"):
        read(suffix, data)


def test_control_bytes_in_names_and_comments_of_obj_files_are_kept() -> None:
    text = b"o a\x01b\nv 0 0 0 # \x02\nv 1 0 0\nv 0 1 0\ng \0x\nf 1 2 3\n\x1a\0\0"
    scene = read_source(Source("a", ".obj", text), FileLimits())
    assert scene.mesh().vertices.tolist() == POSITIONS


def test_a_material_file_may_be_wide_and_its_damaged_lines_are_told(tmp_path: Path) -> None:
    obj = "mtllib a.mtl\n" + TEXTS[".obj"].replace("f", "usemtl r\u00f6t\nf")
    for encoding in (*WIDE, "utf-16", "utf-32"):
        (tmp_path / "a.mtl").write_bytes("newmtl r\u00f6t\nKd 0.25 0.5 1\n".encode(encoding))
        source = Source("a.obj", ".obj", obj.encode("utf-16"), tmp_path)
        (material,) = read_source(source, FileLimits()).materials
        assert material.name == "r\u00f6t"
        assert material.properties["pbrMetallicRoughness"]["baseColorFactor"] == [0.25, 0.5, 1, 1]
        assert source.notes == []
    (tmp_path / "a.mtl").write_bytes("newmtl r\u00f6t\nKd 0.25\x1f0.5 1\nd 0.5\n".encode())
    source = Source("a.obj", ".obj", obj.encode(), tmp_path)
    (material,) = read_source(source, FileLimits()).materials
    assert material.properties["pbrMetallicRoughness"]["baseColorFactor"] == [1, 1, 1, 0.5]
    assert source.notes == ["'a.mtl': lines with control bytes, left out: 1"]


@given(st.text(alphabet=st.characters(max_codepoint=0x7F, exclude_characters="\0"), min_size=2))
def test_wide_text_without_a_mark_is_known(text: str) -> None:
    assert wide_encoding(text.encode()) == ""
    for encoding in WIDE:
        data = (text * 2).encode(encoding)
        assert wide_encoding(data) == encoding
        assert decoded(data) == (text * 2).encode()


def test_binary_files_are_no_wide_text() -> None:
    for data in (b"", b"\0", bytes(100), b"v\0", b"OFF BINARY\n" + bytes([0, 0, 0, 5] * 100), b"\0\0\0\5\0\1\2\3"):
        assert wide_encoding(data) == ""


def test_marks_and_line_ends() -> None:
    assert plain_text(b"a\rb\r\nc\n") == b"a\nb\nc\n"
    for encoding in ("utf-8-sig", "utf-16", "utf-32"):
        assert plain_text("v \u00e9".encode(encoding)) == "v \u00e9".encode()
    assert plain_text(b"\xff\xfev\0\n\0\x00\xd8") == b"v\n\xef\xbf\xbd"
    assert plain_text(b"v 1\n\x1a\0\x1a\0") == b"v 1\n"
    assert plain_text(b"v 1\n\0") == b"v 1\n\0"
    text = b"no comment"
    assert plain_text(text) is text
    assert without_control(text) is text


def test_control_bytes_are_seen() -> None:
    for code in range(256):
        expected = code < 32 and chr(code) not in "\t\n\v\f\r"
        text = bytes([65, code, 66])
        assert has_control(np.frombuffer(text, np.uint8)) == expected
        assert without_control(text) == (b"A?B" if expected else text)
