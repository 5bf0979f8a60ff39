"""Headers of PLY files: all that is legal, or common, and what is not understood."""

from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.ply.header import LONGEST_HEADER, TYPES, PlyHeader, PlyProperty, read_header

HEADER = b"""ply
format binary_big_endian 1.0
comment by hand
obj_info none
element vertex 3
property float x
property list uchar short flags

element nothing 7
element Face 1
PROPERTY List UCHAR Int vertex_indices
property int64 red
end_header
"""


def described(header: PlyHeader) -> list[tuple[str, int, int]]:
    return [(each.name, each.count, each.smallest) for each in header.elements]


def test_a_header_tells_encoding_and_elements() -> None:
    header = read_header(HEADER + b"rows")
    assert (header.order, header.is_text, header.body) == (">", False, len(HEADER))
    assert described(header) == [("vertex", 3, 5), ("nothing", 7, 0), ("Face", 1, 9)]
    assert header.elements[0].properties == [
        PlyProperty("x", np.dtype("f4")),
        PlyProperty("flags", np.dtype("i2"), np.dtype("u1")),
    ]
    assert header.comments == ("by hand", "obj_info none")
    assert header.notes == ()
    found = header.element("face")
    assert found is not None
    assert found.name == "Face"
    assert header.element("edge") is None


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r", b"  \n", b"\t\r\n"])
def test_lines_end_in_any_way(end: bytes) -> None:
    data = HEADER.replace(b"\n", end)
    for body in (b"", b"\n\n", b"\r\n", b"\x00\r"):
        header = read_header(data + body)
        assert header.body == len(data)
        assert described(header) == described(read_header(HEADER))
    assert read_header(b"\xef\xbb\xbf" + data).body == 3 + len(data)


def test_a_last_line_needs_no_end() -> None:
    assert read_header(HEADER[:-1]).body == len(HEADER) - 1


def test_every_type_has_its_size() -> None:
    for name, kind in TYPES.items():
        header = read_header(f"ply\nformat ascii 1.0\nelement a 1\nproperty {name} b\nend_header\n".encode())
        assert header.is_text
        assert header.elements[0].properties[0].item == np.dtype(kind)
        digits = "".join(filter(str.isdigit, name))
        assert not digits or int(digits) == 8 * np.dtype(kind).itemsize


def test_lines_that_lack_the_word_comment_are_told() -> None:
    header = read_header(HEADER.replace(b"comment by", b"by").replace(b"obj_info none", b"f\xfcr \xe4lle"))
    assert header.comments == ("by hand", "für älle")
    assert header.notes == (
        "line 3 of the header is not a comment, but read as one: 'by hand'",
        "line 4 of the header is not a comment, but read as one: 'für älle'",
    )


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "has no end_header"),
        (b"hello\n", "does not begin with the word ply"),
        (b"\nply\n", "does not begin with the word ply"),
        (HEADER.replace(b"UCHAR Int", b"uchar big"), "line 11 .* 'PROPERTY List uchar big vertex_indices'"),
        (HEADER.replace(b"UCHAR Int", b"float Int"), "line 11 .* not understood"),
        (HEADER.replace(b"float x", b"float"), "line 6 .* not understood"),
        (b"ply\nproperty float x\n", "line 2 of the PLY header is not understood"),
        (b"ply\nformat ascii 1.0\nformat ascii 1.0\n", "line 3 of the PLY header is not understood"),
        (b"ply\nformat ascii 1.0\nelement vertex\n", "line 3 .* not understood"),
        (b"ply\nformat ascii 1.0\nelement vertex -5\n", "line 3 .* not understood"),
        ("ply\nformat ascii 1.0\nelement vertex ٣\n".encode(), "line 3 .* not understood"),
        (b"ply\nformat utf-8 1.0\n", "line 2 .* not understood"),
        (b"ply\nformat ascii 1.0\nelement vertex " + b"9" * 19, "declares 9999999999999999999... rows, which no file"),
        (b"ply\nend_header\n", "does not name a format"),
        (b"ply\nformat ascii 1.0\n" + b"comment\n" * 5000, "no end_header"),
        (b"ply\ncomment " + b"x" * LONGEST_HEADER, "no end_header within its first 1048576 bytes"),
        (HEADER.replace(b"nothing", b"VERTEX"), "declares the element 'VERTEX' twice"),
        (HEADER.replace(b"red", b"vertex_indices"), "declares 'vertex_indices' of Face twice"),
    ],
)
def test_headers_that_are_not_understood(data: bytes, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        read_header(data)


def test_a_header_that_is_cut_short_anywhere_is_refused() -> None:
    for length in range(len(HEADER) - 1):
        with pytest.raises(MeshFileError):
            read_header(HEADER[:length])
