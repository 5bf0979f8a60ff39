"""What the Diff coder expects of a vertex: means, plane, experts, mirror image (docs/format.md, section 8.5)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from meshtide_codec.reference.class_tables import error_class
from meshtide_codec.reference.diff_experts import across_expert, midpoint_expert, ring_expert

if TYPE_CHECKING:
    from collections.abc import Iterable

    from meshtide_codec.reference.diff_rows import Neighbourhood, Row


class Prediction:
    """All predicted offsets of a vertex, and the classes that its decisions share.

    Attributes:
        mean: of the ring, filtered.
        smoothed: the same, drawn towards the middle of the cell.
        normal: unit normal of the ring, or zeros.
        plane: `smoothed`, moved along the normal to where `mean` is.
        axes: from the normal's smallest component to its largest.
        below, level, above: for each axis how many members lie at offset -1, 0, +1.
        error_class: half octaves of the ring's errors.
        known_class: quarters of the ring that are known.
        ring, midpoint, across: the experts.
        mirrored: where the mirror image lies.
        mirror_state: what is known of it, 0 without one.
    """

    def __init__(self, around: Neighbourhood, rows: list[Row]) -> None:
        self._count_neighbours(around, rows)
        self._set_means(around, rows)
        self.normal = unit_normal(around)
        self._fit_plane()
        self.ring = ring_expert(around)
        self.midpoint = midpoint_expert(around)
        self.across = across_expert(around, rows)
        self.mirrored = [0.0, 0.0, 0.0]
        self.mirror_state = 0

    def _count_neighbours(self, around: Neighbourhood, rows: list[Row]) -> None:
        columns = [[offset[axis] for offset in around.offsets] for axis in range(3)]
        self.below = [column.count(-1.0) for column in columns]
        self.level = [column.count(0.0) for column in columns]
        self.above = [column.count(1.0) for column in columns]
        self.error_class, self.known_class = 23, 0
        count = len(around.members)
        if count:
            error = _total(rows[member].error for member in around.members)
            known = _total(rows[member].known for member in around.members)
            self.error_class = error_class((error + 0.5 * around.own.error) / (count + 0.5))
            self.known_class = 4 * int(known) // (count + 1)

    def _set_means(self, around: Neighbourhood, rows: list[Row]) -> None:
        share = 1.0 / len(around.members) if around.members else 0.0
        self.mean, self.smoothed = [], []
        for axis in range(3):
            mean = _total(offset[axis] for offset in around.offsets) * share
            spread = _total(rows[member].laplacian[axis] for member in around.members) * share
            self.smoothed.append(0.3 * mean - 0.15 * spread + 0.35 * around.own.laplacian[axis])
            self.mean.append(mean - 0.7 * spread)

    def _fit_plane(self) -> None:
        along = (self.mean[0] - self.smoothed[0]) * self.normal[0]
        along += (self.mean[1] - self.smoothed[1]) * self.normal[1]
        along += (self.mean[2] - self.smoothed[2]) * self.normal[2]
        self.plane = [self.smoothed[axis] + along * self.normal[axis] for axis in range(3)]
        self.axes = sorted(range(3), key=lambda axis: abs(self.normal[axis]))


def _total(values: Iterable[float]) -> float:
    total = 0.0
    for value in values:
        total += value
    return total


def unit_normal(around: Neighbourhood) -> list[float]:
    """The sum of the cross products of consecutive offsets, made one long."""
    offsets = around.offsets
    x = y = z = 0.0
    if len(offsets) > 2:  # two offsets span nothing around a vertex
        before = offsets[-1] if around.ring.closed else offsets[0]
        for offset in offsets if around.ring.closed else offsets[1:]:
            x += before[1] * offset[2] - before[2] * offset[1]
            y += before[2] * offset[0] - before[0] * offset[2]
            z += before[0] * offset[1] - before[1] * offset[0]
            before = offset
        square = x * x + y * y + z * z
        if square > 0.0:
            scale = 1.0 / math.sqrt(square)
            x, y, z = x * scale, y * scale, z * scale
    return [x, y, z]
