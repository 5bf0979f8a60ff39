"""A triangle mesh as plain arrays, and what has to hold for it to be one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from meshtide_codec.attributes import Domain
from meshtide_codec.errors import MeshError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from meshtide_codec.attributes import Attribute

Index = TypeVar("Index", bound=np.signedinteger)


@dataclass(frozen=True, slots=True)
class Mesh:
    """Vertices and triangles; anything is legal that has finite coordinates and indices in range.

    Args:
        vertices: (n, 3) float64 positions, in the unit of the file they came from.
        faces: (m, 3) int64 indices into `vertices`, counter-clockwise seen from outside.
        attributes: values of vertices, corners or faces.
        materials: (m,) int64, the material of each face as an index into those of its scene, -1 for none; or None.
        polygons: (m, 3) bool, whether the edge from corner i to the next one is inside of a polygon of more than three
            corners, whose triangles stand one after the other; None where all faces are triangles by themselves.

    Use `Mesh.checked` for arrays from outside; the bare constructor trusts its caller.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    attributes: tuple[Attribute, ...] = ()
    materials: NDArray[np.int64] | None = None
    polygons: NDArray[np.bool_] | None = None

    @classmethod
    def checked(
        cls,
        vertices: ArrayLike,
        faces: ArrayLike,
        attributes: Sequence[Attribute] = (),
        materials: NDArray[np.int64] | None = None,
        polygons: NDArray[np.bool_] | None = None,
    ) -> Mesh:
        """A mesh from array-likes of any numeric type.

        Raises:
            MeshError: wrong shape, no vertices, a coordinate that is not finite, an index out of range; it names
                the first bad row.

        >>> Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        Mesh(3 vertices, 1 faces)
        >>> Mesh.checked([[0, 0, 0]], [[0, 0, 1]])
        Traceback (most recent call last):
        ...
        meshtide_codec.errors.MeshError: face 0 names vertex 1; the mesh has 1 vertices
        """
        try:
            vertex_array = np.ascontiguousarray(vertices, dtype=np.float64)
            face_array = np.asarray(faces)
            if face_array.size == 0:
                face_array = np.zeros((0, 3), np.int64)
            if not np.issubdtype(face_array.dtype, np.integer):
                raise MeshError(f"face indices must be integers, not {face_array.dtype}")
            face_array = np.ascontiguousarray(face_array, dtype=np.int64)
        except (TypeError, ValueError, OverflowError) as error:
            raise MeshError(f"vertices or faces are not numeric arrays: {error}") from error
        _check_shape("vertices", vertex_array)
        _check_shape("faces", face_array)
        if len(vertex_array) == 0:
            raise MeshError("the mesh has no vertices")
        if not np.isfinite(vertex_array).all():
            bad_rows = np.flatnonzero(~np.isfinite(vertex_array).all(axis=1))
            raise MeshError(f"vertex {bad_rows[0]} is not finite: {vertex_array[bad_rows[0]].tolist()}")
        if face_array.view(np.uint64).max(initial=0) >= len(vertex_array):  # there what is negative is large
            bad_rows = np.flatnonzero(((face_array < 0) | (face_array >= len(vertex_array))).any(axis=1))
            row = face_array[bad_rows[0]]
            index = next(int(i) for i in row if not 0 <= i < len(vertex_array))
            raise MeshError(f"face {bad_rows[0]} names vertex {index}; the mesh has {len(vertex_array)} vertices")
        for attribute in attributes:
            attribute.check(len(vertex_array), len(face_array))
        if materials is not None and materials.shape != (len(face_array),):
            raise MeshError(f"materials must have shape ({len(face_array)},), not {materials.shape}")
        if polygons is not None and polygons.shape != face_array.shape:
            raise MeshError(f"polygons must have shape {face_array.shape}, not {polygons.shape}")
        return cls(vertex_array, face_array, tuple(attributes), materials, polygons)

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal."""
        return float(np.linalg.norm(self.vertices.max(axis=0) - self.vertices.min(axis=0)))

    def referenced(self) -> Mesh:
        """The mesh without the vertices that no face uses; itself when all are used, or when it has no faces at all.

        >>> Mesh.checked([[0, 0, 0], [9, 9, 9], [1, 0, 0], [0, 1, 0]], [[0, 2, 3]]).referenced().faces.tolist()
        [[0, 1, 2]]
        """
        used = np.zeros(len(self.vertices), bool)
        used[self.faces] = True
        return self if used.all() or not used.any() else self.with_vertices(used)

    def with_vertices(self, kept: NDArray[np.bool_]) -> Mesh:
        """The mesh of the vertices in the mask `kept` (n,), among which are all that faces use."""
        attributes = tuple(one.of_elements(kept) if one.domain is Domain.VERTEX else one for one in self.attributes)
        faces = (np.cumsum(kept) - 1)[self.faces]
        return replace(self, vertices=self.vertices[kept], faces=faces, attributes=attributes)

    def with_faces(self, kept: NDArray[np.bool_]) -> Mesh:
        """The mesh of the faces in the mask `kept` (m,); all vertices stay."""
        return replace(
            self,
            faces=self.faces[kept],
            attributes=tuple(one if one.domain is Domain.VERTEX else one.of_elements(kept) for one in self.attributes),
            materials=None if self.materials is None else self.materials[kept],
            polygons=None if self.polygons is None else self.polygons[kept],
        )

    def reversed(self) -> Mesh:
        """The mesh with each face turned round: its first corner stays, the other two change places.

        >>> Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).reversed().faces.tolist()
        [[0, 2, 1]]
        """
        turned = [0, 2, 1]
        attributes = tuple(
            one if one.domain is not Domain.CORNER else replace(one, indices=one.rows().reshape(-1, 3)[:, turned])
            for one in self.attributes
        )
        polygons = None if self.polygons is None else self.polygons[:, [2, 1, 0]]
        return replace(self, faces=self.faces[:, turned], attributes=attributes, polygons=polygons)

    def polygons_as_lists(self) -> list[list[int]]:
        """The faces as polygons: of each its vertices in order, without the edges that `polygons` marks.

        A polygon begins at the first corner of its first triangle that is not an inner edge's start. Cost: O(m log m).

        Raises:
            MeshError: all edges around a vertex are marked.

        >>> square = Mesh.checked(
        ...     [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        ...     [[0, 1, 2], [0, 2, 3]],
        ...     polygons=np.array([[False, False, True], [True, False, False]]),
        ... )
        >>> square.polygons_as_lists()
        [[0, 1, 2, 3]]
        """
        corners, counts = self.outlines()
        return _split(self.faces.reshape(-1)[corners].tolist(), counts.tolist())

    def polygon_corners(self) -> list[list[int]]:
        """The same as corners, 3 face + place, to look values of corners up by."""
        corners, counts = self.outlines()
        return _split(corners.tolist(), counts.tolist())

    def outlines(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The same as arrays: the corners of all polygons (k,), one after the other, and of each how many it has (p,).

        Found by doubling steps: around a vertex over the inner edges, and around each outline to its least corner.
        """
        count = 3 * len(self.faces)
        corners = np.arange(count)
        if self.polygons is None:
            return corners, np.full(len(self.faces), 3)
        after = corners - corners % 3 + (corners + 1) % 3
        twin = self._twins(after, np.flatnonzero(self.polygons))
        beyond = np.where(twin < 0, corners, after[twin])  # the next edge around the vertex, where an edge is inner
        for _ in range(count.bit_length() + 1):
            if (twin[beyond] < 0).all():
                break
            beyond = beyond[beyond]
        else:
            raise MeshError("polygons marks all edges around a vertex; a polygon has none inside")
        outer = np.flatnonzero(twin < 0)
        following = beyond[after]
        least, step = corners, following
        while True:
            lower = np.minimum(least, least[step])
            if np.array_equal(lower[outer], least[outer]):
                break
            least, step = lower, step[step]
        first = outer[least[outer] == outer]
        counts = np.bincount(least[outer], minlength=count)[first]
        place = np.cumsum(counts) - counts
        found = np.zeros(len(outer), np.int64)
        active, current = np.arange(len(first)), first
        for passed in range(int(counts.max(initial=0))):
            going = counts[active] > passed
            active, current = active[going], current[going]
            found[place[active] + passed] = current
            current = following[current]
        return found, counts

    def _twins(self, after: NDArray[np.int64], marked: NDArray[np.int64]) -> NDArray[np.int64]:
        """The corner (3 m,) at the other side of each marked edge, by the corner that starts it; -1 for other edges."""
        twin = np.full(len(after), -1)
        tail, head = self.faces.reshape(-1)[marked], self.faces.reshape(-1)[after[marked]]
        # The two sides of an inner edge are neighbours in this order: a polygon's triangles stand together.
        order = np.lexsort((marked, np.maximum(tail, head), np.minimum(tail, head)))
        left, right = order[0::2][: len(order) // 2], order[1::2]
        paired = (tail[left] == head[right]) & (head[left] == tail[right])
        left, right = marked[left[paired]], marked[right[paired]]
        twin[left], twin[right] = right, left
        return twin

    def __repr__(self) -> str:
        return f"Mesh({len(self.vertices)} vertices, {len(self.faces)} faces)"


def canonical_faces(faces: NDArray[Index]) -> NDArray[Index]:
    """The set of oriented triangles in `faces` (m, 3), in one order: degenerate and repeated ones left out.

    Each triangle is rotated, its orientation kept, until its smallest index stands first; rows are sorted.
    Cost: O(m log m).

    >>> canonical_faces(np.array([[2, 0, 1], [0, 1, 2], [1, 0, 2], [3, 3, 1]])).tolist()
    [[0, 1, 2], [0, 2, 1]]
    """
    a, b, c = np.ascontiguousarray(faces.T)
    whole = (a != b) & (b != c) & (c != a)
    if not whole.all():
        a, b, c = a[whole], b[whole], c[whole]
    if len(a) == 0:
        return faces[:0]
    least = np.minimum(np.minimum(a, b), c)
    from_a, from_b = a == least, b == least
    second, third = np.where(from_a, b, np.where(from_b, c, a)), np.where(from_a, c, np.where(from_b, a, b))
    bits = int(max(a.max(), b.max(), c.max())).bit_length()
    if bits <= 21:  # three indices fit one 63-bit key, whose sort is several times faster than one by rows
        keys = (least.astype(np.int64) << (2 * bits)) | (second.astype(np.int64) << bits) | third
        keys.sort()  # not np.unique, which hashes and then sorts, and takes several times as long
        keys = keys[np.r_[True, keys[1:] != keys[:-1]]]
        mask = (1 << bits) - 1
        unique = np.stack([keys >> (2 * bits), (keys >> bits) & mask, keys & mask], axis=1)
    else:
        rows = np.stack([least, second, third], axis=1)
        rows = rows[np.lexsort((third, (least.astype(np.int64) << 32) | second))]
        unique = rows[np.r_[True, (rows[1:] != rows[:-1]).any(axis=1)]]
    canonical: NDArray[Index] = unique.astype(faces.dtype)
    return canonical


def _split(values: list[int], counts: list[int]) -> list[list[int]]:
    """A list cut into lists of these lengths."""
    lists = []
    start = 0
    for count in counts:
        lists.append(values[start : start + count])
        start += count
    return lists


def _check_shape(name: str, array: NDArray[np.generic]) -> None:
    if array.ndim != 2 or array.shape[1] != 3:
        raise MeshError(f"{name} must have shape (n, 3), not {array.shape}")
