"""From a mesh to a stream: quantize, encode in a profile, and describe the result in a header."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic.encoder import ClassicEncoding
from meshtide_codec.classic.options import PROFILE, ClassicOptions
from meshtide_codec.quantize import QuantizedMesh, quantize
from meshtide_codec.stream.container import write_container
from meshtide_codec.stream.header import LevelEntry, StreamHeader, packet_table, stored_distance

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from meshtide_codec.mesh import Mesh
    from meshtide_codec.stream.packets import Packet


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
    options: ClassicOptions | None = None,
    *,
    progress: Callable[[str, float], None] | None = None,
) -> EncodedMesh:
    """Encode `mesh`; the same mesh and options give the same bytes.

    Args:
        mesh: any triangle mesh.
        options: profile and its options; the classic profile's defaults when left out.
        progress: is called with the name of a stage and the fraction of it that is done.

    Raises:
        MeshError, OptionError: the mesh or the options cannot be used.

    >>> from meshtide_codec.mesh import Mesh
    >>> triangle = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> encoded = encode(triangle)
    >>> encoded.header.vertices, encoded.header.faces, len(encoded.packets)
    (3, 1, 1)
    """
    options = options or ClassicOptions()
    if progress is not None:
        progress("quantize", 0.0)
    quantized = quantize(mesh, options.bits)
    encoding = ClassicEncoding(quantized, options, progress)
    return describe(encoding, quantized)


def describe(encoding: ClassicEncoding, quantized: QuantizedMesh) -> EncodedMesh:
    """The stream of an encoding: its packets and the header that announces them."""
    table, packet_bytes = packet_table(encoding.packets)
    diagonal = grid_diagonal(quantized.positions)
    levels = []
    for number in range(len(encoding.levels) - 1, -1, -1):
        level = encoding.levels[number]
        distances = encoding.distances(number) / diagonal
        rms = math.sqrt(float((distances * distances).mean()))
        levels.append(
            LevelEntry(
                level=number,
                packet_count=encoding.packet_counts[number],
                vertices=len(level.cells),
                faces=len(level.faces),
                rms=stored_distance(rms),
                maximum=stored_distance(float(distances.max())),
            )
        )
    header = StreamHeader(
        profile=PROFILE,
        options=encoding.header.to_options(),
        bits=quantized.bits,
        origin=(float(quantized.origin[0]), float(quantized.origin[1]), float(quantized.origin[2])),
        extent=quantized.extent,
        levels=tuple(levels),
        packets=table,
    )
    return EncodedMesh(header, encoding.packets, packet_bytes, quantized)


def grid_diagonal(positions: NDArray[np.int32]) -> float:
    """The bounding box's diagonal in finest steps; 1 for a single point, whose distances are all zero."""
    sides = (positions.max(axis=0) - positions.min(axis=0)).astype(np.float64)
    return math.sqrt(float((sides * sides).sum())) or 1.0
