"""Accessors: typed tables over the views of a glTF file, taken without a copy where they stand close.

Format: Khronos, "glTF 2.0 Specification", section 3.6.2. What an accessor claims is held against the bytes of its view
before anything is made; where no bytes stand behind it, against what a file may make of nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

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
class Form:
    """What an accessor says of itself.

    Args:
        count: of elements.
        dtype: of a component.
        shape: its type, such as VEC3.
        normalized: integers that stand for 0..1, or -1..1 where they are signed.
        viewed: whether bytes stand behind all of it.
        backed: whether bytes stand behind it, be it sparse ones.
    """

    count: int
    dtype: np.dtype[Any]
    shape: str
    normalized: bool
    viewed: bool
    backed: bool

    @property
    def width(self) -> int:
        """Components of an element."""
        columns, rows = _SHAPES[self.shape]
        return columns * rows

    @property
    def column_bytes(self) -> int:
        """Bytes from one column to the next."""
        columns, rows = _SHAPES[self.shape]
        size = rows * self.dtype.itemsize
        return size if columns == 1 else size + -size % _COLUMN_ALIGNMENT

    @property
    def element_bytes(self) -> int:
        """Bytes of an element, padding of matrices included."""
        return self.column_bytes * _SHAPES[self.shape][0]


@dataclass(frozen=True, slots=True)
class Table:
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
            row = self.document.row("accessors", index, where)
            place = f"accessors[{index}]"
            component, shape = integer(row, "componentType", place), row.get("type")
            if component not in _TYPES or not isinstance(shape, str) or shape not in _SHAPES:
                raise MeshFileError(f"{place} is of an unknown type: {component}, {shown(shape)}")
            count, view = integer(row, "count", place), optional(row, "bufferView", place)
            normalized = row.get("normalized", False) is True and component != 5126
            viewed = view is not None
            form = Form(count, np.dtype(_TYPES[component]), shape, normalized, viewed, viewed or "sparse" in row)
            if view is not None:
                self._check_view(view, integer(row, "byteOffset", place, 0), form, place)
            self._forms[index] = form
        return self._forms[index]

    def array(self, index: int, where: str) -> NDArray[Any]:
        """The elements (count, components) of an accessor in its own type, columns of matrices one after the other.

        Raises:
            MeshFileError: as `form` does; or its bytes are missing or damaged.
        """
        form = self.form(index, where)
        if index not in self._arrays:
            row = self.document.row("accessors", index, where)
            place = f"accessors[{index}]"
            view = optional(row, "bufferView", place)
            sparse = mapping(row, "sparse", place) if "sparse" in row else None
            if view is None:
                self.buffers.take(form.count * form.element_bytes, place)
                array = np.zeros((form.count, form.width), form.dtype)
            else:
                array = self._elements(view, integer(row, "byteOffset", place, 0), form, place)
            if sparse is not None:
                array = self._replaced(array, sparse, form, place)
            self._arrays[index] = array
        return self._arrays[index]

    def real(self, index: int, where: str) -> NDArray[np.float64]:
        """The same as numbers: what is normalized lies in 0..1 or -1..1."""
        return real(self.array(index, where), normalized=self.form(index, where).normalized)

    def _check_view(self, view: int, offset: int, form: Form, place: str) -> None:
        stride = self.buffers.stride(view, place) or form.element_bytes
        if stride < form.element_bytes:
            raise MeshFileError(
                f"{place} has elements of {form.element_bytes} bytes, one for each {stride} of its view"
            )
        needed = (form.count - 1) * stride + form.element_bytes if form.count else 0
        length = self.buffers.view_bytes(view, place)
        if offset + needed > length:
            raise MeshFileError(
                f"{place} claims {form.count} elements, more than its view holds: "
                f"they end at byte {offset + needed}, bufferViews[{view}] at {length}"
            )

    def _elements(self, view: int, offset: int, form: Form, place: str) -> NDArray[Any]:
        data = self.buffers.view(view, place)
        stride = self.buffers.stride(view, place) or form.element_bytes
        columns, rows = _SHAPES[form.shape]
        shape = (form.count, columns, rows)
        strides = (stride, form.column_bytes, form.dtype.itemsize)
        if form.count == 0:
            return np.zeros((0, form.width), form.dtype)
        table = np.ndarray(shape, form.dtype, data.data, offset, strides)
        if not table.flags.c_contiguous or not table.flags.aligned:
            self.buffers.take(table.nbytes, place)
        return np.require(table, requirements=["C", "A"]).reshape(form.count, form.width)

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
        index_form = Form(count, np.dtype(_TYPES[component]), "SCALAR", normalized=False, viewed=True, backed=True)
        value_form = Form(count, form.dtype, form.shape, form.normalized, viewed=True, backed=True)
        tables = []
        for row, one, name in ((indices, index_form, "indices"), (values, value_form, "values")):
            what = f"sparse {name} of {place}"
            view, offset = integer(row, "bufferView", what), integer(row, "byteOffset", what, 0)
            self._check_view(view, offset, one, what)
            tables.append(self._elements(view, offset, one, what))
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
