"""The display filter: what a client draws of a level whose vertices are known up to a cell only.

A vertex is drawn at clamp(y + g K y, cell) with y = clamp(x - f K x, cell), where x is the middle of the cell known to
hold it and K = I - D^-1 M the random-walk Laplacian of the level's graph: the first step smooths (Balan & Taubin 2000,
eqs. 1 and 2), the second gives back what the first has shrunk (Taubin, "A signal processing approach to fair surface
design", SIGGRAPH 1995). So smooth surfaces lose the terraces of the grid and sharp ones leave no cell. Which pair of
strengths a level has takes four bits; the encoder chooses it by how far the drawn faces are from the true surface.
O(n + m).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec.compact.display_filter_kernels import move_within_cells, squared_distance
from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.level import Level
    from meshtide_codec.compact.octree import Octree

STRENGTH_UNIT = 128


class Strength(NamedTuple):
    """How strongly a level is filtered, in units of 1/128.

    Attributes:
        smoothing: f, 0 to 255.
        sharpening: g, 0 to 255.
    """

    smoothing: int
    sharpening: int


UNFILTERED = Strength(0, 0)
STRENGTHS = tuple(
    Strength(smoothing, sharpening)
    for smoothing, sharpening in (
        (0, 0), (13, 13), (26, 26), (38, 26), (51, 0), (64, 26), (64, 38), (64, 51),
        (64, 64), (77, 51), (77, 64), (96, 0), (96, 51), (96, 64), (115, 0), (115, 64),
    )
)  # fmt: skip
"""Those that a header can tell: found one after the other, each the one that brings the levels of eight
meshes nearest on average."""


def drawn_positions(
    level: Level, middles: NDArray[np.int64], depths: NDArray[np.uint8], bits: int, strength: Strength
) -> NDArray[np.float64]:
    """Where to draw a level's vertices, (n, 3) in finest steps; exactly known vertices stay where they are.

    Args:
        level: the level, with faces.
        middles: (n, 3) middles of the known cells in half finest steps, from `known_positions`.
        depths: (n,) depths of those cells, at most `bits`.
        bits: depth of the finest level.
        strength: of the level; `UNFILTERED` draws the middles.

    Raises:
        OptionError: a strength is not a byte.
    """
    if not all(0 <= part <= 255 for part in strength):
        raise OptionError(f"strengths of the display filter are bytes, not {tuple(strength)}")
    half_sides = np.int64(1) << (bits - depths.astype(np.int64))
    starts, members, _ = level.rings
    drawn = middles.astype(np.float64)
    for part, sign in zip(strength, (1.0, -1.0), strict=True):
        if part:
            drawn = move_within_cells(drawn, middles, half_sides, starts, members, sign * part / STRENGTH_UNIT)
    return 0.5 * (drawn - 1.0)


def choose_strength(octree: Octree, depth: int) -> Strength:
    """The strength that draws the level of `depth`, with all Diffs up to it, nearest to the true surface.

    The surface near a vertex is the plane through the mean of the finest vertices in its cell, perpendicular to the
    mean of their normals; a face is as far off as its corners on average, and counts by its area.
    """
    level = octree.levels[depth]
    if level.faces is None or len(level.faces) == 0 or depth == octree.bits:
        return UNFILTERED
    firsts = octree.first_vertices[depth]
    shift = octree.bits - depth
    cells = octree.positions[firsts].astype(np.int64) >> shift
    middles = (2 * cells + 1) << shift
    half_sides = np.full(level.vertex_count, 1 << shift, np.int64)
    points, normals = _surface_at(octree, firsts)
    points = 2.0 * points + 1.0
    a, b, c = (points[level.faces[:, corner]] for corner in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    starts, members, _ = level.rings
    smoothed = {0: middles.astype(np.float64)}
    best_cost, best = np.inf, UNFILTERED
    for strength in STRENGTHS:
        f, g = strength.smoothing, strength.sharpening
        if f not in smoothed:
            smoothed[f] = move_within_cells(smoothed[0], middles, half_sides, starts, members, f / STRENGTH_UNIT)
        drawn = smoothed[f]
        if g:
            drawn = move_within_cells(drawn, middles, half_sides, starts, members, -g / STRENGTH_UNIT)
        cost = squared_distance(drawn, points, normals, level.faces, areas)
        if cost < best_cost:
            best_cost, best = cost, strength
    return best


def _surface_at(octree: Octree, firsts: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean position and unit mean normal of the finest vertices of each group that begins at `firsts`."""
    positions = octree.positions.astype(np.float64)
    counts = np.diff(np.r_[firsts, len(positions)])[:, None]
    points = np.add.reduceat(positions, firsts, axis=0) / counts
    sums = np.add.reduceat(octree.normals, firsts, axis=0)
    lengths = np.sqrt(np.square(sums).sum(axis=1, keepdims=True))
    return points, sums / np.where(lengths > 0.0, lengths, 1.0)
