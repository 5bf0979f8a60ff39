"""The display filter: what a client draws of a level whose vertices are known up to a cell only.

A vertex is drawn at clamp(x - c K x, cell), where x is the middle of the cell known to hold it and K = I - D^-1 M the
random-walk Laplacian of the level's graph (Balan & Taubin 2000, eqs. 1 and 2: a Gaussian filter), so that smooth
surfaces lose the terraces of the grid and sharp ones leave no cell. The strength c costs one byte per level; the
encoder chooses it by the drawn points' distance from the planes through the true ones. O(n + m).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.display_filter_kernels import smooth_within_cells
from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.level import Level
    from meshtide_codec.compact.octree import Octree

STRENGTH_UNIT = 128  # a byte of 128 is c = 1
STRENGTH_STEP = 12
"""Strengths that a header can hold are multiples of this, up to 15 times as much: c from 0 to 1.4."""
CANDIDATES = range(0, 16 * STRENGTH_STEP, STRENGTH_STEP)


def drawn_positions(
    level: Level, middles: NDArray[np.int64], depths: NDArray[np.uint8], bits: int, strength: int
) -> NDArray[np.float64]:
    """Where to draw a level's vertices, (n, 3) in finest steps; exactly known vertices stay where they are.

    Args:
        level: the level, with faces.
        middles: (n, 3) middles of the known cells in half finest steps, from `known_positions`.
        depths: (n,) depths of those cells, at most `bits`.
        bits: depth of the finest level.
        strength: the level's byte, 0 to 255; 0 draws the middles.

    Raises:
        OptionError: `strength` is not a byte.
    """
    if not 0 <= strength <= 255:
        raise OptionError(f"the display filter's strength is one byte, not {strength}")
    half_sides = np.int64(1) << (bits - depths.astype(np.int64))
    starts, members, _ = level.rings
    drawn = smooth_within_cells(middles, half_sides, starts, members, strength / STRENGTH_UNIT)
    return 0.5 * (drawn - 1.0)


def choose_strength(octree: Octree, depth: int) -> int:
    """The byte that draws the level of `depth`, with all Diffs up to it, nearest to the true surface.

    The surface near a vertex is the plane through the mean of the finest vertices in its cell, perpendicular to the
    mean of their normals.
    """
    level = octree.levels[depth]
    firsts = octree.first_vertices[depth]
    shift = octree.bits - depth
    cells = octree.positions[firsts].astype(np.int64) >> shift
    middles = (2 * cells + 1) << shift
    depths = np.full(level.vertex_count, depth, np.uint8)
    points, normals = _surface_at(octree, firsts)
    best_cost, best = np.inf, 0
    for strength in CANDIDATES:
        apart = drawn_positions(level, middles, depths, octree.bits, strength) - points
        cost = float(np.square((apart * normals).sum(axis=1)).sum())
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
