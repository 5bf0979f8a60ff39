"""What perturbed Diffs do to the compact profile's vertices: each moves inside its leaf cell, and no further.

The Diffs of a packet are how far its bit planes move each leaf's vertex, from the middle of the cell that was known
to the middle of the smaller one; noise on them (Balan & Taubin 2000, section 4.2) shifts the vertex as it is drawn.
The contexts of later Diffs keep looking at what was sent, so that connectivity and coding stay sound. O(leaves).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from meshtide_codec.compact.diff_coder import SliceState
    from meshtide_codec.compact.level import Level
    from meshtide_codec.compact.slices import Slices

    Perturb = Callable[[int, int, NDArray[np.float64]], NDArray[np.float64]]


class SliceShifts:
    """How far perturbed Diffs have shifted the leaves of one slice, in finest steps.

    Args:
        bits: depth of the finest level.
        slice_index: which slice.
        perturb: is called with level, slice and Diffs (k, 3) in steps of that level's grid; returns those to decode.
    """

    def __init__(self, bits: int, slice_index: int, perturb: Perturb) -> None:
        self._bits = bits
        self._slice = slice_index
        self._perturb = perturb
        self._depth = 0
        self.shifts: NDArray[np.float64] = np.zeros((0, 3))

    def go_on(self, state: SliceState) -> None:
        """Perturb what the Diff that brought the slice to `state` has told."""
        if state.depth == self._depth:
            return
        leaf_depths = state.leaf_depths.astype(np.int64)
        shifts = np.zeros((len(state.cells), 3))
        shifts[leaf_depths <= self._depth] = self.shifts
        moved = leaf_depths < state.depth
        cells = state.cells[moved].astype(np.int64)
        known = np.maximum(leaf_depths[moved], self._depth)[:, None]
        before = (2 * (cells >> (state.depth - known)) + 1) << (self._bits - known)
        after = (2 * cells + 1) << (self._bits - state.depth)
        number = self._bits - state.depth
        differences = (after - before) / float(2 << number)
        perturbed = self._perturb(number, self._slice, differences)
        shifts[moved] += (perturbed - differences) * float(1 << number)
        self.shifts, self._depth = shifts, state.depth


def shifted_positions(
    drawn: NDArray[np.float64],
    level: Level,
    states: Sequence[SliceState],
    slices: Slices,
    shifts: Sequence[SliceShifts],
) -> NDArray[np.float64]:
    """Positions (n, 3) in finest steps, those of perturbed leaves shifted as far as their leaf cells allow.

    Args:
        drawn: (n, 3) positions of the level without perturbation, in finest steps.
        level: the level.
        states: of all slices.
        slices: the stream's slices.
        shifts: of all slices.
    """
    moved = drawn.copy()
    for index, (state, slice_shifts) in enumerate(zip(states, shifts, strict=True)):
        vertices = slices.vertices(level, index)
        told = level.leaves[vertices.start : vertices.stop].copy()
        told &= level.cell_depths[vertices.start : vertices.stop] <= state.depth
        leaves = vertices.start + np.flatnonzero(told)
        sides = np.int64(1) << (slices.bits - level.cell_depths[leaves].astype(np.int64))[:, None]
        lowest = level.cells[leaves] * sides - 0.5
        shift = slice_shifts.shifts[state.leaf_depths <= level.depth]
        moved[leaves] = np.where(shift == 0.0, drawn[leaves], np.clip(drawn[leaves] + shift, lowest, lowest + sides))
    return moved
