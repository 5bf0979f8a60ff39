"""The classic encoder: the basic and the variable length algorithm (paper, sections 3.1 and 3.2).

From the coarsest level on, each finer one is predicted from what the decoder has: extension (eq. 11), then a filter
whose coefficients are fitted to this level (eqs. 12, 13). Where the level's Diff is sent, the true geometry is what
the next level extends; where it is not, the prediction is. Cost: O(n) per level plus the fit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic.hierarchy import (
    HierarchyLevel,
    cell_centres,
    containing_cells,
    hierarchy_of,
    within_cube,
)
from meshtide_codec.classic.level_coding import LevelEncoder, encode_param
from meshtide_codec.classic.options import ClassicHeader, ClassicOptions
from meshtide_codec.filters import coefficient_count, predict
from meshtide_codec.fit import fit
from meshtide_codec.graph import build_adjacency
from meshtide_codec.packets import Packet, PacketKind
from meshtide_codec.shown_state import ShownState

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from meshtide_codec.quantize import QuantizedMesh


class ClassicEncoding:
    """A mesh encoded in the classic profile.

    Args:
        quantized: the mesh.
        options: how to encode it.
        progress: called with a stage and the fraction done.

    Attributes:
        header: what the decoder has to know.
        levels: the hierarchy, level 0 first.
        packets: in transmission order.
        geometry: per level, (n, 3) float64 in finest steps: what a decoder shows.
        predictions: per level but the coarsest, (n, 3) float64 in finest steps: what the filter gives before any Diff.
        differences: per level that sends a Diff, (n, 3) int64 in steps of that level.
        states: what can be shown after how many packets, in transmission order.
    """

    def __init__(
        self,
        quantized: QuantizedMesh,
        options: ClassicOptions,
        progress: Callable[[str, float], None] | None = None,
    ) -> None:
        self._report = progress or (lambda _stage, _fraction: None)
        self._report("hierarchy", 0.0)
        self._bits = quantized.bits
        self.levels: list[HierarchyLevel] = hierarchy_of(quantized, options)
        self.header = ClassicHeader(
            shifts=tuple(level.shift for level in self.levels),
            filter=options.filter,
            levels_with_diff=options.levels_with_diff(len(self.levels)),
        )
        self._encoder = LevelEncoder()
        self.packets: list[Packet] = []
        self.geometry: dict[int, NDArray[np.float64]] = {}
        self.predictions: dict[int, NDArray[np.float64]] = {}
        self.differences: dict[int, NDArray[np.int64]] = {}
        self.states: list[ShownState] = []
        self._encode_coarsest()
        for number in range(len(self.levels) - 2, -1, -1):
            self._encode_level(number)
        self._report("levels", 1.0)

    def _encode_coarsest(self) -> None:
        number = len(self.levels) - 1
        coarsest = self.levels[number]
        self._send(
            PacketKind.BASE, number, self._encoder.base(coarsest.cells, coarsest.faces, self._bits - coarsest.shift)
        )
        self._finish_level(number, cell_centres(coarsest.cells, coarsest.shift))

    def _encode_level(self, number: int) -> None:
        level = self.levels[number]
        assert level.parents is not None  # noqa: S101 - only the coarsest level has no map
        self._send(PacketKind.MAP_CONN, number, self._encoder.map_conn(level.parents, level.faces))
        true = cell_centres(level.cells, level.shift)
        adjacency = build_adjacency(level.faces, len(level.cells))
        extension = self.geometry[number + 1][level.parents]
        coefficients = np.zeros((3, 0), np.float32)
        if coefficient_count(self.header.filter):
            coefficients = fit(adjacency, extension, true, self.header.filter)
            self._send(PacketKind.PARAM, number, encode_param(coefficients))
        prediction = within_cube(predict(adjacency, extension, self.header.filter, coefficients), self._bits)
        self.predictions[number] = prediction
        if number in self.header.levels_with_diff:
            differences = level.cells.astype(np.int64) - containing_cells(prediction, level.shift, self._bits)
            self.differences[number] = differences
            self._send(PacketKind.DIFF, number, self._encoder.diff(differences))
            self._finish_level(number, true)
        else:
            self._finish_level(number, prediction)
        self._report("levels", len(level.cells) / len(self.levels[0].cells))

    def _send(self, kind: PacketKind, level: int, payload: bytes) -> None:
        self.packets.append(Packet(kind, level, 0, payload))

    def _finish_level(self, number: int, geometry: NDArray[np.float64]) -> None:
        self.geometry[number] = geometry
        faces = self.levels[number].faces
        self.states.append(ShownState(number, len(self.packets), len(geometry), len(faces), lambda: (geometry, faces)))
