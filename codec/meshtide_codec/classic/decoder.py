"""The classic decoder: rebuilds each level from its packets, also when Diffs are missing, late or perturbed.

Connectivity decodes from Base and Map&Conn alone. Geometry is extension, filter, and the Diff where it is there; a
Diff that is missing counts as zero, and finer levels extend what was reconstructed (paper, section 4). So levels are
rebuilt when they are asked for, from the packets that have come by then, and kept until a packet changes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic.hierarchy import cell_centres, containing_cells, within_cube
from meshtide_codec.classic.level_coding import decode_base, decode_diff, decode_map_conn, decode_param
from meshtide_codec.classic.options import ClassicHeader
from meshtide_codec.errors import ContainerError, MapConnError, PacketError
from meshtide_codec.filters import coefficient_count, predict
from meshtide_codec.graph import build_adjacency
from meshtide_codec.stream.packets import Packet, PacketKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from meshtide_codec.graph import Adjacency
    from meshtide_codec.stream.header import StreamHeader


@dataclass
class _Level:
    """What is known of one level."""

    vertices: int
    faces: int
    map_conn: bytes | None = None
    parents: NDArray[np.int32] | None = None
    connectivity: NDArray[np.int32] | None = None
    adjacency: Adjacency | None = None
    coefficients: NDArray[np.float32] | None = None
    differences: NDArray[np.int64] | NDArray[np.float64] | None = None
    geometry: NDArray[np.float64] | None = None


class ClassicDecoder:
    """Decoder of one classic stream; see `meshtide_codec.decoder.Decoder` for its use."""

    def __init__(
        self,
        header: StreamHeader,
        perturb: Callable[[int, int, NDArray[np.float64]], NDArray[np.float64]] | None = None,
    ) -> None:
        self._perturb = perturb
        self._options = ClassicHeader.from_options(header.options, header.bits)
        self._bits = header.bits
        self._coefficients = coefficient_count(self._options.filter)
        count = len(self._options.shifts)
        sizes = {row.level: (row.vertices, row.faces) for row in header.levels}
        if set(sizes) != set(range(count)) or len(header.levels) != count:
            raise ContainerError(f"damaged stream header: its level table does not name levels 0..{count - 1} once")
        self._levels = [_Level(*sizes[number]) for number in range(count)]
        for number, (fine, coarse) in enumerate(zip(self._levels, self._levels[1:], strict=False)):
            if fine.vertices < coarse.vertices:
                raise ContainerError(f"damaged stream header: level {number} has fewer vertices than the coarser one")

    def push(self, packet: Packet) -> list[int]:
        """Take one packet; returns the levels, coarse to fine, that became available or better by it.

        Raises:
            PacketError: the packet does not belong to this stream, or came before, or its payload is damaged.
        """
        before = self._available()
        try:
            self._take(packet)
        except PacketError as error:
            level = packet.level if error.level is None else error.level
            raise type(error)(error.message, level=level, packet=packet.kind.label, offset=error.offset) from error
        changed = packet.level if packet.kind is PacketKind.DIFF else -1
        return [number for number in self._available() if number not in before or number <= changed]

    @property
    def finest(self) -> int | None:
        """Number of the finest level that can be shown, or None."""
        available = self._available()
        return available[-1] if available else None

    def is_available(self, number: int) -> bool:
        """Whether the level can be shown."""
        return number in self._available()

    def is_exact(self, number: int) -> bool:
        """Whether the level is as the encoder made it: every Diff that was sent down to it is there."""
        return number in self._available() and all(
            self._levels[other].differences is not None for other in self._options.levels_with_diff if other >= number
        )

    def faces(self, number: int) -> NDArray[np.int32]:
        """Faces (m, 3) of an available level."""
        connectivity = self._levels[number].connectivity
        assert connectivity is not None  # noqa: S101 - callers ask for available levels
        return connectivity

    def geometry(self, number: int) -> NDArray[np.float64]:
        """Positions (n, 3) of an available level, in finest steps."""
        level = self._levels[number]
        if level.geometry is None:
            level.geometry = self._reconstruct(number)
        return level.geometry

    def _available(self) -> range:
        """The levels that can be shown, coarsest first: connectivity and coefficients are there down to them."""
        coarsest = len(self._levels) - 1
        end = coarsest
        while end >= 0:
            level = self._levels[end]
            predictable = end == coarsest or self._coefficients == 0 or level.coefficients is not None
            if level.connectivity is None or not predictable:
                break
            end -= 1
        return range(coarsest, end, -1)

    def _take(self, packet: Packet) -> None:
        """Store what `packet` brings, and decode what it completes."""
        coarsest = len(self._levels) - 1
        if packet.slice != 0 or packet.level > coarsest:
            raise PacketError("this stream has no such packet")
        level = self._levels[packet.level]
        if packet.kind is PacketKind.BASE and packet.level == coarsest:
            self._refuse_second(level.geometry)
            cells, level.connectivity = decode_base(
                packet.payload, level.vertices, level.faces, self._bits - self._options.shifts[coarsest]
            )
            level.geometry = cell_centres(cells, self._options.shifts[coarsest])
            self._decode_waiting(coarsest - 1)
        elif packet.kind is PacketKind.MAP_CONN and packet.level < coarsest:
            self._refuse_second(level.map_conn)
            level.map_conn = packet.payload
            self._decode_waiting(packet.level)
        elif packet.kind is PacketKind.PARAM and packet.level < coarsest and self._coefficients:
            self._refuse_second(level.coefficients)
            level.coefficients = decode_param(packet.payload, self._options.filter)
        elif packet.kind is PacketKind.DIFF and packet.level in self._options.levels_with_diff:
            self._refuse_second(level.differences)
            differences = decode_diff(packet.payload, level.vertices)
            level.differences = (
                differences if self._perturb is None else self._perturb(packet.level, 0, differences.astype(np.float64))
            )
            self._forget_geometry(packet.level)
        else:
            raise PacketError("this stream has no such packet")

    @staticmethod
    def _refuse_second(known: object) -> None:
        if known is not None:
            raise PacketError("it came twice")

    def _decode_waiting(self, number: int) -> None:
        """Decode connectivity from level `number` on as far as Map&Conn packets have come."""
        while number >= 0:
            level, coarser = self._levels[number], self._levels[number + 1]
            if level.map_conn is None or coarser.connectivity is None:
                return
            try:
                level.parents, level.connectivity = decode_map_conn(
                    level.map_conn, level.vertices, level.faces, coarser.connectivity, coarser.vertices
                )
            except MapConnError as error:  # the packet may be an earlier one, which had to wait
                raise MapConnError(error.message, level=number, offset=error.offset) from error
            number -= 1

    def _forget_geometry(self, number: int) -> None:
        """Level `number` has changed, and with it all finer ones."""
        for level in self._levels[: number + 1]:
            level.geometry = None

    def _reconstruct(self, number: int) -> NDArray[np.float64]:
        level = self._levels[number]
        assert level.parents is not None  # noqa: S101 - an available level that is not the coarsest has its map
        assert level.connectivity is not None  # noqa: S101 - the same
        extension = self.geometry(number + 1)[level.parents]
        if level.adjacency is None:
            level.adjacency = build_adjacency(level.connectivity, level.vertices)
        coefficients = np.zeros((3, 0), np.float32) if level.coefficients is None else level.coefficients
        prediction = within_cube(predict(level.adjacency, extension, self._options.filter, coefficients), self._bits)
        if level.differences is None:
            return prediction
        shift = self._options.shifts[number]
        return cell_centres(containing_cells(prediction, shift, self._bits) + level.differences, shift)
