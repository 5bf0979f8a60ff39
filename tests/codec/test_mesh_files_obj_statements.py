from __future__ import annotations

import pytest

from meshtide_codec.mesh_files.obj.statements import Statements, without_comment
from meshtide_codec.mesh_files.source import Source


def taken(*lines: tuple[bytes, int]) -> Statements:
    statements = Statements()
    for line, face in lines:
        statements.take(line, face)
    return statements


def test_labels_hold_until_the_next_one() -> None:
    statements = taken((b"g a", 2), (b"g b c ", 3), (b"g a", 5), (b"g", 6), (b"g last", 9))
    names, rows = statements.labels("group", 8)
    assert names == [b"a", b"b c"]
    assert rows.tolist() == [-1, -1, 0, 1, 1, 0, -1, -1]


def test_a_label_that_no_face_has_is_no_label() -> None:
    names, rows = taken((b"usemtl a", 0), (b"usemtl b", 0), (b"usemtl c", 3)).labels("material", 3)
    assert (names, rows.tolist()) == ([b"b"], [0, 0, 0])


def test_a_statement_for_each_face_keeps_one_span_for_each_change() -> None:
    statements = taken(*((b"s %d" % (face // 500), face) for face in range(2000)))
    assert len(statements._spans["smoothing"]) == 4


def test_names_of_files_and_materials_come_once() -> None:
    statements = taken(
        (b"mtllib a b.mtl # x", 0), (b"mtllib a b.mtl", 0), (b"mtllib #", 0), (b"usemtl m", 0), (b"usemtl m", 9)
    )
    assert statements.libraries == [b"a b.mtl"]
    assert statements.material_names() == [b"m"]


def test_what_is_left_out_is_counted() -> None:
    source = Source("a", ".obj", b"")
    taken((b"l 1 2", 0), (b"l 2 3", 0), (b"p 1", 0), (b"vp 0", 0), (b"\xff" * 99, 0), (b"mtllib", 0)).report(source)
    told = "2 lines, 1 points, 1 statements of curves and surfaces, 2 statements of other kinds"
    assert source.notes == [f"not read: {told} (the first is {chr(0xFFFD) * 40!r})"]
    quiet = Source("a", ".obj", b"")
    Statements().report(quiet)
    assert quiet.notes == []


@pytest.mark.parametrize(
    ("text", "name"),
    [(b" a b ", b"a b"), (b"a#b # c", b"a#b"), (b"a #25", b"a #25"), (b"# a", b""), (b"a\t## b", b"a")],
)
def test_comments_behind_names(text: bytes, name: bytes) -> None:
    assert without_comment(text) == name
