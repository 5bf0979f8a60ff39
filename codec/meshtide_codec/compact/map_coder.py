"""Map packets: from one depth's cells to the next depth's, reliable data only.

A Map tells for each cell that is not a leaf which of its eight children are occupied, and which of those are leaves.
Model states are carried along from Map to Map: Maps are reliable and arrive in order. The format of the payload is
`map_kernels.code_map` over the range coder.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact import map_kernels
from meshtide_codec.compact.level import Level
from meshtide_codec.compact.map_deep_kernels import new_deep_map
from meshtide_codec.compact.map_surface_kernels import new_cell_surfaces
from meshtide_codec.compact.mirror import mirrored_cells
from meshtide_codec.compact.models import DeepModels, Models
from meshtide_codec.errors import MapConnError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.mirror import Mirror
    from meshtide_codec.entropy.codec import PayloadReader, PayloadWriter
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

PACKET = "Map&Conn"


def write_map(
    writer: PayloadWriter,
    coarse: Level,
    fine: Level,
    bits: int,
    models: Models,
    mirror: Mirror | None,
) -> None:
    """Add the Map from `coarse`, whose faces are known, to `fine` at the next depth; `models` learn from it.

    Args:
        writer: of the payload, which may hold more.
        coarse: level of depth b - 1 with faces; not all of its cells are leaves.
        fine: level of depth b, as `build_octree` made it.
        bits: depth of the finest level.
        models: states after the previous Map; they go on to the states after this one.
        mirror: the stream's mirror plane, if it has one.
    """
    occupied, leaf = _child_bits(coarse, fine)

    def write(coder: Coder, buffer: Buffer) -> Models:
        seen = models.copy()
        _run(coder, buffer, seen, coarse, bits, mirror, occupied, leaf, vertex_limit=2 * fine.vertex_count)
        return seen

    models.adopt(writer.write(write, expected_bytes=fine.vertex_count))


def read_map(
    reader: PayloadReader, coarse: Level, bits: int, models: Models, vertex_count: int, mirror: Mirror | None
) -> Level:
    """The level of the next depth, without faces, from a Map; `models` learn from it.

    Args:
        reader: of the payload, which may hold more than what `write_map` added.
        coarse: level of depth b - 1 with faces; not all of its cells are leaves.
        bits: depth of the finest level.
        models: states after the previous Map; of no use any more when the payload is damaged.
        vertex_count: finest vertices of the mesh, from the stream header.
        mirror: the stream's mirror plane, if it has one.

    Raises:
        MapConnError: the payload claims more vertices than the mesh has, or does not add up.
    """
    depth = coarse.depth + 1
    if coarse.all_leaves or depth > bits:
        raise MapConnError(f"a Map for depth {depth} is out of place: nothing is left to split", packet=PACKET)
    occupied = np.zeros(coarse.vertex_count, np.uint8)
    leaf = np.zeros(coarse.vertex_count, np.uint8)
    children = _run(
        reader.coder, reader.buffer, models, coarse, bits, mirror, occupied, leaf, vertex_limit=vertex_count
    )
    if children == map_kernels.TOO_MANY_VERTICES:
        raise MapConnError(
            f"the Map of depth {depth} claims more than the {vertex_count} vertices of the header; it is damaged",
            packet=PACKET,
        )
    fine = _level_of_children(coarse, occupied, leaf, children)
    if fine.all_leaves and fine.vertex_count != vertex_count:
        raise MapConnError(
            f"all {fine.vertex_count} cells of depth {depth} are leaves, but the header promises {vertex_count} "
            "vertices; one of them is damaged",
            packet=PACKET,
        )
    return fine


def _run(
    coder: Coder,
    buffer: Buffer,
    models: Models,
    coarse: Level,
    bits: int,
    mirror: Mirror | None,
    occupied: NDArray[np.uint8],
    leaf: NDArray[np.uint8],
    vertex_limit: int,
) -> int:
    images, axis = mirrored_cells(coarse, mirror)
    deep = None
    if isinstance(models, DeepModels):
        deep = new_deep_map(models.mixer, new_cell_surfaces(coarse.centres))
    return int(
        map_kernels.code_map(
            coder,
            buffer,
            models.contexts,
            models.weights,
            deep,
            coarse.centres,
            coarse.leaves,
            (coarse.depth - coarse.cell_depths).astype(np.uint8),
            coarse.rings,
            images,
            axis,
            occupied,
            leaf,
            coarse.depth + 1 == bits,
            vertex_limit,
        )
    )


def _child_bits(coarse: Level, fine: Level) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """For each coarse cell its children's octants as bits, and those of them that are leaves; 0 for leaves."""
    fresh = fine.cell_depths == fine.depth
    octants = (fine.cells[fresh] & 1) @ np.array([4, 2, 1], np.int32)
    bits = (1 << octants).astype(np.uint8)
    parents = fine.parents[fresh]
    occupied = np.zeros(coarse.vertex_count, np.uint8)
    leaf = np.zeros(coarse.vertex_count, np.uint8)
    np.bitwise_or.at(occupied, parents, bits)
    np.bitwise_or.at(leaf, parents, np.where(fine.leaves[fresh], bits, 0).astype(np.uint8))
    return occupied, leaf


def _level_of_children(coarse: Level, occupied: NDArray[np.uint8], leaf: NDArray[np.uint8], children: int) -> Level:
    """The level that a decoded Map describes; leaves pass on as they are."""
    cells = np.empty((children, 3), np.int32)
    cell_depths = np.empty(children, np.uint8)
    leaves = np.empty(children, np.bool_)
    parents = np.empty(children, np.int32)
    map_kernels.expand_cells(
        coarse.cells,
        coarse.cell_depths,
        coarse.leaves,
        occupied,
        leaf,
        coarse.depth + 1,
        cells,
        cell_depths,
        leaves,
        parents,
    )
    return Level(coarse.depth + 1, cells, cell_depths, leaves, parents)
