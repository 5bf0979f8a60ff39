"""What an OFF file declares and holds, before it becomes a mesh: the common ground of its text and binary forms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshFileError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits

COLOR_INDEX = "COLOR_INDEX"
"""The attribute of faces that holds the rows of a colour map."""


@dataclass(frozen=True, slots=True)
class OffKeyword:
    """What the keyword at the head of an OFF file announces of each vertex.

    Args:
        texture: two texture coordinates (ST).
        color: three or four values of a colour (C).
        normal: a normal (N).
        homogeneous: a fourth component of the position, which divides the others (4).
        dimension: whether a word gives the dimension of the positions (n).
    """

    texture: bool = False
    color: bool = False
    normal: bool = False
    homogeneous: bool = False
    dimension: bool = False

    @property
    def width(self) -> int:
        """Values of a vertex without its colour."""
        return 3 + self.homogeneous + 3 * self.normal + 2 * self.texture


@dataclass(frozen=True, slots=True)
class OffRows:
    """The rows of an OFF file.

    Args:
        vertices: (n, k) float64: position, normal, colour, texture coordinates.
        colors: how many of the k are the colour: 0, 3 or 4.
        counts: (p,) int64, corners of each face.
        corners: (sum of counts,) int64, in range.
        color_counts: (p,) int64, values of each face's colour.
        color_values: (sum of color_counts,) float64.
        notes: what was left out.
    """

    vertices: NDArray[np.float64]
    colors: int
    counts: NDArray[np.int64]
    corners: NDArray[np.int64]
    color_counts: NDArray[np.int64]
    color_values: NDArray[np.float64]
    notes: tuple[str, ...] = ()


def check_triangles(counts: NDArray[np.int64], limits: FileLimits) -> None:
    """Hold the triangles that polygons of so many corners become against the limits.

    Raises:
        MeshFileError: they are more.
    """
    limits.check("faces", int(np.maximum(counts - 2, 0).sum()))


def check_corners(
    counts: NDArray[np.int64], corners: NDArray[np.int64], vertices: int, place: Callable[[int], str]
) -> None:
    """Check the corners of faces against the number of vertices; `place` says where a face stands.

    Raises:
        MeshFileError: one names a vertex that is not there; the first such face is named.
    """
    bad = np.flatnonzero((corners < 0) | (corners >= vertices))
    if len(bad):
        face = int(np.searchsorted(np.cumsum(counts), bad[0], side="right"))
        raise MeshFileError(
            f"{place(face)}face {face} names vertex {corners[bad[0]]}; the file has {vertices}, counted from 0"
        )


def pieces(starts: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """The numbers from each start on, as many as its count says, one run after the other.

    >>> pieces(np.array([10, 20]), np.array([2, 3])).tolist()
    [10, 11, 20, 21, 22]
    """
    if len(counts) and counts.min() == counts.max():
        return (starts[:, None] + np.arange(counts[0])).reshape(-1)
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    places: NDArray[np.int64] = np.arange(total) + np.repeat(starts - (ends - counts), counts)
    return places
