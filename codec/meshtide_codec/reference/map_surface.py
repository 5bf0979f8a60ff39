"""Where the surface of a cell passes, for Maps that are coded deeply (docs/format.md, section 8.4.1)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from meshtide_codec.reference.class_tables import error_class
from meshtide_codec.reference.diff_prediction import unit_normal
from meshtide_codec.reference.diff_rows import Neighbourhood, Row
from meshtide_codec.reference.surface_fit import fit_surface, patch_of

if TYPE_CHECKING:
    from meshtide_codec.reference.octree import Level

NO_NEIGHBOUR_FITTED = 10
NO_SURFACE = 11


class CellSurfaces:
    """The surfaces of a level's cells, one after the other; cells move to the mean of their children.

    Attributes:
        fit_class: how well the neighbours' children lay on their surfaces.
    """

    def __init__(self, level: Level) -> None:
        self._level = level
        self._rows = [Row([float(c) for c in level.centre(vertex)], 0.0, 0.0) for vertex in range(len(level))]
        self._misses: dict[int, float] = {}
        self._normal = [0.0, 0.0, 0.0]
        self._height = 0.0
        self.fit_class = NO_SURFACE

    def fit(self, vertex: int) -> None:
        """Find the surface of a cell."""
        around = Neighbourhood(self._level, vertex, self._rows)
        normal = unit_normal(around)
        self._normal, self._height, self.fit_class = [0.0, 0.0, 0.0], 0.0, NO_SURFACE
        if not any(normal):
            return
        length = error = known = 0.0
        for member, (x, y, z) in zip(around.members, around.offsets, strict=True):
            length += math.sqrt(x * x + y * y + z * z)
            if member in self._misses:
                error += self._misses[member]
                known += 1.0
        patch = patch_of(self._level, self._rows, vertex)
        self._height, self._normal = fit_surface(patch, length / len(around.members), normal)
        self.fit_class = NO_NEIGHBOUR_FITTED
        if known > 0.0:
            self.fit_class = min(max(error_class(error / known) - 5, 0), NO_NEIGHBOUR_FITTED - 1)

    def over(self, octant: int) -> float:
        """How far the octant's centre lies over the surface, in half cells."""
        x, y, z = (0.5 if octant & bit else -0.5 for bit in (4, 2, 1))
        return x * self._normal[0] + y * self._normal[1] + z * self._normal[2] - self._height

    def note_children(self, vertex: int, pattern: int) -> None:
        """Move the cell to the mean of its children's centres."""
        octants = [octant for octant in range(8) if pattern >> octant & 1]
        missed = 0.0
        for octant in octants:
            missed += abs(self.over(octant))
        if self.fit_class < NO_SURFACE:
            self._misses[vertex] = missed / len(octants)
        for axis in range(3):
            total = sum(1 if octant & (4 >> axis) else -1 for octant in octants)
            self._rows[vertex].position[axis] += 0.5 * total / len(octants)
        self._rows[vertex].known = 1.0
