"""Meshes of like kind as the paper's car, round table, skateboard and piping, which are not public.

Like those they are put together from parts that touch or cross without sharing vertices, flat and turned, with sharp
edges, and with triangles from tiny to as long as the part. They are made by rule, so everybody has the same ones.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.mesh import Mesh

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Part = tuple[NDArray[np.float64], NDArray[np.int64]]

LEGS = 4
TABLE_SEGMENTS = 90
LEG_SEGMENTS = 20
PIPE_SEGMENTS = 8
PIPE_RADIUS = 0.012
ELBOW_RADIUS = 0.045
ELBOW_RINGS = 4
ROUTES = 104
CORNERS = 8
LATTICE = 16
_PIPING_SEED = 32


def round_table() -> Mesh:
    """A round table: a top with a moulded rim, a turned column and four curved legs.

    >>> round_table()
    Mesh(10842 vertices, 21340 faces)
    """
    steps = np.linspace(0.0, 1.0, 26)
    rim = np.stack([1.0 + 0.03 * np.sin(math.pi * steps), 0.75 + 0.05 * (1.0 - steps)], axis=1)
    top = np.concatenate([[[0.0, 0.8], [0.6, 0.8]], rim, [[0.6, 0.75], [0.0, 0.75]]])
    heights = np.linspace(0.75, 0.25, 48)
    column = np.stack([0.09 + 0.035 * np.cos(9.0 * heights) + 0.04 * (0.75 - heights), heights], axis=1)
    parts = [_turned(top, TABLE_SEGMENTS), _turned(column, TABLE_SEGMENTS)]
    ways = np.linspace(0.0, 1.0, 50)
    for leg in range(LEGS):
        angle = 2 * math.pi * (leg + 0.5) / LEGS
        reach = 0.1 + 0.55 * ways
        height = 0.35 * (1 - ways) ** 2 + 0.06 * np.sin(2 * math.pi * ways) + 0.03
        path = np.stack([reach * math.cos(angle), height, reach * math.sin(angle)], axis=1)
        parts.append(_tube(path, 0.045 - 0.02 * ways, LEG_SEGMENTS))
    return _joined(parts)


def piping() -> Mesh:
    """A piping construction: eight-sided pipes along the axes, with elbows of four rings and nothing between them.

    >>> piping()
    Mesh(18006 vertices, 35100 faces)
    """
    rng = np.random.Generator(np.random.PCG64(_PIPING_SEED))
    parts = []
    for _ in range(ROUTES):
        corners = [rng.integers(0, LATTICE + 1, 3) / LATTICE]
        axis = int(rng.integers(0, 3))
        for _ in range(CORNERS - 1):
            axis = (axis + 1 + int(rng.integers(0, 2))) % 3
            target = corners[-1].copy()
            target[axis] = int(rng.integers(0, LATTICE + 1)) / LATTICE
            if abs(target[axis] - corners[-1][axis]) > 2 * ELBOW_RADIUS:
                corners.append(target)
        path = _with_elbows(corners)
        parts.append(_tube(path, np.full(len(path), PIPE_RADIUS), PIPE_SEGMENTS))
    return _joined(parts)


LIKE_MESHES: dict[str, Callable[[], Mesh]] = {"round-table": round_table, "piping": piping}
"""By the names that `meshtide paper` takes."""


def _turned(profile: NDArray[np.float64], segments: int) -> Part:
    """A profile (k, 2) of radius and height turned about the y axis; points on the axis become single vertices."""
    angles = 2 * math.pi * np.arange(segments) / segments
    radius, height = profile[:, 0, None], profile[:, 1, None]
    rings = np.stack([radius * np.cos(angles), height + 0 * angles, -radius * np.sin(angles)], axis=2)
    return _quads(rings)


def _tube(path: NDArray[np.float64], radii: NDArray[np.float64], segments: int) -> Part:
    """A tube around a path (k, 3), its ends open; each ring is turned as little as possible against the one before."""
    tangents = np.gradient(path, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    side = np.cross(tangents[0], np.eye(3)[np.abs(tangents[0]).argmin()])
    angles = 2 * math.pi * np.arange(segments) / segments
    rings = []
    for point, tangent, radius in zip(path, tangents, radii, strict=True):
        side = side - tangent * (side @ tangent)
        side /= np.linalg.norm(side)
        other = np.cross(tangent, side)
        rings.append(point + radius * (np.outer(np.cos(angles), side) + np.outer(np.sin(angles), other)))
    return _quads(np.array(rings))


def _with_elbows(corners: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """The path along `corners`, each inner one rounded by a quarter of a circle."""
    points = [corners[0]]
    for before, corner, after in zip(corners, corners[1:], corners[2:], strict=False):
        back = (before - corner) / np.linalg.norm(before - corner)
        on = (after - corner) / np.linalg.norm(after - corner)
        points += [
            corner + ELBOW_RADIUS * ((1 - math.sin(angle)) * back + (1 - math.cos(angle)) * on)
            for angle in np.linspace(0.0, math.pi / 2, ELBOW_RINGS)
        ]
    points.append(corners[-1])
    return np.array(points)


def _quads(rings: NDArray[np.float64]) -> Part:
    """Rings (k, s, 3) of vertices joined by pairs of triangles."""
    count, segments, _ = rings.shape
    ring, segment = np.meshgrid(np.arange(count - 1), np.arange(segments), indexing="ij")
    a = (ring * segments + segment).ravel()
    b = (ring * segments + (segment + 1) % segments).ravel()
    c, d = a + segments, b + segments
    return rings.reshape(-1, 3), np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])


def _joined(parts: Sequence[Part]) -> Mesh:
    """One mesh of all parts; vertices of a part that coincide are welded, faces without area dropped."""
    vertices: list[NDArray[np.float64]] = []
    faces: list[NDArray[np.int64]] = []
    offset = 0
    for points, triangles in parts:
        unique, place = np.unique(points.round(9), axis=0, return_inverse=True)
        corners = place.reshape(-1)[triangles]
        a, b, c = corners.T
        vertices.append(unique)
        faces.append(corners[(a != b) & (b != c) & (c != a)] + offset)
        offset += len(unique)
    return Mesh.checked(np.concatenate(vertices), np.concatenate(faces))
