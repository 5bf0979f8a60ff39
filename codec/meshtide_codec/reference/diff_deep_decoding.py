"""The decisions of a Diff at effort high (docs/format.md, section 8.5.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.diff_deep_contexts import deep_contexts_for, neurons_for, numbers_for
from meshtide_codec.reference.diff_deep_prediction import DeepPrediction
from meshtide_codec.reference.diff_rows import Neighbourhood

if TYPE_CHECKING:
    from meshtide_codec.reference.deep_mixing import DeepNeurons
    from meshtide_codec.reference.diff_decoding import Images
    from meshtide_codec.reference.diff_rows import Row
    from meshtide_codec.reference.octree import Level
    from meshtide_codec.reference.range_decoder import RangeDecoder


class DeepBitPlane:
    """Three decisions for a vertex, mixed deeply."""

    def __init__(
        self, decoder: RangeDecoder, level: Level, rows: list[Row], images: Images, neurons: DeepNeurons
    ) -> None:
        self._decoder = decoder
        self._level = level
        self._rows = rows
        self._images = images
        self._neurons = neurons
        self._surface_errors: dict[int, float] = {}

    def decode(self, vertex: int) -> list[float]:
        """By how many half cells the vertex moves along each axis: -1 or +1."""
        row = self._rows[vertex]
        around = Neighbourhood(self._level, vertex, self._rows)
        predicted = DeepPrediction(self._level, vertex, around, self._rows, self._surface_errors)
        self._images.look(vertex, predicted)
        moves = [0.0, 0.0, 0.0]
        carried = carried_surface = error = 0.0
        for order, axis in enumerate(predicted.axes):
            normal, slant = predicted.normal[axis], predicted.surface[axis]
            plane = predicted.plane[axis] - carried * normal / (normal * normal + 0.15)
            quadric = predicted.quadric[axis] - carried_surface * slant / (slant * slant + 0.15)
            bit = self._neurons.bit(
                self._decoder,
                neurons_for(predicted, order, axis),
                final=order * 8 + predicted.age,
                correction=predicted.quadric_class,
                heard=deep_contexts_for(predicted, axis, plane, quadric, self._images.axis),
                numbers=numbers_for(predicted, axis, plane, quadric),
            )
            moves[axis] = 2.0 * bit - 1.0
            error += abs(moves[axis] - predicted.smoothed[axis])
            carried += (moves[axis] - predicted.plane[axis]) * normal
            carried_surface += (moves[axis] - predicted.quadric[axis]) * slant
        missed = -predicted.height
        for axis in range(3):
            row.position[axis] += moves[axis]
            missed += moves[axis] * predicted.surface[axis]
        row.known = 1.0
        row.error = error / 3.0
        self._surface_errors[vertex] = abs(missed)
        self._images.compare(vertex, predicted, moves)
        return moves
