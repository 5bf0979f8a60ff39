"""The ladder of levels of detail that practice uses instead of a progressive codec: simplified meshes, sent in turn.

Each level is simplified by quadric errors (Garland, Heckbert 1997) and is a Draco file of its own; whoever climbs the
ladder downloads all of them. So that no weakness of one program is held against the idea, each level is the best that
meshtide's own simplification and the library fast-simplification make of it, at any of its settings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.simplification import Simplifier
from meshtide_codec.extras import extra
from meshtide_codec.quantize import dequantize
from meshtide_codec.report.states import StreamState, measured_state
from meshtide_lab.comparison.draco import draco_decoded, draco_encoded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_codec.distortion import DistortionMeter
    from meshtide_codec.quantize import QuantizedMesh

    Surface = tuple[NDArray[np.float64], NDArray[np.integer]]

LIBRARY = "fast_simplification"
RATIOS = (256, 64, 16, 4)
"""Vertices of the mesh, divided by those of each level; the last level is the mesh itself."""
AGGRESSIVENESS = (7, 5, 4, 3, 2)
"""Settings of fast-simplification, from fast to careful; a careful one may give up before it is done."""
MOST_OF_TARGET = 1.1
"""A candidate with more than so many times the vertices that were asked for does not count as that level."""
FEWEST_VERTICES = 4
FEWEST_BITS = 6
FITTED_RMS = 1.1
"""With steps of its own, a level takes the fewest bits that leave its distance within so many times the best."""


class LadderLevels:
    """The simplified meshes of one ladder, chosen once and coded at will.

    Args:
        quantized: the mesh.
        meter: of its grid.

    Raises:
        MeshError: Draco cannot take a level.
        MissingLibraryError: a library is not installed.
    """

    def __init__(self, quantized: QuantizedMesh, meter: DistortionMeter) -> None:
        self._quantized = quantized
        self._meter = meter
        ratios = [ratio for ratio in RATIOS if len(quantized.positions) // ratio >= FEWEST_VERTICES]
        self._levels = [(ratio, self._best(surfaces)) for ratio, surfaces in _simplified(quantized, ratios)]

    def climbed(self, whole: bytes, *, fitted_steps: bool) -> list[StreamState]:
        """The states of the ladder, its bytes added up level by level.

        Args:
            whole: the Draco file of the mesh itself, the last level.
            fitted_steps: whether coarse levels may take fewer bits per coordinate than the mesh itself.
        """
        states = []
        size = 0
        for ratio, surface in self._levels:
            state = self._fitted(surface) if fitted_steps else self._coded(surface, self._quantized.bits)
            size += state.size
            states.append(StreamState(f"1/{ratio}", size, state.vertices, state.faces, state.rms, state.maximum))
        return [*states, self._measured("1", size + len(whole), whole)]

    def _best(self, surfaces: Sequence[Surface]) -> Surface:
        """The surface that is closest to the mesh after coding."""
        return min(surfaces, key=lambda surface: self._coded(surface, self._quantized.bits).rms)

    def _fitted(self, surface: Surface) -> StreamState:
        finest = self._coded(surface, self._quantized.bits)
        for bits in range(FEWEST_BITS, self._quantized.bits):
            state = self._coded(surface, bits)
            if state.rms <= FITTED_RMS * finest.rms:
                return state
        return finest

    def _coded(self, surface: Surface, bits: int) -> StreamState:
        data = draco_encoded(*surface, bits)
        return self._measured("", len(data), data)

    def _measured(self, name: str, size: int, data: bytes) -> StreamState:
        return measured_state(name, size, *draco_decoded(data), self._quantized, self._meter)


def _simplified(quantized: QuantizedMesh, ratios: Sequence[int]) -> list[tuple[int, list[Surface]]]:
    """For each ratio, coarsest first, the candidates for its level, in the unit of the input."""
    if not ratios:
        return []
    library = extra(LIBRARY)
    count = len(quantized.positions)
    own = Simplifier(quantized.positions, quantized.faces, quantized.bits, count // ratios[-1])
    vertices, faces = quantized.positions.astype(np.float64), quantized.faces
    levels = []
    for ratio in reversed(ratios):
        target = count // ratio
        candidates: list[Surface] = [own.reduced_to(target)]
        for aggressiveness in AGGRESSIVENESS:
            fewer = library.simplify(vertices, faces, target_count=len(faces) // ratio, agg=aggressiveness)
            candidates.append((np.asarray(fewer[0], np.float64), np.asarray(fewer[1], np.int64)))
        drawable = [candidate for candidate in candidates if len(candidate[1])]
        small = [candidate for candidate in drawable if len(candidate[0]) <= MOST_OF_TARGET * target]
        chosen = small or sorted(drawable, key=lambda candidate: len(candidate[0]))[:1]
        if chosen:
            levels.append((ratio, [(_in_input_unit(points, quantized), corners) for points, corners in chosen]))
    return levels[::-1]


def _in_input_unit(points: NDArray[np.float64], quantized: QuantizedMesh) -> NDArray[np.float64]:
    return dequantize(points, quantized.bits, quantized.origin, quantized.extent)
