"""Rows of PLY files as columns: lists of any lengths, from pieces of any size."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.ply import rows as ply_rows
from meshtide_codec.mesh_files.ply.header import PlyElement, PlyProperty
from meshtide_codec.mesh_files.ply.rows import Columns, RowReader, Stored

if TYPE_CHECKING:
    from numpy.typing import NDArray

INDICES = PlyProperty("indices", np.dtype("i4"), np.dtype("u1"))
LEVEL = PlyProperty("level", np.dtype("f8"))
TAGS = PlyProperty("tags", np.dtype("i2"), np.dtype("u4"))


def element(count: int, *properties: PlyProperty) -> PlyElement:
    return PlyElement("face", count, list(properties))


def reader_of(kind: PlyElement, order: Any = "<") -> RowReader:
    stored = [
        Stored(one.item.newbyteorder(order), None if one.length is None else one.length.newbyteorder(order))
        for one in kind.properties
    ]
    return RowReader(kind, stored)


def packed(kind: PlyElement, rows: list[list[Any]], order: Any = "<") -> bytes:
    parts = []
    for row in rows:
        for one, value in zip(kind.properties, row, strict=True):
            if one.length is not None:
                parts.append(np.array([len(value)], one.length.newbyteorder(order)).tobytes())
            parts.append(np.array(value, one.item.newbyteorder(order)).tobytes())
    return b"".join(parts)


def taken(reader: RowReader, data: bytes, piece: int | None = None) -> Columns:
    """All rows, from pieces of that many bytes."""
    waiting = np.zeros(0, np.uint8)
    step = piece or max(1, len(data))
    for at in range(0, max(1, len(data)), step):
        waiting = np.concatenate([waiting, np.frombuffer(data[at : at + step], np.uint8)])
        waiting = waiting[reader.take(waiting, last=at + step >= len(data)) :]
    return reader.columns()


def lists(counts: NDArray[np.int64], items: NDArray[Any]) -> list[list[Any]]:
    return [each.tolist() for each in np.split(items.reshape(-1), np.cumsum(counts)[:-1])] if len(counts) else []


@given(st.data())
@settings(max_examples=80, deadline=None)
def test_any_rows_come_back_from_any_pieces(data: st.DataObject) -> None:
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    runs = data.draw(st.lists(st.tuples(st.integers(0, 5), st.integers(1, 40)), max_size=6))
    rows: list[list[Any]] = []
    for length, times in runs:
        for _ in range(times):
            tags = [1] * int(rng.integers(0, 2)) if length > 3 else []
            rows.append([rng.integers(0, 9, length).tolist(), float(len(rows)), tags])
    kind = element(len(rows), INDICES, LEVEL, TAGS)
    order = data.draw(st.sampled_from("<>"))
    packed_rows = packed(kind, rows, order)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ply_rows, "BLOCK", data.draw(st.sampled_from([20, 64, 1 << 16])))
        patch.setattr(ply_rows, "LONG_RUN", data.draw(st.sampled_from([1, 8, 1024])))
        columns = taken(reader_of(kind, order), packed_rows, data.draw(st.sampled_from([None, 7, 100])))
    assert columns.scalars["level"].tolist() == [row[1] for row in rows]
    for at, name in ((0, "indices"), (2, "tags")):
        column = columns.lists[name]
        assert lists(column.counts, column.items) == [row[at] for row in rows]


def test_alternating_rows_are_scanned_in_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    count = 20_000
    kind = element(count, INDICES)
    rows: list[list[Any]] = [[[1, 2, 3, 4][: 3 + at % 2]] for at in range(count)]
    data = packed(kind, rows)
    tables: list[int] = []
    scans: list[int] = []
    make_table, scan = RowReader._table, RowReader._scan
    monkeypatch.setattr(RowReader, "_table", lambda *each: tables.append(1) or make_table(*each))
    monkeypatch.setattr(RowReader, "_scan", lambda *each: scans.append(1) or scan(*each))
    column = taken(reader_of(kind), data).lists["indices"]
    assert column.counts.tolist() == [3, 4] * (count // 2)
    assert len(tables) == len(scans) == -(-len(data) // ply_rows.BLOCK)


def test_rows_of_one_length_are_a_view_of_the_file() -> None:
    kind = element(5000, INDICES, LEVEL)
    data = np.frombuffer(packed(kind, [[[1, 2, 3], 0.5]] * 5000), np.uint8)
    reader = reader_of(kind)
    assert reader.take(data, last=True) == len(data)
    columns = reader.columns()
    assert columns.lists["indices"].items.shape == (5000, 3)
    assert np.shares_memory(columns.lists["indices"].items, data)
    assert np.shares_memory(columns.scalars["level"], data)


def test_a_row_may_be_longer_than_a_block() -> None:
    kind = element(3, PlyProperty("indices", np.dtype("i4"), np.dtype("i4")))
    rows: list[list[Any]] = [[[1]], [list(range(100_000))], [[2, 3]]]
    column = taken(reader_of(kind), packed(kind, rows)).lists["indices"]
    assert column.counts.tolist() == [1, 100_000, 2]
    assert column.items[[0, 1, 100_000, 100_001]].tolist() == [1, 0, 99_999, 2]


def test_bytes_after_the_last_row_are_left() -> None:
    kind = element(2, INDICES)
    data = np.frombuffer(packed(kind, [[[1]], [[2, 3]]]) + b"more", np.uint8)
    assert reader_of(kind).take(data, last=True) == len(data) - 4


@pytest.mark.parametrize("mixed", [False, True])
def test_rows_that_are_missing_are_named(mixed: bool) -> None:
    kind = element(10, INDICES, LEVEL)
    rows = [[[1, 2, 3][: 1 + (at % 2 if mixed else 0)], 1.0] for at in range(10)]
    data = packed(kind, rows)
    for length in range(len(data)):
        held = sum(len(packed(kind, rows[: at + 1])) <= length for at in range(10))
        with pytest.raises(MeshFileError, match=f"the file ends in row {held} of the 10 rows of face"):
            reader_of(kind).take(np.frombuffer(data[:length], np.uint8), last=True)


def test_lengths_that_are_none_are_named() -> None:
    kind = element(4, PlyProperty("indices", np.dtype("i4"), np.dtype("i4")))
    data = packed(kind, [[[1]], [[1, 2]], [[3]], [[]]]).replace(b"\x02\0\0\0\x01", b"\xfe\xff\xff\xff\x01", 1)
    with pytest.raises(MeshFileError, match="row 1 of face: indices is a list of -2 values"):
        reader_of(kind).take(np.frombuffer(data, np.uint8), last=True)


def test_what_a_type_does_not_hold_stays_as_it_is() -> None:
    kind = element(3, PlyProperty("small", np.dtype("u1")), PlyProperty("large", np.dtype("i8")))
    kind.properties.append(PlyProperty("fine", np.dtype("i4")))
    reader = RowReader(kind, [Stored(np.dtype("f8"), None)] * 3, 8)
    values = np.array([[1, 2.0**60, 5], [256, 1, -5], [np.nan, 0, 7]])
    reader.take(values.view(np.uint8).reshape(-1), last=True)
    columns = reader.columns()
    assert reader.inexact == {"small", "large"}
    assert columns.scalars["small"].dtype == np.float64
    assert columns.scalars["fine"].dtype == np.int32
    assert columns.scalars["fine"].tolist() == [5, -5, 7]
