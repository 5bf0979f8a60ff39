"""Kernels of quadrics: sums of squared distances to planes, as ten coefficients.

Source: Garland, Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997, sections 4 and 6.1,
with planes weighted by area, and across border edges by squared length. Linear in the number of faces.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer

    Points = NDArray[np.float64]
    Integers = NDArray[np.int32]

QUADRIC_SIZE = 10  # xx xy xz yy yz zz, x y z, 1
BORDER_WEIGHT = 0.5  # of a plane across a border edge, times the edge's squared length
SETTLING_PULL = 1e-2  # weight of the squared distance to a cluster's middle, against that of the planes
LEAST_PULL = 1e-30  # for vertices whose faces have no area


@kernel
def sum_quadrics(vertices: Points, faces: Integers, borders: Integers, owners: Integers, quadrics: Points) -> None:
    """Add the planes of the faces, and those across the border edges, to the quadrics of their vertices' owners.

    Args:
        vertices: (n, 3).
        faces: (m, 3), indices in range.
        borders: corners (3 face + corner) where a border edge begins.
        owners: (n,) rows of `quadrics`.
        quadrics: (k, 10), added to.
    """
    for face in range(len(faces)):
        x, y, z = face_normal(vertices, faces, face)
        doubled = np.sqrt(x * x + y * y + z * z)
        if doubled > 0.0:
            for corner in range(3):
                on = faces[face, corner]
                _add_plane(quadrics, owners[on], vertices, on, x / doubled, y / doubled, z / doubled, doubled / 6.0)
    for border in range(len(borders)):
        face, corner = borders[border] // 3, borders[border] % 3
        a, b = faces[face, corner], faces[face, (corner + 1) % 3]
        normal_x, normal_y, normal_z = face_normal(vertices, faces, face)
        edge_x = vertices[b, 0] - vertices[a, 0]
        edge_y = vertices[b, 1] - vertices[a, 1]
        edge_z = vertices[b, 2] - vertices[a, 2]
        x = edge_y * normal_z - edge_z * normal_y
        y = edge_z * normal_x - edge_x * normal_z
        z = edge_x * normal_y - edge_y * normal_x
        length = np.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            weight = BORDER_WEIGHT * (edge_x * edge_x + edge_y * edge_y + edge_z * edge_z)
            _add_plane(quadrics, owners[a], vertices, a, x / length, y / length, z / length, weight)
            _add_plane(quadrics, owners[b], vertices, a, x / length, y / length, z / length, weight)


@kernel
def settle(quadrics: Points, positions: Points) -> None:
    """Move every position (k, 3) to the minimum of its quadric and of a pull to where it was."""
    for vertex in range(len(positions)):
        pull = SETTLING_PULL * trace(quadrics[vertex]) + LEAST_PULL
        x, y, z = positions[vertex, 0], positions[vertex, 1], positions[vertex, 2]
        _, x, y, z = minimum(quadrics[vertex], x, y, z, pull)
        positions[vertex, 0] = x
        positions[vertex, 1] = y
        positions[vertex, 2] = z


@kernel
def face_normal(vertices: Points, faces: Integers, face: Integer) -> tuple[float, float, float]:
    """The face's normal, as long as twice its area."""
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    bx, by, bz = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
    cx, cy, cz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
    return by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx


@kernel
def _add_plane(
    quadrics: Points, row: Integer, vertices: Points, on: Integer, x: float, y: float, z: float, weight: float
) -> None:
    """Add the squared distance to the plane through vertex `on` with unit normal (x, y, z) to a quadric."""
    offset = -(x * vertices[on, 0] + y * vertices[on, 1] + z * vertices[on, 2])
    quadric = quadrics[row]
    quadric[0] += weight * x * x
    quadric[1] += weight * x * y
    quadric[2] += weight * x * z
    quadric[3] += weight * y * y
    quadric[4] += weight * y * z
    quadric[5] += weight * z * z
    quadric[6] += weight * x * offset
    quadric[7] += weight * y * offset
    quadric[8] += weight * z * offset
    quadric[9] += weight * offset * offset


@kernel
def trace(quadric: Points) -> float:
    """Total weight of the quadric's planes."""
    return float(quadric[0] + quadric[3] + quadric[5])


@kernel
def minimum(quadric: Points, x: float, y: float, z: float, pull: float) -> tuple[float, float, float, float]:
    """Value and place of the minimum of a quadric and of `pull` times the squared distance to (x, y, z).

    By Cholesky: the pull makes the matrix positive definite.
    """
    xx, xy, xz, yy, yz, zz = quadric[0], quadric[1], quadric[2], quadric[3], quadric[4], quadric[5]
    gx = xx * x + xy * y + xz * z + quadric[6]
    gy = xy * x + yy * y + yz * z + quadric[7]
    gz = xz * x + yz * y + zz * z + quadric[8]
    value = gx * x + gy * y + gz * z + quadric[6] * x + quadric[7] * y + quadric[8] * z + quadric[9]
    l11 = np.sqrt(xx + pull)
    l21, l31 = xy / l11, xz / l11
    l22 = np.sqrt(max(yy + pull - l21 * l21, pull))
    l32 = (yz - l31 * l21) / l22
    l33 = np.sqrt(max(zz + pull - l31 * l31 - l32 * l32, pull))
    s1 = -gx / l11
    s2 = (-gy - l21 * s1) / l22
    s3 = (-gz - l31 * s1 - l32 * s2) / l33
    dz = s3 / l33
    dy = (s2 - l32 * dz) / l22
    dx = (s1 - l21 * dy - l31 * dz) / l11
    return max(value - s1 * s1 - s2 * s2 - s3 * s3, 0.0), x + dx, y + dy, z + dz
