"""From a mesh to a stream: quantize, encode in a profile, and describe the result in a header."""

from __future__ import annotations

import os
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.argument_types import check_type
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.distortion import DistortionMeter
from meshtide_codec.errors import OptionError
from meshtide_codec.grid import Grid
from meshtide_codec.mesh import Mesh
from meshtide_codec.order import Order, order_packet
from meshtide_codec.profile import Profile
from meshtide_codec.quantize import QuantizedMesh, quantize
from meshtide_codec.stream.container import write_container
from meshtide_codec.stream.distances import stored_distances
from meshtide_codec.stream.header import LevelEntry, StreamHeader, packet_table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from concurrent.futures import Future

    from numpy.typing import NDArray

    from meshtide_codec.packets import Packet
    from meshtide_codec.profile import Encoding
    from meshtide_codec.shown_state import ShownState

DISTANCE_SAMPLES = 4000
DISTANCE_VERTICES = 8192
"""What each state's distance is measured with: half a per cent of RMS from ten times as many samples."""


@dataclass(frozen=True)
class EncodedMesh:
    """A stream, ready to be stored or sent.

    Args:
        header: its header.
        packets: its packets, in transmission order.
        packet_bytes: the same packets as they are stored and sent.
        quantized: the mesh that its finest level restores, and what quantization did to the input.
    """

    header: StreamHeader
    packets: Sequence[Packet]
    packet_bytes: Sequence[bytes]
    quantized: QuantizedMesh

    def to_bytes(self) -> bytes:
        """The whole `.tide` file."""
        return write_container(self.header, self.packet_bytes)


def encode(
    mesh: Mesh,
    options: Profile | None = None,
    *,
    grid: Grid | None = None,
    store_order: bool = False,
    threads: int | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> EncodedMesh:
    """Encode `mesh`; the same mesh and options give the same bytes.

    Args:
        mesh: any triangle mesh, also one without faces: a set of points.
        options: `CompactOptions` or `ClassicOptions`; the compact profile's defaults when left out.
        grid: the grid to round to, where it is not to follow from the mesh alone; its step decides about B.
        store_order: whether the stream also holds the order of the input's vertices and faces, see `order`.
        threads: how many work at once, at least 1; one fewer than there are processors when left out. The bytes do
            not depend on it.
        progress: is called with the name of a stage and the fraction of it that is done.

    Raises:
        TypeError: one of them is of another type.
        MeshError, OptionError: the mesh or the options cannot be used.

    >>> from meshtide_codec.mesh import Mesh
    >>> triangle = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> encoded = encode(triangle)
    >>> encoded.header.vertices, encoded.header.faces
    (3, 1)
    """
    check_type("the mesh", mesh, Mesh, remedy="load_mesh reads one from a file, Mesh.checked makes one of arrays")
    check_type("options", options, Profile, type(None))
    check_type("the grid", grid, Grid, type(None))
    check_type("the number of threads", threads, int, type(None))
    options = options or CompactOptions()
    if threads is not None and threads < 1:
        raise OptionError(f"there must be at least one thread, not {threads}")
    workers = threads or max(1, (os.cpu_count() or 1) - 1)
    if progress is not None:
        progress("quantize", 0.0)
    if grid is None:
        quantized = quantize(mesh, options.bits)
    else:
        placed = grid.placed(mesh, options.bits)
        options = replace(options, bits=placed.bits)
        quantized = quantize(mesh, *placed)
    encoding = options.encode(quantized, progress, workers)
    if store_order:
        order = Order(quantized.permutation, mesh.faces)
        encoding.packets.append(order_packet(order, quantized.faces, len(quantized.positions)))
    return describe(encoding, quantized, progress, workers)


def describe(
    encoding: Encoding,
    quantized: QuantizedMesh,
    progress: Callable[[str, float], None] | None = None,
    threads: int = 1,
) -> EncodedMesh:
    """The stream of an encoding: its packets and the header that announces them, all distances measured."""
    table, packet_bytes = packet_table(encoding.packets)
    distances = _distances(encoding.states, quantized, threads)
    levels = []
    for done, (state, (rms, maximum)) in enumerate(zip(encoding.states, distances, strict=True)):
        if progress is not None:
            progress("distances", (done + 1) / len(encoding.states))
        levels.append(LevelEntry(state.level, state.packet_count, state.vertices, state.faces, rms, maximum))
    header = StreamHeader(
        options=encoding.header,
        bits=quantized.bits,
        origin=(float(quantized.origin[0]), float(quantized.origin[1]), float(quantized.origin[2])),
        extent=quantized.extent,
        levels=tuple(levels),
        packets=table,
    )
    return EncodedMesh(header, encoding.packets, packet_bytes, quantized)


def distance_meter(positions: NDArray[np.float64], faces: NDArray[np.int32]) -> DistortionMeter:
    """What the distances of a stream's states are measured with.

    Args:
        positions: (n, 3) of the finest mesh, in finest steps.
        faces: (m, 3) its faces.

    Raises:
        MeshError: the arrays are not a mesh.
    """
    return DistortionMeter(positions, faces, samples=DISTANCE_SAMPLES, vertex_limit=DISTANCE_VERTICES)


def _distances(states: Sequence[ShownState], quantized: QuantizedMesh, threads: int) -> Iterator[tuple[float, float]]:
    """RMS and maximum of each state as the header stores them, measured side by side; few are drawn at a time."""
    meter = distance_meter(quantized.positions.astype(np.float64), quantized.faces)
    with ThreadPoolExecutor(threads) as pool:
        measured: deque[Future[tuple[float, float]]] = deque()
        for state in states:
            if len(measured) == threads:
                yield measured.popleft().result()
            measured.append(pool.submit(_distance, meter, quantized, state.level, *state.draw()))
        while measured:
            yield measured.popleft().result()


def _distance(
    meter: DistortionMeter,
    quantized: QuantizedMesh,
    level: int,
    drawn: NDArray[np.float64],
    faces: NDArray[np.int32],
) -> tuple[float, float]:
    """Zero for the mesh itself, never zero for anything else."""
    if level == 0 and np.array_equal(drawn, quantized.positions):
        return 0.0, 0.0
    measured = meter.measure(drawn, faces)
    return stored_distances(measured.rms, measured.maximum)
