"""The rows of an element of a PLY file as columns, whatever the lengths of their lists.

Where a row begins is known only once the rows before it are read, as lists differ in length. Rows of the same lengths
that follow each other are taken at once, as a table. Where they alternate, a block of bytes is scanned: first the
place where a row *would* end is found for every place of the block; then that table is composed with itself
until it leads 16 rows further, which gives each 16th row, and from these come the others. Cost: O(bytes).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from meshtide_codec.errors import MeshFileError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_codec.mesh_files.ply.header import PlyElement

LONGEST_ROW = (1 << 31) - 1
"""Bytes: what numpy accepts as one row of a table."""
LONG_RUN = 1024
"""Rows of the same lengths from which on a table of them is quicker than a scan."""
BLOCK = 1 << 16
"""Places of a block, whose tables fit into a processor's cache."""
_DOUBLINGS = 4
_EXACT = 2.0**53


class Stored(NamedTuple):
    """How a property's values stand in the rows: their type, and that of a list's length."""

    item: np.dtype[Any]
    length: np.dtype[Any] | None


@dataclass(frozen=True, slots=True)
class ListColumn:
    """The lists of one property.

    Args:
        counts: (rows,) int64, the length of each.
        items: (sum of counts,) values one after the other, or (rows, c) where all have the length c.
    """

    counts: NDArray[np.int64]
    items: NDArray[Any]


@dataclass(frozen=True, slots=True)
class Columns:
    """The values of an element's rows.

    Args:
        scalars: of each property with one value its values (rows,), by name.
        lists: of each other property its lists, by name.
    """

    scalars: dict[str, NDArray[Any]]
    lists: dict[str, ListColumn]


