"""Whether a file holds the rows that it declares: headers that are read, and files that were cut off."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import MeshFileError
from meshtide_codec.file_checks import (
    check_off_rows,
    check_ply_rows,
    check_rows,
    read_off_counts,
    read_ply_header,
)
from meshtide_codec.file_checks.text_lines import LONGEST_LINE, filled_lines, lines

PLY = b"""ply
format ascii 1.0
comment by hand
obj_info none
element vertex 3
property float x
property float y
property float z
property list uchar short flags
element nothing 7
element face 1
property list uchar int vertex_indices
property uchar red
end_header
"""
PLY_ROWS = [b"0 0 0 0", b"1 0 0 2 7 7", b"", b"0 1 0 1 7 and more", b"3 0 1 2 255"]
OFF = b"# by hand\nOFF\n3 1 3 # counts\n"
OFF_ROWS = [b"0 0 0", b"1 0 0 255 0 0", b"# between", b"0 1 0", b"3 0 1 2 0.5"]


def check_ply(data: bytes) -> None:
    file = io.BytesIO(data)
    check_ply_rows(file, len(data), read_ply_header(file))


def check_off(data: bytes) -> None:
    file = io.BytesIO(data)
    check_off_rows(file, *read_off_counts(file))


def test_a_header_tells_encoding_and_elements() -> None:
    header = read_ply_header(io.BytesIO(PLY))
    assert header.encoding == "ascii"
    assert [(each.name, each.count, each.smallest, each.lists) for each in header.elements] == [
        ("vertex", 3, 13, [False, False, False, True]),
        ("nothing", 7, 0, []),
        ("face", 1, 2, [True, False]),
    ]
    assert [header.count(name) for name in ("vertex", "face", "edge")] == [3, 1, 0]


def test_binary_rows_are_held_against_the_bytes() -> None:
    head = PLY.replace(b"ascii", b"binary_big_endian")
    check_ply(head + bytes(3 * 13 + 2))
    with pytest.raises(MeshFileError, match="at least 41 bytes of rows, but 40 follow"):
        check_ply(head + bytes(3 * 13 + 1))


@given(st.data())
def test_a_text_file_that_was_cut_off_is_refused(data: st.DataObject) -> None:
    for check, head, rows in ((check_ply, PLY, PLY_ROWS), (check_off, OFF, OFF_ROWS)):
        whole = head + b"\n".join(rows)
        check(whole)
        check(whole + b"\n\n")
        lines_left = data.draw(st.integers(0, len(rows) - 1))
        with pytest.raises(MeshFileError, match=r"ends after|lines follow"):
            check(head + b"\n".join(rows[:lines_left]))
        row = data.draw(st.sampled_from([at for at, each in enumerate(rows) if each[:1].isdigit()]))
        words = rows[row].split()
        least = {b"0 1 0 1 7 and more": 5, b"1 0 0 255 0 0": 3, b"3 0 1 2 0.5": 4}.get(rows[row], len(words))
        kept = words[: data.draw(st.integers(1, least - 1))]
        with pytest.raises(MeshFileError, match="fewer"):
            check(head + b"\n".join([*rows[:row], b" ".join(kept), *rows[row + 1 :]]))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (PLY.replace(b"uchar int", b"uchar big") + b"", "line 12 .* 'property list uchar big vertex_indices'"),
        (b"ply\nproperty float x\n", "line 2 of the PLY header is not understood"),
        (b"ply\nformat ascii 1.0\nelement vertex " + b"9" * 19, "which no file holds"),
        (b"ply\nformat ascii 1.0\n", "no end_header"),
        (PLY + b"0 0 0 x\n", "row 0 of vertex has fewer values"),
        (PLY + b"0 0 0 " + b"9" * 5000, "row 0 of vertex has fewer values"),
    ],
)
def test_ply_files_that_are_not_understood(data: bytes, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        check_ply(data)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "does not begin with OFF"),
        (b"OFF\n", "does not tell its numbers"),
        (b"OFF -3 1 0\n", "does not tell its numbers"),
        (b"OFF 1 1 0\n0 0 0\nx 0 0\n", "face 0 .* fewer corners"),
        (b"OFF 1 1 0\n0 0 0\n" + b"9" * 5000, "face 0 .* fewer corners"),
    ],
)
def test_off_files_that_are_not_understood(data: bytes, message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        check_off(data)


def test_other_formats_pass_unread(tmp_path: Path) -> None:
    for name in ("a.obj", "a.stl", "a.unknown"):
        (tmp_path / name).write_bytes(b"anything")
        check_rows(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        check_rows(tmp_path / "missing.ply")


def test_lines_end_somewhere() -> None:
    assert list(lines(io.BytesIO(b"a\r\n\nb"))) == [b"a", b"", b"b"]
    assert list(filled_lines(io.BytesIO(b"a # b\n\n # c\n d \n"))) == [b"a", b"d"]
    with pytest.raises(MeshFileError, match="a line is longer than"):
        list(lines(io.BytesIO(b"x" * (LONGEST_LINE + 1))))
