"""A hash table from cell coordinates to vertex indices, with bounded probing.

A cell is scattered by multiplying its coordinates with large primes; an entry stands at most PROBE_LIMIT places
after its home or is left out, so a crafted stream cannot make look-ups slow. Encoder and decoder insert the same
cells in the same order and so leave out the same ones. O(n) to build, O(1) to ask.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    CellTable = tuple[NDArray[np.int64], NDArray[np.int32]]

PROBE_LIMIT = 16
ABSENT = -1
_COORDINATE_BITS = 21
_SCATTER_X, _SCATTER_Y, _SCATTER_Z = 73856093, 19349663, 83492791  # primes, after Teschner et al. 2003


@kernel
def _home(x: int, y: int, z: int, size: int) -> int:
    return ((x * _SCATTER_X) ^ (y * _SCATTER_Y) ^ (z * _SCATTER_Z)) & (size - 1)


@kernel
def pack_cell(x: int, y: int, z: int) -> int:
    """One integer for a cell whose coordinates are in [0, 2^21)."""
    return (((x << _COORDINATE_BITS) | y) << _COORDINATE_BITS) | z


@kernel
def build_cell_table(cells: NDArray[np.int32], chosen: NDArray[np.uint8]) -> CellTable:
    """Table of the vertices with `chosen` set, by their `cells` (n, 3); of equal cells the first one stays."""
    count = 0
    for vertex in range(len(cells)):
        count += chosen[vertex] != 0
    size = 4
    while size < 2 * count + 2:
        size *= 2
    keys = np.zeros(size, np.int64)
    vertices = np.full(size, ABSENT, np.int32)
    for vertex in range(len(cells)):
        if chosen[vertex] == 0:
            continue
        x, y, z = int(cells[vertex, 0]), int(cells[vertex, 1]), int(cells[vertex, 2])
        key = pack_cell(x, y, z)
        place = _home(x, y, z, size)
        for _ in range(PROBE_LIMIT):
            if vertices[place] == ABSENT:
                keys[place] = key
                vertices[place] = vertex
                break
            if keys[place] == key:
                break
            place = (place + 1) & (size - 1)
    return keys, vertices


@kernel
def find_cell(table: CellTable, x: int, y: int, z: int) -> int:
    """The vertex that stands in the table for a cell with coordinates in [0, 2^21), or ABSENT."""
    keys, vertices = table
    key = pack_cell(x, y, z)
    place = _home(x, y, z, len(keys))
    for _ in range(PROBE_LIMIT):
        if vertices[place] == ABSENT:
            return ABSENT
        if keys[place] == key:
            return int(vertices[place])
        place = (place + 1) & (len(keys) - 1)
    return ABSENT