class RowReader:
    """Takes an element's rows from pieces of a file.

    Args:
        element: with all that is declared of it.
        stored: how each of its properties stands in the rows.
        unit: bytes that all lengths are multiples of.
    """

    def __init__(self, element: PlyElement, stored: Sequence[Stored], unit: int = 1) -> None:
        self.left = element.count
        self.inexact: set[str] = set()
        self._element = element
        self.stored = stored
        self._unit = unit
        self._pieces: list[list[Any]] = [[] for _ in stored]

    def take(self, data: NDArray[np.uint8], *, last: bool) -> int:
        """Take the rows that a piece holds whole, as far as they are wanted.

        Args:
            data: a piece that begins with a row.
            last: whether nothing follows it.

        Returns:
            How many bytes they were.

        Raises:
            MeshFileError: the last piece ends before the last row does, or the length of a list is none.
        """
        at = 0
        while self.left:
            lengths = self._lengths(data, at)
            if lengths is None:
                if last:
                    count, name = self._element.count, self._element.name
                    raise MeshFileError(f"the file ends in row {count - self.left} of the {count} rows of {name}")
                break
            table = self._table(data, at, lengths)
            ends = self._scan(data, at) if len(table) < min(self.left, LONG_RUN) else None
            if ends is None or len(ends) <= len(table):
                self._keep_table(table, lengths)
                rows, used = len(table), len(table) * table.dtype.itemsize
            else:
                self._keep_rows(data, at + np.concatenate([[0], ends[:-1]]))
                rows, used = len(ends), int(ends[-1])
            self.left -= rows
            at += used
        return at

    def columns(self) -> Columns:
        """All rows that were taken, as columns of the declared types in any byte order; what does not fit is double."""
        scalars: dict[str, NDArray[Any]] = {}
        lists: dict[str, ListColumn] = {}
        for one, pieces in zip(self._element.properties, self._pieces, strict=True):
            if one.length is None:
                scalars[one.name] = _joined(pieces, one.item)
                continue
            counts = _joined([counts for counts, _ in pieces], np.dtype(np.int64))
            items = [items for _, items in pieces]
            flat = items[0] if len(items) == 1 else _joined([each.reshape(-1) for each in items], one.item)
            lists[one.name] = ListColumn(counts, flat)
        return Columns(scalars, lists)

    def _lengths(self, data: NDArray[np.uint8], at: int) -> list[int] | None:
        """The lengths of the lists of the row at a place; None if the piece ends before it does."""
        start = at
        lengths: list[int] = []
        for stored, one in zip(self.stored, self._element.properties, strict=True):
            kind = stored.length or stored.item
            at += kind.itemsize
            if at > len(data):
                return None
            if stored.length is None:
                continue
            found = data[at - kind.itemsize : at].view(kind)[0]
            length = int(found) if np.isfinite(found) else -1
            if length < 0 or length != found:
                raise MeshFileError(f"{self._row()}: {one.name} is a list of {found} values")
            at += length * stored.item.itemsize
            if at > len(data):
                return None
            lengths.append(length)
        if at - start > LONGEST_ROW:
            raise MeshFileError(f"{self._row()} has {at - start} bytes: more than is read")
        return lengths

    def _row(self) -> str:
        return f"row {self._element.count - self.left} of {self._element.name}"

    def _table(self, data: NDArray[np.uint8], at: int, lengths: list[int]) -> NDArray[Any]:
        """The rows from a place on whose lists have these lengths; the first row is one."""
        fields: list[tuple[Any, ...]] = []
        expected: list[tuple[str, int]] = []
        for place, stored in enumerate(self.stored):
            if stored.length is None:
                fields.append((f"item{place}", stored.item))
                continue
            length = lengths[len(expected)]
            fields += [(f"length{place}", stored.length), (f"item{place}", stored.item, (length,))]
            expected.append((f"length{place}", length))
        kind = np.dtype(fields)
        most = min(self.left, (len(data) - at) // kind.itemsize)
        for rows in (min(most, LONG_RUN), most):  # most runs that are short are known to be so from a few rows
            table = np.ndarray(rows, kind, data.data, at)
            for name, length in expected:
                differing = table[name] != length
                first = int(differing.argmax())
                if differing[first]:
                    table = table[:first]
            if len(table) < rows:
                break
        return table

    def _keep_table(self, table: NDArray[Any], lengths: list[int]) -> None:
        waiting = iter(lengths)
        for place, (stored, one) in enumerate(zip(self.stored, self._element.properties, strict=True)):
            items = self._as_declared(table[f"item{place}"], one.item, one.name)
            if stored.length is None:
                self._pieces[place].append(items)
            else:
                counts = np.broadcast_to(np.int64(next(waiting)), len(table))
                self._pieces[place].append((counts, items))

    def _scan(self, data: NDArray[np.uint8], at: int) -> NDArray[np.int64] | None:
        """Where the rows from a place on end, in bytes from there: those that end within a block; None if none does."""
        unit = self._unit
        block = data[at : at + BLOCK * unit]
        size = len(block) // unit
        beyond = size + 1
        ends = np.arange(size)
        for stored in self.stored:
            if stored.length is None:
                ends += stored.item.itemsize // unit
                continue
            lengths = _everywhere(block, stored.length, unit)
            if len(lengths) == 0:
                return None
            known = ends < len(lengths)
            found = lengths[np.minimum(ends, len(lengths) - 1)]
            if found.dtype.kind == "f":
                known &= found == np.rint(found)
                found = np.where(known, found, 0)
            known &= found >= 0
            length = np.clip(found, 0, beyond).astype(np.int64)
            ends += stored.length.itemsize // unit + length * (stored.item.itemsize // unit)
            ends[~known] = beyond
        jump = np.full(beyond + 1, beyond)
        np.minimum(ends, beyond, out=jump[:size])
        far = jump
        for _ in range(_DOUBLINGS):
            far = far[far]
        starts = [0]
        leading = memoryview(far.data)
        while (start := leading[starts[-1]]) < size:
            starts.append(start)
        rows = np.empty((len(starts), (1 << _DOUBLINGS) + 1), np.int64)
        rows[:, 0] = starts
        for step in range(1 << _DOUBLINGS):
            rows[:, step + 1] = jump[rows[:, step]]
        found = rows[:, 1:].reshape(-1)
        whole = int((found <= size).sum())
        return found[: min(whole, self.left)] * unit if whole else None

    def _keep_rows(self, data: NDArray[np.uint8], starts: NDArray[np.int64]) -> None:
        """Keep the rows that begin at these places."""
        at = starts // self._unit
        for place, (stored, one) in enumerate(zip(self.stored, self._element.properties, strict=True)):
            values = _everywhere(data, stored.item, self._unit)
            if stored.length is None:
                self._pieces[place].append(self._as_declared(values[at], one.item, one.name))
                at = at + stored.item.itemsize // self._unit
                continue
            counts = _everywhere(data, stored.length, self._unit)[at].astype(np.int64)
            at = at + stored.length.itemsize // self._unit
            step = stored.item.itemsize // self._unit
            before = np.cumsum(counts) - counts
            places = np.repeat(at - before * step, counts) + step * np.arange(int(counts.sum()))
            items = values[places] if len(places) else np.zeros(0, stored.item)
            self._pieces[place].append((counts, self._as_declared(items, one.item, one.name)))
            at = at + counts * step

    def _as_declared(self, values: NDArray[Any], kind: np.dtype[Any], name: str) -> NDArray[Any]:
        """The values in the type that the header declares; as they are, where it does not hold them."""
        if values.dtype.newbyteorder("=") == kind:
            return values  # in the order of the file: whoever copies them turns them round on the way
        with np.errstate(all="ignore"):  # a number beyond float becomes infinite, which is reported later
            declared = values.astype(kind)
            if kind.kind == "f":
                return declared
            if not (declared == values).all() or _rounded(values, kind):
                self.inexact.add(name)
                return values
        return declared


def _rounded(values: NDArray[Any], kind: np.dtype[Any]) -> bool:
    """Whether doubles may have lost digits of integers of that type."""
    return values.dtype.kind == "f" and kind.itemsize == 8 and bool((np.abs(values) >= _EXACT).any())


def _everywhere(data: NDArray[np.uint8], kind: np.dtype[Any], unit: int) -> NDArray[Any]:
    """The value that begins at each place, whether one stands there or not: a view, of places `unit` bytes apart."""
    places = max(0, (len(data) - kind.itemsize) // unit + 1)
    return np.ndarray(places, kind, data.data, strides=(unit,)) if places else np.zeros(0, kind)


def _joined(pieces: list[NDArray[Any]], kind: np.dtype[Any]) -> NDArray[Any]:
    if not pieces:
        return np.zeros(0, kind)
    return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)
