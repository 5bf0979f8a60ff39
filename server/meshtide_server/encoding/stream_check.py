"""Whether a `.tide` file of a stranger is what it says: it is decoded to its end, and its header held against that.

Checksums reveal damage, not lies. A header may name a profile or options that nobody knows, promise levels that its
packets do not make, counts that they do not have, or distances from the finest mesh that are not theirs, by which
clients choose what they show and where they stop; they would find out late, or never. So every state is measured as the
encoder does it, and what is claimed may differ by what the rounding of stored distances and other samples make of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import distance_meter
from meshtide_codec.errors import ContainerError
from meshtide_codec.stream.container import read_container
from meshtide_codec.stream.distances import LARGEST, stored_distances

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from meshtide_codec.distortion import Distortion, DistortionMeter
    from meshtide_codec.limits import Limits
    from meshtide_codec.mesh import Mesh
    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import LevelEntry, StreamHeader

STAGE = "check the stream"
SAMPLING = 0.1
"""How far a right root mean square may be from the measured one, as a fraction: other programs take other samples."""
SAMPLING_OF_MAXIMUM = 0.25
"""The same of the largest distance, which depends on few samples."""
NOTHING = 1e-9
"""A distance that is none: of a coarser mesh of the same surface, measured in doubles and stored as the least code."""


def check_stream(data: bytes, limits: Limits, progress: Callable[[str, float], None]) -> Mesh:
    """Decode all of a stream; returns its finest level.

    It is decoded twice: what the states are measured against is the last of them, and to keep the others until then
    would take more memory than an encoder has.

    Args:
        data: the whole `.tide` file.
        limits: what it may hold.
        progress: called with the fraction done.

    Raises:
        StreamError: it is damaged, over the limits, or not what its header claims.
    """
    header, packets = read_container(data, limits)
    finest = header.levels[-1]
    if finest.rms or finest.maximum:
        raise _false(finest, f"a distance of {finest.maximum:g} from itself")
    mesh, positions = _decoded(header, packets, limits, lambda part: progress(STAGE, part / 2))
    meter = distance_meter(positions, mesh.faces.astype(np.int32))
    _check_states(header, packets, limits, meter, lambda part: progress(STAGE, (1 + part) / 2))
    return mesh


def _decoded(
    header: StreamHeader, packets: Sequence[Packet], limits: Limits, progress: Callable[[float], None]
) -> tuple[Mesh, NDArray[np.float64]]:
    """The finest mesh, and its positions in finest steps."""
    decoder = Decoder(header, limits)
    pushed = 0
    for row in (*header.levels, None):
        count = len(packets) if row is None else row.packet_count
        for packet in packets[pushed:count]:
            decoder.push(packet)
        pushed = count
        progress(pushed / len(packets))
        if row is not None and not decoder.is_available(row.level):
            raise _false(row, "it, and they do not make it")
    return decoder.mesh(0), decoder.drawn_positions(0)


def _check_states(
    header: StreamHeader,
    packets: Sequence[Packet],
    limits: Limits,
    meter: DistortionMeter,
    progress: Callable[[float], None],
) -> None:
    """Hold every state against what the header says of it."""
    decoder = Decoder(header, limits)
    last = {row.level: row for row in header.levels}
    pushed = 0
    for done, row in enumerate(header.levels, 1):
        for packet in packets[pushed : row.packet_count]:
            decoder.push(packet)
        pushed = row.packet_count
        if row is last[row.level] and not decoder.is_exact(row.level):
            raise _false(row, "all of it, and a part is missing")
        mesh = decoder.mesh(row.level)
        made = (len(mesh.vertices), len(mesh.faces))
        if made != (row.vertices, row.faces):
            what = f"{row.vertices} vertices and {row.faces} faces, and they make {made[0]} and {made[1]}"
            raise _false(row, what)
        if row is not header.levels[-1]:
            _check_distances(row, meter.measure(decoder.drawn_positions(row.level), mesh.faces))
        progress(done / len(header.levels))


def _check_distances(row: LevelEntry, measured: Distortion) -> None:
    """Raise unless the distances of a state are what an encoder may have stored."""
    rms, maximum = measured.rms, measured.maximum
    stored = (
        stored_distances(_more(rms, SAMPLING), 0.0)[0],
        stored_distances(row.rms, _more(maximum, SAMPLING_OF_MAXIMUM))[1],
    )
    claims = (
        ("a mean distance", row.rms, rms, SAMPLING, stored[0]),
        ("a largest distance", row.maximum, maximum, SAMPLING_OF_MAXIMUM, stored[1]),
    )
    for name, claimed, found, slack, largest in claims:
        least = min(found * (1.0 - slack), LARGEST) - NOTHING
        if not least <= claimed <= max(largest, _more(found, slack), NOTHING):
            raise _false(row, f"{name} from the finest mesh of {claimed:g} of its diagonal, and it is {found:g}")


def _more(distance: float, slack: float) -> float:
    return distance * (1.0 + slack)


def _false(row: LevelEntry, what: str) -> ContainerError:
    return ContainerError(f"the header claims of level {row.level}, with {row.packet_count} packets, {what}")
