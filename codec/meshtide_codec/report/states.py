"""Rate-distortion curves, state by state: what a receiver can show after how many bytes, and how far it is off.

Nothing is interpolated: the bytes for a distance are those of the first state that is at least so close.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.decoder import Decoder
from meshtide_codec.quantize import grid_steps
from meshtide_codec.stream.container import PREAMBLE_BYTES

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from meshtide_codec.distortion import DistortionMeter
    from meshtide_codec.encoder import EncodedMesh
    from meshtide_codec.quantize import QuantizedMesh

TARGETS = (1e-2, 3e-3, 1e-3, 4e-4, 1.2e-4)
"""Root mean square distances to reach, as fractions of the diagonal: from a silhouette to a whole screen's pixels."""

SAME = 1e-12
"""Distances below this are what is left of zero when coordinates go through float64 and back."""


@dataclass(frozen=True, slots=True)
class StreamState:
    """A mesh that can be shown.

    Args:
        name: such as "level 3" or "1/64".
        size: bytes that have to be there, from the first on.
        vertices: its vertices.
        faces: its faces.
        rms: root mean square distance from the quantized input, as a fraction of its bounding box's diagonal.
        maximum: largest distance, in the same unit.
    """

    name: str
    size: int
    vertices: int
    faces: int
    rms: float
    maximum: float


def bytes_for(states: Sequence[StreamState], target: float) -> int | None:
    """Bytes of the first state whose RMS distance is at most `target`, None if there is none.

    >>> curve = [StreamState("coarse", 100, 4, 4, 1e-2, 2e-2), StreamState("fine", 900, 99, 200, 1e-4, 1e-3)]
    >>> bytes_for(curve, 1e-3), bytes_for(curve, 1e-5)
    (900, None)
    """
    return next((state.size for state in states if state.rms <= target), None)


def improving(states: Iterable[StreamState]) -> list[StreamState]:
    """The states that are closer than all before them: what is shown by a client that keeps the best it has.

    >>> preview, base = StreamState("preview", 100, 40, 80, 1e-3, 1e-2), StreamState("level 9", 150, 20, 40, 1e-2, 5e-2)
    >>> [state.name for state in improving([preview, base, StreamState("level 0", 900, 99, 200, 0.0, 0.0)])]
    ['preview', 'level 0']
    """
    shown: list[StreamState] = []
    for state in states:
        if not shown or state.rms < shown[-1].rms:
            shown.append(state)
    return shown


def grid_points(vertices: NDArray[np.float64], quantized: QuantizedMesh) -> NDArray[np.float64]:
    """Positions (n, 3) in the input's unit, in steps of the grid of `quantized`."""
    if quantized.extent == 0.0:
        return np.zeros(vertices.shape)
    return (vertices - quantized.origin) / quantized.extent * grid_steps(quantized.bits)


def measured_state(
    name: str,
    size: int,
    vertices: NDArray[np.float64],
    faces: NDArray[np.integer],
    quantized: QuantizedMesh,
    meter: DistortionMeter,
) -> StreamState:
    """The state of a mesh (n, 3), (m, 3) in the input's unit; `meter` measures against the grid of `quantized`."""
    distance = meter.measure(grid_points(vertices, quantized), faces)
    rms, maximum = (0.0 if value < SAME else value for value in (distance.rms, distance.maximum))
    return StreamState(name, size, len(vertices), len(faces), rms, maximum)


def stream_states(encoded: EncodedMesh, meter: DistortionMeter) -> list[StreamState]:
    """The states of a stream, each decoded from the packets that it needs and measured."""
    header = encoded.header
    before = PREAMBLE_BYTES + len(header.to_bytes())
    decoder = Decoder(header)
    pushed = 0
    states = []
    for row in header.levels:
        for packet in encoded.packets[pushed : row.packet_count]:
            decoder.push(packet)
        pushed = max(pushed, row.packet_count)
        mesh = decoder.mesh(row.level)
        size = before + header.level_bytes(row)
        name = f"level {row.level}"
        states.append(measured_state(name, size, mesh.vertices, mesh.faces, encoded.quantized, meter))
    return states
