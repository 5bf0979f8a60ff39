"""Diff packets: one more bit per coordinate for the leaves of a slice that are coarser than the depth.

The Diffs of a slice are bit planes: each builds on the slice's earlier ones and on reliable data, and on nothing
else. A neighbour in another slice is known by its leaf cell's centre only, whatever has arrived of it. When a Diff is
missing, the vertices stay at the centre of what is known, and the slice's later Diffs cannot be decoded until it
arrives; all other packets can. Model states are carried along from Diff to Diff of a slice. The format of the payload
is `diff_kernels.code_diff` over the range coder, or `diff_deep_kernels.code_diff_deeply` where Diffs are coded deeply.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact import diff_deep_kernels, diff_kernels
from meshtide_codec.compact import diff_prediction_kernels as prediction
from meshtide_codec.compact.diff_row_kernels import fill_rows
from meshtide_codec.compact.mirror_kernels import find_partners
from meshtide_codec.compact.models import DeepModels, trained_deep_diff_models, trained_diff_models
from meshtide_codec.errors import DiffError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.level import Level
    from meshtide_codec.compact.mirror import Mirror
    from meshtide_codec.compact.models import Models
    from meshtide_codec.compact.octree import Octree
    from meshtide_codec.compact.slices import Slices
    from meshtide_codec.entropy.codec import PayloadReader, PayloadWriter
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

PACKET = "Diff"


@dataclasses.dataclass
class SliceState:
    """What the Diffs of one slice have told so far: the leaves of the depth that they have reached, in Morton order.

    Attributes:
        depth: the depth up to which all leaves of the slice are known.
        cells: (k, 3) int32, the cell of depth `depth` that each leaf's vertex lies in.
        leaf_depths: (k,) uint8, the depth at which each became a leaf.
        errors: (k,) float64, how badly each vertex was predicted lately.
        partners: (k,) int32, the leaf each leaf is the mirror image of, or -1.
        outcomes: (k,) uint8, how each leaf compared with its partner.
        models: contexts and weights after the last Diff; never changed, since slices that have told nothing share them.
    """

    depth: int
    cells: NDArray[np.int32]
    leaf_depths: NDArray[np.uint8]
    errors: NDArray[np.float64]
    partners: NDArray[np.int32]
    outcomes: NDArray[np.uint8]
    models: Models


def new_slice_state(
    root: Level,
    slices: Slices,
    slice_index: int,
    models: Models | None = None,
    *,
    deep: bool = False,
) -> SliceState:
    """The state of a slice before its first Diff.

    Args:
        root: the level of depth 0, `root_level(vertex_count)`.
        slices: the stream's slices.
        slice_index: which of them.
        models: other states than the trained ones, for training.
        deep: whether the Diffs are coded deeply.
    """
    if models is None:
        models = trained_deep_diff_models() if deep else trained_diff_models()
    vertices = slices.vertices(root, slice_index)
    count = int(root.leaves[vertices.start : vertices.stop].sum())
    return SliceState(
        depth=0,
        cells=np.zeros((count, 3), np.int32),
        leaf_depths=np.zeros(count, np.uint8),
        errors=np.full(count, diff_kernels.NEW_ERROR),
        partners=np.full(count, -1, np.int32),
        outcomes=np.zeros(count, np.uint8),
        models=models,
    )


def write_diff(
    writer: PayloadWriter,
    octree: Octree,
    depth: int,
    state: SliceState,
    slices: Slices,
    slice_index: int,
    mirror: Mirror | None = None,
) -> None:
    """Add the Diff of a slice at `depth`, nothing when no leaf of the slice is coarser; `state` goes on to `depth`.

    Args:
        writer: of the payload, which may hold more.
        octree: the mesh.
        depth: the depth that is coded, state.depth + 1.
        state: the slice's state after its previous Diff.
        slices: the stream's slices.
        slice_index: which of them.
        mirror: the stream's mirror plane, if it has one.
    """
    level = octree.levels[depth]
    plane = _BitPlane(level, state, slices.vertices(level, slice_index), mirror)
    true_cells = octree.positions[octree.first_vertices[depth][plane.owners]] >> (octree.bits - depth)

    def write(coder: Coder, buffer: Buffer) -> SliceState:
        return plane.run(coder, buffer, true_cells.copy())

    _go_on(state, writer.write(write, expected_bytes=64 + len(plane.owners) // 2))


def read_diff(
    reader: PayloadReader,
    level: Level,
    state: SliceState,
    slices: Slices,
    slice_index: int,
    mirror: Mirror | None = None,
) -> None:
    """Bring `state` from level.depth - 1 to level.depth.

    Args:
        reader: of the payload, which may hold more than what `write_diff` added.
        level: level of the depth that is decoded, with faces.
        state: the slice's state after its previous Diff.
        slices: the stream's slices.
        slice_index: which of them.
        mirror: the stream's mirror plane, if it has one.

    Raises:
        DiffError: an earlier Diff of the slice is missing.
    """
    _go_on(state, _BitPlane(level, state, slices.vertices(level, slice_index), mirror).read(reader))


def is_empty(state: SliceState, level: Level, slices: Slices, slice_index: int) -> bool:
    """Whether a slice has no leaves up to a level, so that there is nothing to tell of it."""
    if len(state.cells):
        return False
    vertices = slices.vertices(level, slice_index)
    return not level.leaves[vertices.start : vertices.stop].any()


def has_diff(level: Level, slices: Slices, slice_index: int) -> bool:
    """Whether the slice has leaves coarser than the level, so that a Diff packet is sent."""
    vertices = slices.vertices(level, slice_index)
    return bool((level.cell_depths[vertices.start : vertices.stop] < level.depth).any())


def known_positions(
    level: Level, states: list[SliceState], slices: Slices
) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """What is known of a level's vertices: middles and depths of the smallest cells known to hold them.

    Args:
        level: any level that has been decoded; the states may lag behind it where Diffs are missing, or be ahead.
        states: the state of every slice.
        slices: the stream's slices.

    Returns:
        (n, 3) int64 middles in half finest steps (2 p + 1 for a vertex at finest position p), and (n,) uint8 depths.
    """
    bits = slices.bits
    depths = level.cell_depths.copy()
    shifts = (bits - depths.astype(np.int64))[:, None]
    middles = (2 * level.cells.astype(np.int64) + 1) << shifts
    for slice_index, state in enumerate(states):
        vertices = slices.vertices(level, slice_index)
        told = level.leaves[vertices.start : vertices.stop].copy()
        told &= level.cell_depths[vertices.start : vertices.stop] <= state.depth
        leaves = vertices.start + np.flatnonzero(told)
        cells = state.cells[state.leaf_depths <= level.depth].astype(np.int64)
        middles[leaves] = (2 * cells + 1) << (bits - state.depth)
        depths[leaves] = state.depth
    return middles, depths


def _go_on(state: SliceState, finished: SliceState) -> None:
    for field in dataclasses.fields(SliceState):
        setattr(state, field.name, getattr(finished, field.name))


class _BitPlane:
    """One Diff about to be coded: which vertices it moves, and everything its contexts look at."""

    def __init__(self, level: Level, state: SliceState, vertices: range, mirror: Mirror | None) -> None:
        if state.depth != level.depth - 1:
            raise DiffError(
                f"the Diff of depth {level.depth} needs those before it, which have arrived up to depth "
                f"{state.depth}; decode it after them",
                packet=PACKET,
            )
        self.level = level
        self.state = state
        self.vertices = vertices
        self.mirror = mirror
        leaves = vertices.start + np.flatnonzero(level.leaves[vertices.start : vertices.stop])
        self.leaf_vertices = leaves.astype(np.int32)
        self.coarser = level.cell_depths[leaves] < level.depth
        self.owners = self.leaf_vertices[self.coarser]
        if len(self.owners) != len(state.cells):
            raise DiffError(
                f"the slice has {len(self.owners)} leaves above depth {level.depth}, but its state tells of "
                f"{len(state.cells)}; they are of different streams",
                packet=PACKET,
            )

    def read(self, reader: PayloadReader) -> SliceState:
        """The state that follows, by the bits that a payload goes on with."""
        return self.run(reader.coder, reader.buffer, np.zeros((len(self.owners), 3), np.int32))

    def run(self, coder: Coder, buffer: Buffer, targets: NDArray[np.int32]) -> SliceState:
        """Code the bits of `targets` (read or written, as the coder says); returns the state that follows."""
        level, state = self.level, self.state
        if len(self.leaf_vertices) == 0:
            return dataclasses.replace(state, depth=level.depth)
        rows = self._rows()
        models = state.models.copy()
        outcomes = np.zeros(level.vertex_count if self.mirror else 0, np.uint8)
        partners = np.full(len(outcomes), -1, np.int32)
        axis, plane = -1, 0.0
        if self.mirror is not None:
            axis, plane = self.mirror.axis, self.mirror.plane(level.depth)
            self._find_partners(rows, outcomes, partners, axis, plane)
        if isinstance(models, DeepModels):
            diff_deep_kernels.code_diff_deeply(
                coder,
                buffer,
                models.mixer,
                rows,
                self.owners,
                (level.depth - level.cell_depths[self.owners]).astype(np.int64),
                targets,
                level.rings,
                level.across,
                self.vertices.start,
                self.vertices.stop,
                axis,
                plane,
                partners,
                outcomes,
            )
        elif len(self.owners):
            diff_kernels.code_diff(
                coder,
                buffer,
                models.contexts,
                models.weights,
                rows,
                self.owners,
                targets,
                level.rings,
                level.across,
                self.vertices.start,
                self.vertices.stop,
                axis,
                plane,
                partners,
                outcomes,
            )
        return self._finished(rows, targets, outcomes, partners, models)

    def _rows(self) -> NDArray[np.float64]:
        """Working rows of all vertices: reliable data, and what this slice's Diffs have told of its own leaves."""
        level, state = self.level, self.state
        return fill_rows(level.centres, level.cell_depths, level.depth, self.owners, state.cells, state.errors)

    def _find_partners(
        self,
        rows: NDArray[np.float64],
        outcomes: NDArray[np.uint8],
        partners: NDArray[np.int32],
        axis: int,
        plane: float,
    ) -> None:
        """Carry partners and outcomes over from the state, and look for partners of the vertices that have none."""
        level, state = self.level, self.state
        outcomes[self.owners] = state.outcomes
        kept = (state.partners >= 0) & (state.outcomes != diff_kernels.DIFFERS)
        partners[self.owners[kept]] = self.owners[state.partners[kept]]
        leaf_cells = level.cells[self.leaf_vertices] >> 1
        leaf_cells[self.coarser] = state.cells
        find_partners(
            rows, self.owners, state.cells, self.leaf_vertices, leaf_cells, axis, plane, level.depth, partners
        )

    def _finished(
        self,
        rows: NDArray[np.float64],
        targets: NDArray[np.int32],
        outcomes: NDArray[np.uint8],
        partners: NDArray[np.int32],
        models: Models,
    ) -> SliceState:
        """The state after this Diff: its vertices, and the leaves that arose at this depth."""
        level = self.level
        cells = level.cells[self.leaf_vertices]
        cells[self.coarser] = targets
        finished = SliceState(
            depth=level.depth,
            cells=cells,
            leaf_depths=level.cell_depths[self.leaf_vertices],
            errors=rows[self.leaf_vertices, prediction.ERROR],
            partners=np.full(len(cells), -1, np.int32),
            outcomes=np.zeros(len(cells), np.uint8),
            models=models,
        )
        if self.mirror is not None:
            places = np.zeros(level.vertex_count + 1, np.int32)
            places[self.leaf_vertices] = np.arange(len(cells))
            places[-1] = -1
            finished.partners = places[partners[self.leaf_vertices]]
            finished.outcomes = outcomes[self.leaf_vertices]
        return finished
