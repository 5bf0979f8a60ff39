"""Accessors: typed tables over the views of a glTF file, taken without a copy where they stand close.

Format: Khronos, "glTF 2.0 Specification", section 3.6.2. What an accessor claims is held against the bytes of its view
before anything is made; where no bytes stand behind it, against what a file may make of nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf.document import integer, mapping, optional, shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.mesh_files.gltf.buffers import Buffers
    from meshtide_codec.mesh_files.gltf.document import Document, Row

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SHAPES = {
    "SCALAR": (1, 1),
    "VEC2": (1, 2),
    "VEC3": (1, 3),
    "VEC4": (1, 4),
    "MAT2": (2, 2),
    "MAT3": (3, 3),
    "MAT4": (4, 4),
}
"""Columns and rows; each column of a matrix begins at a multiple of four bytes."""
_COLUMN_ALIGNMENT = 4


@dataclass(frozen=True, slots=True)
class Layout:
    """How the components of an element lie.

    Args:
        dtype: of a component.
        columns: of a matrix; 1 for others.
        rows: components of a column.
        column_bytes: from one column to the next.
    """

    dtype: np.dtype[Any]
    columns: int
    rows: int
    column_bytes: int

    @property
    def width(self) -> int:
        """Components of an element."""
        return self.columns * self.rows

    @property
    def element_bytes(self) -> int:
        """Bytes of an element, padding of matrices included."""
        return self.columns * self.column_bytes


@cache
def _layout(component: int, shape: str) -> Layout:
    dtype = np.dtype(_TYPES[component])
    columns, rows = _SHAPES[shape]
    size = rows * dtype.itemsize
    return Layout(dtype, columns, rows, size if columns == 1 else size + -size % _COLUMN_ALIGNMENT)


class Span(NamedTuple):
    """Where elements stand in a buffer view, held against its length: the view, their first byte, and their stride."""

    view: int
    offset: int
    stride: int


@dataclass(frozen=True, slots=True)
class Form:
    """What an accessor says of itself.

    Args:
        count: of elements.
        shape: its type, such as VEC3.
        layout: of an element.
        normalized: integers that stand for 0..1, or -1..1 where they are signed.
        span: the bytes behind all of it, or None.
        backed: whether bytes stand behind it, be it sparse ones.
    """

    count: int
    shape: str
    layout: Layout
    normalized: bool
    span: Span | None
    backed: bool

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of a component."""
        return self.layout.dtype

    @property
    def width(self) -> int:
        """Components of an element."""
        return self.layout.width


class Table(NamedTuple):
    """Elements as the file has them: values (n, c), and whether they stand for 0..1 or -1..1."""

    values: NDArray[Any]
    normalized: bool

    def real(self) -> NDArray[np.float64]:
        """The values as numbers."""
        return real(self.values, normalized=self.normalized)


