"""What the Diff coder knows of the vertices while it walks over them (docs/format.md, section 8.5)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from meshtide_codec.reference.octree import RING_LIMIT

if TYPE_CHECKING:
    from meshtide_codec.reference.octree import Cell, Level

NEW_ERROR = 1.0
FOREIGN_ERROR = 4.0
ERROR_GROWTH = 1.4


@dataclass
class Row:
    """A vertex: position in half cells, whether it is known at this depth, how badly it was predicted lately."""

    position: list[float]
    known: float
    error: float
    laplacian: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])


def rows_of(level: Level, owners: list[int], cells: list[Cell], errors: list[float]) -> list[Row]:
    """Rows of all vertices; `owners` stand in the middle of their `cells` of the depth before."""
    rows = []
    for vertex in range(len(level)):
        known = level.cell_depths[vertex] == level.depth
        centre = [float(coordinate) for coordinate in level.centre(vertex)]
        rows.append(Row(centre, float(known), NEW_ERROR if known else FOREIGN_ERROR))
    for owner, cell, error in zip(owners, cells, errors, strict=True):
        rows[owner].position = [float(4 * coordinate + 2) for coordinate in cell]
        rows[owner].error = error * ERROR_GROWTH
    return rows


def set_laplacians(level: Level, rows: list[Row], vertices: range) -> None:
    """The mean of the ring minus the position, for the vertices of a slice, before any of them is moved."""
    for vertex in vertices:
        members = level.rings[vertex].members
        if members:
            share = 1.0 / len(members)
            for axis in range(3):
                total = 0.0
                for member in members:
                    total += rows[member].position[axis]
                rows[vertex].laplacian[axis] = total * share - rows[vertex].position[axis]


class Neighbourhood:
    """The ring of a vertex, at most RING_LIMIT of its members, as offsets from it.

    Attributes:
        ring: the ring itself.
        members: the members that are looked at.
        offsets: where they are.
        unknown: 1 for each that is not known yet, else 0.
        askable: how many of them the experts look at: none where the ring is longer.
    """

    def __init__(self, level: Level, vertex: int, rows: list[Row]) -> None:
        self.ring = level.rings[vertex]
        self.members = self.ring.members[:RING_LIMIT]
        self.own = rows[vertex]
        self.offsets = [
            [rows[member].position[axis] - self.own.position[axis] for axis in range(3)] for member in self.members
        ]
        self.unknown = [1.0 - rows[member].known for member in self.members]
        self.askable = len(self.members) if len(self.ring.members) <= RING_LIMIT else 0
