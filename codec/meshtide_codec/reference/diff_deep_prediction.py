"""What the Diff coder expects of a vertex besides, at effort high (docs/format.md, section 8.5.1)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from meshtide_codec.reference.class_tables import error_class
from meshtide_codec.reference.diff_experts import pairs_expert
from meshtide_codec.reference.diff_prediction import Prediction
from meshtide_codec.reference.surface_fit import fit_surface, patch_of

if TYPE_CHECKING:
    from meshtide_codec.reference.diff_rows import Neighbourhood, Row
    from meshtide_codec.reference.octree import Level

NO_SURFACE = 23


class DeepPrediction(Prediction):
    """All predicted offsets and classes at effort high.

    Attributes:
        pairs: the expert of any two members.
        surface: unit normal of the quadratic surface, or zeros.
        height: of the surface over the vertex, along that normal.
        quadric: `smoothed`, moved along the surface's normal onto it.
        quadric_class: half octaves of the surface's errors at the neighbours.
        far_below, far_above: for each axis how many of the patch lie at offset -1, +1.
        valence: members of the ring, at most 15.
        age: depths since the vertex became a leaf, less 1, at most 7.
    """

    def __init__(
        self,
        level: Level,
        vertex: int,
        around: Neighbourhood,
        rows: list[Row],
        surface_errors: dict[int, float],
    ) -> None:
        super().__init__(around, rows)
        self.pairs = pairs_expert(around)
        patch = patch_of(level, rows, vertex)
        columns = [[offset[axis] for offset, _ in patch] for axis in range(3)]
        self.far_below = [column.count(-1.0) for column in columns]
        self.far_above = [column.count(1.0) for column in columns]
        self.valence = min(len(around.members), 15)
        self.age = min(level.depth - level.cell_depths[vertex], 8) - 1
        self.surface = [0.0, 0.0, 0.0]
        self.height = 0.0
        self.quadric_class = NO_SURFACE
        if any(component != 0.0 for component in self.normal):
            length = 0.0
            error, weight = 0.5 * 0.7 * around.own.error, 0.5
            for member, (x, y, z) in zip(around.members, around.offsets, strict=True):
                length += math.sqrt(x * x + y * y + z * z)
                if member in surface_errors:
                    error += surface_errors[member]
                    weight += 1.0
            self.height, self.surface = fit_surface(patch, length / len(around.members), self.normal)
            self.quadric_class = min(error_class(error / weight), NO_SURFACE - 1)
        along = self.height
        for axis in range(3):
            along -= self.surface[axis] * self.smoothed[axis]
        self.quadric = [self.smoothed[axis] + along * self.surface[axis] for axis in range(3)]
