from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.obj import lines as obj_lines
from meshtide_codec.mesh_files.obj.lines import FACE, NORMAL, NOTHING, OTHER, TEXCOORD, VERTEX, blocks


def test_kinds_of_lines() -> None:
    text = b"v 1\nvt 1\nvn 1\nf 1\nfo 1\n\tv\t1\n#v 1\n\n  \nvp 1\nvertex 1\nfoo 1\n v\nl 1\nusemtl f\nv"
    (block,) = blocks(text)
    expected = [VERTEX, TEXCOORD, NORMAL, FACE, FACE, VERTEX, NOTHING, NOTHING, NOTHING]
    assert block.kinds.tolist() == [*expected, OTHER, OTHER, OTHER, VERTEX, OTHER, OTHER, VERTEX]
    assert [block.line(line) for line in (5, 9, 15)] == [b"v\t1", b"vp 1", b"v"]


@pytest.mark.parametrize(
    "text",
    [
        b"v 1 2\nvt 3\nv 4 5 6\n",
        b"  v 1 2 \nvt 3\n\n\tv\t4 5 6",
        b"v 1 \\\n2\nvt 3\nv \\  \n4 5 6#7\n",
        b"# 8\nv 1 2\nv 4 5 6\n",
    ],
)
def test_lines_of_a_kind_are_gathered(text: bytes) -> None:
    (block,) = blocks(text)
    lines = block.gathered(VERTEX)
    assert lines is not None
    assert lines.text.tobytes().split() == [b"1", b"2", b"4", b"5", b"6"]
    places = np.flatnonzero(lines.text > 32)
    assert lines.counts(places).tolist() == [2, 3]
    assert [block.kinds[lines.line_at(place)] for place in places.tolist()] == [VERTEX] * 5
    assert block.gathered(NORMAL) is None


def test_numbers_of_lines_count_those_that_go_on() -> None:
    (block,) = blocks(b"v 1 \\\n2\n\nf 1\nf \\ \n\\\n2\nf 3")
    assert block.line_numbers(np.flatnonzero(block.kinds == FACE)).tolist() == [4, 5, 8]
    assert block.line_number(0) == 1


@pytest.mark.parametrize("size", [1, 7, 20])
def test_blocks_hold_whole_lines(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    text = b"v 1 2 3\n\n# a long comment that fits in no block\nf 1 \\\n 2 \\\n 3\nf 4 5 6\nlast"
    monkeypatch.setattr(obj_lines, "_BLOCK", size)
    found = list(blocks(text))
    assert [block.line(i).split()[0] for block in found for i, kind in enumerate(block.kinds) if kind != NOTHING] == [
        b"v",
        b"f",
        b"f",
        b"last",
    ]
    assert [block.line_number(i) for block in found for i, kind in enumerate(block.kinds) if kind != NOTHING] == [
        1,
        4,
        7,
        8,
    ]
    assert len(found) > 3


def test_comments_are_blanked_in_lines_of_numbers_only() -> None:
    (block,) = blocks(b"v 1 # 2\nusemtl a #1\nv 1.#INF # \\ 3\nv 3#4 # 5\n")
    assert [block.line(i).rstrip() for i in range(4)] == [b"v 1", b"usemtl a #1", b"v 1.#INF", b"v 3"]


@pytest.mark.parametrize("text", [b"v" * 30, b"# " + b"x " * 15, b"f" + b" 1" * 15, b"\\\n" * 15])
def test_a_line_without_end_is_refused_before_it_takes_memory(text: bytes) -> None:
    text = b"v 0 0 0\n" + text * 600_000
    tracemalloc.start()
    try:
        with pytest.raises(MeshFileError, match="line .* longer than 16777216 bytes"):
            list(blocks(text))
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()
