"""What quantization costs a mesh: faces that became degenerate or the same as others, and the area that went with them.

A mesh whose details are finer than the grid loses them, sometimes nearly all: a thin sheet, or a model with one vertex
far away. Faces that were degenerate or repeated in the input itself do not count. Cost: nothing where no face was
dropped, O(n log n + m log m) otherwise, and as much for each B that is tried where too much is gone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.argument_types import check_type
from meshtide_codec.errors import MeshError
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import LARGEST_B, QuantizedMesh, quantize

if TYPE_CHECKING:
    from numpy.typing import NDArray


NOTICED = 1e-3
"""A loss of a smaller share of the faces or of the area is not reported."""


@dataclass(frozen=True, slots=True)
class Merging:
    """What quantization merged.

    Args:
        bits: B.
        faces: how many faces went.
        of_faces: how many there were, without those that were degenerate or repeated in the input.
        area: share of the surface that went with them, 0 to 1.
        vertices: how many vertices fell together with another one that stood elsewhere.
        of_vertices: how many places of vertices there were.
        keeping_bits: the smallest larger B at which no more than a thousandth goes; None if there is none, or if no
            more goes anyway.
        faces_at_largest: where there is none, how many faces would go at the largest B.
    """

    bits: int
    faces: int
    of_faces: int
    area: float
    vertices: int
    of_vertices: int
    keeping_bits: int | None = None
    faces_at_largest: int = 0

    @property
    def noticed(self) -> bool:
        """Whether more than a thousandth of the faces or of the area went."""
        return self.faces > NOTICED * self.of_faces or self.area > NOTICED

    @property
    def complete(self) -> bool:
        """Whether no face is left."""
        return self.faces == self.of_faces

    def message(self) -> str:
        """One line that says how much went and which B would keep it."""
        remedy = f"no B up to {LARGEST_B} keeps them, {self.faces_at_largest} would go: cut off what lies far away"
        if self.keeping_bits is not None:
            remedy = f"B = {self.keeping_bits} keeps them"
        if self.complete:
            return f"all {self.of_faces} faces vanish at B = {self.bits}; {remedy}"
        return (
            f"quantization at B = {self.bits} merges {self.faces} of {self.of_faces} faces "
            f"({100 * self.area:.2f} % of the area) and {self.vertices} of {self.of_vertices} vertices; {remedy}"
        )

    def check(self, *, strict: bool) -> None:
        """Refuse what no file should be made of: no faces at all, or with `strict` any loss that is noticed.

        Raises:
            MeshError: with the message of what went.
        """
        if self.of_faces == 0:
            raise MeshError("the mesh has no face of three different corners; there is no surface to encode")
        if self.complete or (strict and self.noticed):
            raise MeshError(self.message())

    def plain(self) -> dict[str, Any]:
        """The same for JSON; the area in per cent."""
        return {
            "faces": self.faces,
            "of_faces": self.of_faces,
            "area_per_cent": 100 * self.area,
            "vertices": self.vertices,
            "of_vertices": self.of_vertices,
            "keeping_bits": self.keeping_bits,
        }


def merged_by_quantization(mesh: Mesh, quantized: QuantizedMesh) -> Merging:
    """What became of `mesh` when it was quantized; where that is noticed, which B would keep it.

    >>> from meshtide_codec.mesh import Mesh
    >>> sheet = Mesh.checked([[0, 0, 0], [9, 0, 0], [9, 1e-4, 0], [0, 1e-4, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> merged_by_quantization(sheet, quantize(sheet, 8)).message()
    'all 2 faces vanish at B = 8; B = 16 keeps them'
    """
    check_type("the mesh", mesh, Mesh)
    check_type("the quantized mesh", quantized, QuantizedMesh, remedy="EncodedMesh.quantized is one")
    if quantized.dropped_faces == 0:
        return Merging(quantized.bits, 0, len(mesh.faces), 0.0, 0, len(quantized.positions))
    places = _places(mesh, quantized)
    proper = _proper(places[mesh.faces])
    faces = mesh.faces[proper]
    areas = _areas(mesh, faces)
    found = _merging(quantized, faces, areas, places)
    if not found.noticed:
        return found
    at_largest = found.faces
    for bits in range(quantized.bits + 1, LARGEST_B + 1):
        finer = _merging(quantize(mesh, bits, quantized.origin, quantized.extent or None), faces, areas, places)
        if not finer.noticed:
            return replace(found, keeping_bits=bits)
        at_largest = finer.faces
    return replace(found, faces_at_largest=at_largest)


def _merging(
    quantized: QuantizedMesh, faces: NDArray[np.int64], areas: NDArray[np.float64], places: NDArray[np.int64]
) -> Merging:
    kept = _proper(quantized.permutation[faces])
    total = float(areas.sum())
    distinct = len(np.unique(places))
    return Merging(
        bits=quantized.bits,
        faces=len(faces) - int(np.count_nonzero(kept)),
        of_faces=len(faces),
        area=float(areas[~kept].sum()) / total if total > 0.0 else 0.0,
        vertices=distinct - len(quantized.positions),
        of_vertices=distinct,
    )


def _places(mesh: Mesh, quantized: QuantizedMesh) -> NDArray[np.int64]:
    """(n,) for each vertex a number that it shares with those at exactly the same place, which are its twins."""
    places = np.arange(len(mesh.vertices))
    welded = np.flatnonzero(np.bincount(quantized.permutation)[quantized.permutation] > 1)
    x, y, z = mesh.vertices[welded].T
    order = welded[np.lexsort((z, y, x, quantized.permutation[welded]))]
    same = (mesh.vertices[order[1:]] == mesh.vertices[order[:-1]]).all(axis=1)
    starts = np.flatnonzero(np.r_[True, ~same]) if len(order) else np.zeros(0, np.int64)
    lengths = np.diff(np.r_[starts, len(order)])
    places[order] = np.repeat(order[starts], lengths)
    return places


def _proper(faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(m,) which faces have three different corners and are not the same as an earlier one."""
    a, b, c = faces.T
    proper: NDArray[np.bool_] = (a != b) & (b != c) & (c != a)
    rows = np.flatnonzero(proper)
    turn = np.argmin(faces[rows], axis=1)[:, None] if len(rows) else np.zeros((0, 1), np.int64)
    a, b, c = np.take_along_axis(faces[rows], (turn + np.arange(3)) % 3, axis=1).T
    order = np.lexsort((c, b, a))
    repeated = (np.diff(a[order]) == 0) & (np.diff(b[order]) == 0) & (np.diff(c[order]) == 0)
    proper[rows[order[1:][repeated]]] = False
    return proper


def _areas(mesh: Mesh, faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """(m,) areas as shares of the square of the mesh's size, so that no mesh is too large or too small for them."""
    low = mesh.vertices.min(axis=0)
    size = float((mesh.vertices.max(axis=0) - low).max())
    scaled = (mesh.vertices - low) / size if size > 0.0 else np.zeros(mesh.vertices.shape)
    a, b, c = (scaled[faces[:, corner]] for corner in range(3))
    areas: NDArray[np.float64] = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return areas