@dataclass(slots=True)
class Accessors:
    """The accessors of a file.

    Args:
        document: its JSON.
        buffers: its bytes.
    """

    document: Document
    buffers: Buffers
    _forms: dict[int, Form] = field(default_factory=dict)
    _arrays: dict[int, NDArray[Any]] = field(default_factory=dict)

    def form(self, index: int, where: str) -> Form:
        """What an accessor says of itself, held against its view's length; no bytes are looked at.

        Raises:
            MeshFileError: there is none, it is of an unknown type, or claims more elements than its view holds.
        """
        if index not in self._forms:
            self._forms[index] = self._form(self.document.row("accessors", index, where), f"accessors[{index}]")
        return self._forms[index]

    def _form(self, row: Row, place: str) -> Form:
        component, shape = integer(row, "componentType", place), row.get("type")
        if component not in _TYPES or not isinstance(shape, str) or shape not in _SHAPES:
            raise MeshFileError(f"{place} is of an unknown type: {component}, {shown(shape)}")
        count, view = integer(row, "count", place), optional(row, "bufferView", place)
        normalized = row.get("normalized", False) is True and component != 5126
        layout = _layout(component, shape)
        if view is None:
            return Form(count, shape, layout, normalized, None, "sparse" in row)
        span = self._span(view, integer(row, "byteOffset", place, 0), count, layout, place)
        return Form(count, shape, layout, normalized, span, backed=True)

    def array(self, index: int, where: str) -> NDArray[Any]:
        """The elements (count, components) of an accessor in its own type, columns of matrices one after the other.

        Raises:
            MeshFileError: as `form` does; or its bytes are missing or damaged.
        """
        if index not in self._arrays:
            form = self.form(index, where)
            row = self.document.row("accessors", index, where)
            place = f"accessors[{index}]"
            sparse = mapping(row, "sparse", place) if "sparse" in row else None
            if form.span is None:
                self.buffers.take(form.count * form.layout.element_bytes, place)
                array = np.zeros((form.count, form.width), form.dtype)
            else:
                array = self._elements(form.span, form.count, form.layout, place)
            if sparse is not None:
                array = self._replaced(array, sparse, form, place)
            self._arrays[index] = array
        return self._arrays[index]

    def real(self, index: int, where: str) -> NDArray[np.float64]:
        """The same as numbers: what is normalized lies in 0..1 or -1..1."""
        return real(self.array(index, where), normalized=self.form(index, where).normalized)

    def _span(self, view: int, offset: int, count: int, layout: Layout, place: str) -> Span:
        size = layout.element_bytes
        length, stride = self.buffers.extent(view, place)
        stride = stride or size
        if stride < size:
            raise MeshFileError(f"{place} has elements of {size} bytes, one for each {stride} of its view")
        needed = (count - 1) * stride + size if count else 0
        if offset + needed > length:
            raise MeshFileError(
                f"{place} claims {count} elements, more than its view holds: "
                f"they end at byte {offset + needed}, bufferViews[{view}] at {length}"
            )
        return Span(view, offset, stride)

    def _elements(self, span: Span, count: int, layout: Layout, place: str) -> NDArray[Any]:
        data = self.buffers.view(span.view, place)
        if count == 0:
            return np.zeros((0, layout.width), layout.dtype)
        shape = (count, layout.columns, layout.rows)
        strides = (span.stride, layout.column_bytes, layout.dtype.itemsize)
        table: NDArray[Any] = np.ndarray(shape, layout.dtype, data, span.offset, strides)
        if not table.flags.c_contiguous or not table.flags.aligned:
            self.buffers.take(table.nbytes, place)
            table = table.copy()
        return table.reshape(count, layout.width)

    def _replaced(self, array: NDArray[Any], sparse: Row, form: Form, place: str) -> NDArray[Any]:
        """A copy in which some elements have other values."""
        count = integer(sparse, "count", f"sparse of {place}")
        if count > form.count:
            raise MeshFileError(f"{place} replaces {count} of its {form.count} elements")
        indices = mapping(sparse, "indices", f"sparse of {place}")
        values = mapping(sparse, "values", f"sparse of {place}")
        component = integer(indices, "componentType", f"sparse indices of {place}")
        if component not in {5121, 5123, 5125}:
            raise MeshFileError(f"the sparse indices of {place} are of an unknown type: {component}")
        tables = []
        for row, layout, name in ((indices, _layout(component, "SCALAR"), "indices"), (values, form.layout, "values")):
            what = f"sparse {name} of {place}"
            view, offset = integer(row, "bufferView", what), integer(row, "byteOffset", what, 0)
            tables.append(self._elements(self._span(view, offset, count, layout, what), count, layout, what))
        chosen = tables[0].reshape(-1).astype(np.int64)
        if count and chosen.max() >= form.count:
            raise MeshFileError(f"{place} replaces element {chosen.max()}, but has {form.count}")
        self.buffers.take(array.nbytes, place)
        result = array.copy()
        result[chosen] = tables[1]
        return result


def real(values: NDArray[Any], *, normalized: bool) -> NDArray[np.float64]:
    """Values as numbers: normalized integers by their largest one, nothing below -1.

    >>> real(np.array([[-128, 0, 127]], np.int8), normalized=True).tolist()
    [[-1.0, 0.0, 1.0]]
    """
    if not normalized or values.dtype.kind == "f":
        return values.astype(np.float64)
    scaled = values.astype(np.float64) / float(np.iinfo(values.dtype).max)
    return np.maximum(scaled, -1.0)
