"""One depth of the octree, as the reliable packets tell it: the data that every context of Map and Diff is made of.

A vertex of depth b is an occupied cell of side 2^-b of the unit cube. A cell that holds exactly one finest vertex is
a leaf: it is never split again and stays as it is through all greater depths; the vertex' remaining bits are Diffs.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.ring_kernels import find_across, order_rings
from meshtide_codec.errors import MeshError
from meshtide_codec.quantize import morton_codes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.ring_kernels import Rings


@dataclasses.dataclass(frozen=True, eq=False)
class Level:
    """The vertices of octree depth `depth`, in Morton order, and their triangles once those are known.

    Attributes:
        depth: octree depth b; cells have side 2^-b.
        cells: (n, 3) int32, each cell in the grid of its own depth, coordinates in [0, 2^cell_depth).
        cell_depths: (n,) uint8, the depth of each cell: `depth`, or less for a leaf that arose earlier.
        leaves: (n,) bool, whether the cell holds exactly one finest vertex.
        parents: (n,) int32, index of each vertex' parent among the vertices of depth - 1 (of itself at depth 0).
        faces: (m, 3) int32 triangles of this depth, or None while they are not known.
    """

    depth: int
    cells: NDArray[np.int32]
    cell_depths: NDArray[np.uint8]
    leaves: NDArray[np.bool_]
    parents: NDArray[np.int32]
    faces: NDArray[np.int32] | None = None

    @property
    def vertex_count(self) -> int:
        """Number of vertices n."""
        return len(self.cells)

    @cached_property
    def all_leaves(self) -> bool:
        """Whether no cell will be split any more: no Map follows."""
        return bool(self.leaves.all())

    @cached_property
    def centres(self) -> NDArray[np.int32]:
        """(n, 3) centres of the cells in half cells of this depth: 2 is the side of a cell, 2^(depth+1) the cube's.

        >>> root_level(5).centres.tolist()
        [[1, 1, 1]]
        """
        shifts = (self.depth - self.cell_depths).astype(np.int32)
        return ((2 * self.cells + 1) << shifts[:, None]).astype(np.int32)

    @cached_property
    def codes(self) -> NDArray[np.int64]:
        """(n,) Morton codes of the cells' lowest corners in the grid of this depth; strictly increasing."""
        shifts = (self.depth - self.cell_depths).astype(np.int32)
        return morton_codes(self.cells << shifts[:, None]).astype(np.int64)

    @cached_property
    def rings(self) -> Rings:
        """The vertices' rings, see `order_rings`; MeshError while the faces are not known."""
        if self.faces is None:
            raise MeshError(f"the faces of depth {self.depth} are needed for what follows it, but are not known yet")
        return order_rings(self.faces, self.vertex_count)

    @cached_property
    def across(self) -> NDArray[np.int32]:
        """For every slot of the rings the vertex across the triangle there, see `find_across`."""
        return find_across(self.rings)

    def with_faces(self, faces: NDArray[np.integer]) -> Level:
        """This level with its triangles (m, 3); MeshError when they refer to vertices that do not exist."""
        checked = np.ascontiguousarray(faces, np.int32).reshape(-1, 3)
        if len(checked) and (int(checked.min()) < 0 or int(checked.max()) >= self.vertex_count):
            raise MeshError(f"faces of depth {self.depth} refer to vertices outside of 0..{self.vertex_count - 1}")
        return dataclasses.replace(self, faces=checked)

    def deepened(self) -> Level:
        """The next depth's level when all cells are leaves: the same cells, faces and rings; MeshError otherwise."""
        if not self.all_leaves:
            raise MeshError(f"depth {self.depth + 1} needs a Map: not all cells of depth {self.depth} are leaves")
        identity = np.arange(self.vertex_count, dtype=np.int32)
        deeper = dataclasses.replace(self, depth=self.depth + 1, parents=identity)
        if self.faces is not None:
            deeper.__dict__["rings"] = self.rings
            deeper.__dict__["across"] = self.across
        return deeper


def root_level(vertex_count: int) -> Level:
    """Depth 0: the unit cube as one cell, a leaf when the mesh has a single vertex."""
    return Level(
        depth=0,
        cells=np.zeros((1, 3), np.int32),
        cell_depths=np.zeros(1, np.uint8),
        leaves=np.array([vertex_count == 1]),
        parents=np.zeros(1, np.int32),
        faces=np.zeros((0, 3), np.int32),
    )
