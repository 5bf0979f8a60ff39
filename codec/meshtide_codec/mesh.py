"""A triangle mesh as plain arrays, and what has to hold for it to be one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from meshtide_codec.errors import MeshError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

Index = TypeVar("Index", bound=np.signedinteger)


@dataclass(frozen=True, slots=True)
class Mesh:
    """Vertices and triangles; anything is legal that has finite coordinates and indices in range.

    Args:
        vertices: (n, 3) float64 positions, in the unit of the file they came from.
        faces: (m, 3) int64 indices into `vertices`, counter-clockwise seen from outside.

    Use `Mesh.checked` for arrays from outside; the bare constructor trusts its caller.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]

    @classmethod
    def checked(cls, vertices: ArrayLike, faces: ArrayLike) -> Mesh:
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
        bad_rows = np.flatnonzero(~np.isfinite(vertex_array).all(axis=1))
        if len(bad_rows):
            raise MeshError(f"vertex {bad_rows[0]} is not finite: {vertex_array[bad_rows[0]].tolist()}")
        bad_rows = np.flatnonzero(((face_array < 0) | (face_array >= len(vertex_array))).any(axis=1))
        if len(bad_rows):
            row = face_array[bad_rows[0]]
            index = next(int(i) for i in row if not 0 <= i < len(vertex_array))
            raise MeshError(f"face {bad_rows[0]} names vertex {index}; the mesh has {len(vertex_array)} vertices")
        return cls(vertex_array, face_array)

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
        if used.all() or not used.any():
            return self
        return Mesh(self.vertices[used], (np.cumsum(used) - 1)[self.faces])

    def __repr__(self) -> str:
        return f"Mesh({len(self.vertices)} vertices, {len(self.faces)} faces)"


def canonical_faces(faces: NDArray[Index]) -> NDArray[Index]:
    """The set of oriented triangles in `faces` (m, 3), in one order: degenerate and repeated ones left out.

    Each triangle is rotated, its orientation kept, until its smallest index stands first; rows are sorted.
    Cost: O(m log m).

    >>> canonical_faces(np.array([[2, 0, 1], [0, 1, 2], [1, 0, 2], [3, 3, 1]])).tolist()
    [[0, 1, 2], [0, 2, 1]]
    """
    a, b, c = faces[:, 0], faces[:, 1], faces[:, 2]
    rotated: NDArray[Index] = faces[(a != b) & (b != c) & (c != a)]
    if len(rotated) == 0:
        return rotated
    first = np.argmin(rotated, axis=1)[:, None]
    rotated = np.take_along_axis(rotated, (first + np.arange(3)) % 3, axis=1)
    count = int(rotated.max()) + 1
    if count <= 1 << 21:  # three indices fit one 63-bit key, whose sort is several times faster than one by rows
        keys = (rotated[:, 0].astype(np.int64) * count + rotated[:, 1]) * count + rotated[:, 2]
        keys.sort()  # not np.unique, which hashes and then sorts, and takes several times as long
        keys = keys[np.r_[True, keys[1:] != keys[:-1]]]
        pairs, third = np.divmod(keys, count)
        unique = np.stack([*np.divmod(pairs, count), third], axis=1)
    else:
        unique = np.unique(rotated, axis=0)
    canonical: NDArray[Index] = unique.astype(faces.dtype)
    return canonical


def _check_shape(name: str, array: NDArray[np.generic]) -> None:
    if array.ndim != 2 or array.shape[1] != 3:
        raise MeshError(f"{name} must have shape (n, 3), not {array.shape}")
