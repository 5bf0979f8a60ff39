"""Quantization over the unit cube that holds the mesh, and welding of the vertices that meet (paper, section 3).

The cube starts at the mesh's minimum corner and its side is the largest side of the bounding box, unless others are
given (`grid`). Coordinates become integers q = rint((v - origin) / extent * (2^B - 1)); vertices with equal q are one
vertex from here on. The stream's vertex order is the Morton order of q. Cost: O(n log n).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.mesh import Mesh, canonical_faces

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

SMALLEST_B = 4
LARGEST_B = 20
DEFAULT_B = 12
ROUNDING = 1e-9  # of a given extent: so far outside a vertex counts as on the border

_SPREAD_STEPS = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)


@dataclass(frozen=True, slots=True)
class QuantizedMesh:
    """A mesh on the integer grid: what a stream carries losslessly.

    Args:
        positions: (n, 3) int32 in [0, 2^bits), distinct, in Morton order.
        faces: (m, 3) int32, each rotated to its smallest index, sorted, distinct, none degenerate.
        bits: B, bits per coordinate.
        origin: (3,) float64, the position of grid point (0, 0, 0).
        extent: length that 2^bits - 1 steps cover; 0 when the mesh is a single point.
        permutation: (input vertices,) int64, the stream vertex that each input vertex became.
        dropped_faces: how many input faces became degenerate or repeat another one.
    """

    positions: NDArray[np.int32]
    faces: NDArray[np.int32]
    bits: int
    origin: NDArray[np.float64]
    extent: float
    permutation: NDArray[np.int64]
    dropped_faces: int

    @property
    def welded_vertices(self) -> int:
        """How many input vertices fell together with an earlier one."""
        return len(self.permutation) - len(self.positions)

    def mesh(self) -> Mesh:
        """The mesh that a decoder restores: grid positions in the input's unit."""
        return Mesh(dequantize(self.positions, self.bits, self.origin, self.extent), self.faces.astype(np.int64))


def quantize(
    mesh: Mesh, bits: int = DEFAULT_B, origin: NDArray[np.float64] | None = None, extent: float | None = None
) -> QuantizedMesh:
    """Round `mesh` to a grid of 2^bits points per axis and weld what falls together.

    Args:
        mesh: any triangle mesh.
        bits: B.
        origin: (3,) position of grid point (0, 0, 0); the mesh's smallest coordinates when left out.
        extent: length of the grid's side, positive; as much as the mesh needs when left out.

    Raises:
        OptionError: `bits` outside 4..20.
        MeshError: coordinates too large for their differences to be finite, or a vertex outside of the given grid.

    >>> corner = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1e-9, 0]], [[0, 1, 2], [3, 1, 2]])
    >>> quantized = quantize(corner, bits=8)
    >>> len(quantized.positions), len(quantized.faces), quantized.welded_vertices, quantized.dropped_faces
    (3, 1, 1, 1)
    """
    if not SMALLEST_B <= bits <= LARGEST_B:
        raise OptionError(f"B must be {SMALLEST_B}..{LARGEST_B} bits per coordinate, not {bits}")
    given = origin is not None or extent is not None
    columns = np.ascontiguousarray(mesh.vertices.T)  # along which numpy finds extremes ten times as fast
    origin = columns.min(axis=1) if origin is None else origin
    with np.errstate(over="ignore"):
        extent = max(0.0, float((columns.max(axis=1) - origin).max())) if extent is None else extent
    if not has_finite_points(origin.tolist(), extent):
        raise MeshError("the mesh is too large: the difference of its coordinates is not a finite number")
    if given:
        _check_inside(mesh.vertices, origin, extent)
    scale = grid_steps(bits)
    if extent == 0.0:
        grid = np.zeros(mesh.vertices.shape, np.int64)
    else:
        grid = np.clip(np.rint((mesh.vertices - origin) / extent * scale), 0, scale).astype(np.int64)
    _, first, permutation = np.unique(morton_codes(grid), return_index=True, return_inverse=True)
    permutation = permutation.reshape(-1)
    faces = canonical_faces(permutation[mesh.faces].astype(np.int32))
    return QuantizedMesh(
        positions=grid[first].astype(np.int32),
        faces=np.ascontiguousarray(faces),
        bits=bits,
        origin=origin,
        extent=extent,
        permutation=permutation,
        dropped_faces=len(mesh.faces) - len(faces),
    )


def has_finite_points(origin: Sequence[float], extent: float) -> bool:
    """Whether all points of a grid, and those half a step around it, have finite coordinates.

    >>> has_finite_points((0.0, 0.0, -1e308), 1e308), has_finite_points((1e308, 0.0, 0.0), 1e308)
    (False, False)
    """
    return all(math.isfinite(abs(coordinate) + 1.125 * extent) for coordinate in origin)


def _check_inside(vertices: NDArray[np.float64], origin: NDArray[np.float64], extent: float) -> None:
    """Raise MeshError unless all vertices lie on the grid, but for rounding."""
    slack = ROUNDING * extent
    with np.errstate(over="ignore"):
        outside = ((vertices < origin - slack) | (vertices > origin + extent + slack)).any(axis=1)
    if outside.any():
        bad = int(np.argmax(outside))
        raise MeshError(
            f"vertex {bad} at {_point(vertices[bad])} lies outside of the grid, which reaches from {_point(origin)} "
            f"to {_point(origin + extent)}"
        )


def _point(position: NDArray[np.float64]) -> str:
    return f"({', '.join(f'{coordinate:.9g}' for coordinate in position)})"


def dequantize(
    positions: NDArray[np.generic], bits: int, origin: NDArray[np.float64], extent: float
) -> NDArray[np.float64]:
    """Positions (n, 3) in finest steps, integer or not, as float64 in the input's unit."""
    return np.asarray(positions, np.float64) * (extent / grid_steps(bits)) + origin


def grid_steps(bits: int) -> int:
    """Steps between the two ends of an axis."""
    return (1 << bits) - 1


def morton_codes(positions: NDArray[np.integer]) -> NDArray[np.uint64]:
    """Interleaved bits of (n, 3) coordinates below 2^21, x highest: the order of a stream's vertices.

    >>> morton_codes(np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0], [3, 3, 3]])).tolist()
    [1, 2, 4, 63]
    """
    spread = positions.astype(np.uint64)
    for shift, mask in _SPREAD_STEPS:
        spread = (spread | (spread << np.uint64(shift))) & np.uint64(mask)
    codes: NDArray[np.uint64] = (spread[:, 0] << np.uint64(2)) | (spread[:, 1] << np.uint64(1)) | spread[:, 2]
    return codes
