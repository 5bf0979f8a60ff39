"""What a mesh carries beside its positions: values of vertices, of corners or of faces, as plain arrays.

An attribute is a table of values and, where values are shared, a table that says which row each vertex, corner or face
has. The corners of a vertex that have one row are a *wedge*; an edge across which the rows differ is a *seam*.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.errors import MeshError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

NONE = -1
"""The row of an element that has no value: a corner without texture coordinates in a file where others have them."""


LOWER_LEFT, UPPER_LEFT = "lower left", "upper left"
"""The corner of a picture that texture coordinates count from: that of OBJ, PLY and OFF, and that of glTF."""


class Domain(StrEnum):
    """What each value belongs to."""

    VERTEX = "vertex"
    CORNER = "corner"
    FACE = "face"


class Kind(StrEnum):
    """What the values mean, and so how they may be averaged, transformed and coded."""

    COLOR = "color"
    TEXCOORD = "texcoord"
    NORMAL = "normal"
    SCALAR = "scalar"
    LABEL = "label"


@dataclass(frozen=True, slots=True, eq=False)
class Attribute:
    """Values of one kind over one domain of a mesh of n vertices and m triangles.

    Args:
        name: as the file has it (``TEXCOORD_1``, ``_FEATURE_ID_0``, ``quality``).
        kind: what the values mean.
        domain: what has a value: each vertex, each corner of each triangle, or each triangle.
        values: (k, c) table of the file's own type.
        indices: the row of each element: (n,) for vertices, (m, 3) for corners, (m,) for faces, int64; `NONE` where an
            element has no value. Without it k is the number of elements (3 m for corners) and row i is that of
            element i.
        normalized: integers that stand for 0..1, or -1..1 where they are signed.
        bits: to how many bits per component the values may be rounded; None leaves that to the encoder.
        extra: what else a file says of it, such as the names of labels (``names``), or of texture coordinates the
            corner of the picture that they count from (``origin``): `LOWER_LEFT`, the default, or `UPPER_LEFT`.

    >>> uv = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    >>> Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, uv, np.array([[0, 1, 2]])).per_element().shape
    (3, 2)
    """

    name: str
    kind: Kind
    domain: Domain
    values: NDArray[Any]
    indices: NDArray[np.int64] | None = None
    normalized: bool = False
    bits: int | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)

    def check(self, vertices: int, faces: int) -> None:
        """Hold the attribute against the size of its mesh.

        Raises:
            MeshError: its tables have another shape, or a row is out of range.
        """
        if self.values.ndim != 2 or self.values.dtype.kind not in "iuf":
            raise MeshError(f"attribute {self.name!r}: values must be numbers (k, c), not {self.values.shape}")
        shape = _shape(self.domain, vertices, faces)
        if self.indices is None:
            if len(self.values) != np.prod(shape):
                message = f"{len(self.values)} values for {np.prod(shape)} elements of domain {self.domain}"
                raise MeshError(f"attribute {self.name!r}: {message}")
            return
        if self.indices.shape != shape:
            raise MeshError(f"attribute {self.name!r}: indices must have shape {shape}, not {self.indices.shape}")
        if self.indices.dtype.kind not in "iu":
            raise MeshError(f"attribute {self.name!r}: indices must be integers, not {self.indices.dtype}")
        if self.indices.size and (self.indices.min() < NONE or self.indices.max() >= len(self.values)):
            raise MeshError(f"attribute {self.name!r}: an index is outside of its {len(self.values)} values")

    def rows(self) -> NDArray[np.int64]:
        """The row of each element, one after the other: (n,), (3 m,) or (m,)."""
        return np.arange(len(self.values)) if self.indices is None else self.indices.reshape(-1)

    def per_element(self) -> NDArray[Any]:
        """The value of each element (elements, c); zeros where it has none."""
        if self.indices is None:
            return self.values
        rows = self.rows()
        if len(self.values) == 0:
            return np.zeros((len(rows), self.values.shape[1]), self.values.dtype)
        taken: NDArray[Any] = self.values[np.maximum(rows, 0)]
        taken[rows == NONE] = 0
        return taken

    def of_elements(self, kept: NDArray[Any]) -> Attribute:
        """The attribute of some elements of its domain, in the order of `kept` (mask or indices over the elements)."""
        if self.indices is None:
            values = self.values.reshape(-1, 3, self.values.shape[1])[kept] if self.domain is Domain.CORNER else None
            flat = self.values[kept] if values is None else values.reshape(-1, self.values.shape[1])
            return replace(self, values=flat)
        return replace(self, indices=self.indices[kept])


def origin_of(texcoord: Attribute) -> str:
    """The corner of the picture that texture coordinates count from."""
    return str(texcoord.extra.get("origin", LOWER_LEFT))


def with_origin(texcoord: Attribute, origin: str) -> Attribute:
    """Texture coordinates that count from a corner of the picture: itself, or with 1 - v in place of v.

    Unsigned normalized integers and floats keep their type, unless float32 does not hold 1 - v exactly; that and other
    integers become float64.

    >>> uv = Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.VERTEX, np.array([[0.5, 0.25]]))
    >>> with_origin(uv, UPPER_LEFT).values.tolist()
    [[0.5, 0.75]]
    """
    if origin_of(texcoord) == origin:
        return texcoord
    extra = {key: value for key, value in texcoord.extra.items() if key != "origin"}
    if origin != LOWER_LEFT:
        extra["origin"] = origin
    values, normalized = texcoord.values, texcoord.normalized
    if values.dtype.kind == "u" and normalized:
        values = values.copy()
        values[:, 1:2] = np.iinfo(values.dtype).max - values[:, 1:2]
        return replace(texcoord, values=values, extra=extra)
    exact = values.astype(np.float64)
    if values.dtype.kind == "i" and normalized:
        exact = np.maximum(exact / np.iinfo(values.dtype).max, -1.0)
    with np.errstate(all="ignore"):
        exact[:, 1:2] = 1 - exact[:, 1:2]
        narrow = exact.astype(values.dtype if values.dtype.kind == "f" else np.float64)
    if np.array_equal(narrow, exact, equal_nan=True):
        exact = narrow
    return replace(texcoord, values=exact, normalized=False, extra=extra)


def _shape(domain: Domain, vertices: int, faces: int) -> tuple[int, ...]:
    match domain:
        case Domain.VERTEX:
            return (vertices,)
        case Domain.CORNER:
            return (faces, 3)
        case Domain.FACE:
            return (faces,)
