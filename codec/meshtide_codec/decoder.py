"""From packets to meshes, level by level (Sans-I/O): the decoder that fits a stream's profile.

::

    decoder = Decoder(header)
    for packet in packets:                      # in any order; Diffs may be missing
        for update in decoder.push(packet):     # what became available or better by it
            show(decoder.mesh(update.level))
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic import options as classic_options
from meshtide_codec.classic.decoder import ClassicDecoder
from meshtide_codec.compact import options as compact_options
from meshtide_codec.compact.decoder import CompactDecoder
from meshtide_codec.errors import ContainerError, PacketError
from meshtide_codec.limits import Limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.order import Order, read_order
from meshtide_codec.quantize import dequantize
from meshtide_codec.stream.container import read_container
from meshtide_codec.stream.packets import PacketKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from meshtide_codec.stream.header import StreamHeader
    from meshtide_codec.stream.packets import Packet


LARGEST_DIFF = float(1 << 40)
"""Steps of any grid beyond which it makes no difference how far outside of the cube a perturbed vertex is."""


@dataclass(frozen=True, slots=True)
class LevelUpdate:
    """A level that became available or better; `exact` when every Diff that it builds on is there."""

    level: int
    exact: bool


class Decoder:
    """Rebuilds the levels of one stream from its packets.

    Args:
        header: the stream's header.
        limits: what the header may claim.
        perturb: changes Diffs after they are decoded, for experiments (Balan & Taubin 2000, section 4.2): it is called
            with the level, the slice and the Diffs (n, 3) of a packet in steps of that level's grid, and returns what
            is to be added in their place, as many finite numbers, or the packet is refused. In profile compact no
            vertex leaves its leaf cell by it.

    Raises:
        ContainerError: a profile that this program does not know, or options that make no sense.
        LimitError: a level over the limits.
    """

    def __init__(
        self,
        header: StreamHeader,
        limits: Limits | None = None,
        perturb: Callable[[int, int, NDArray[np.float64]], NDArray[np.float64]] | None = None,
    ) -> None:
        limits = limits or Limits()
        for row in header.levels:
            limits.check_mesh(row.vertices, row.faces, level=row.level)
        self.header = header
        self._limits = limits
        self._order: Order | None = None
        self._order_packet: Packet | None = None
        self._perturb = perturb
        self._perturbed_levels: set[int] = set()
        hook = None if perturb is None else self._perturbed
        self._decoder: ClassicDecoder | CompactDecoder
        if header.profile == classic_options.PROFILE:
            self._decoder = ClassicDecoder(header, hook)
        elif header.profile == compact_options.PROFILE:
            self._decoder = CompactDecoder(header, limits, hook)
        else:
            raise ContainerError(f"unknown profile {header.profile!r}; a newer meshtide may read it")

    def push(self, packet: Packet) -> list[LevelUpdate]:
        """Take one packet; returns the levels that became available or better by it, coarse to fine.

        Raises:
            PacketError: the packet does not belong to this stream, came before, or is damaged; what was decoded
                before stays usable.
        """
        if packet.kind is PacketKind.ORDER and self._order_packet is None:
            self._order_packet = packet
            self._read_order()
            return []
        updates = [LevelUpdate(level, self.is_exact(level)) for level in self._decoder.push(packet)]
        if self._order is None and any(update.level == 0 for update in updates):
            self._read_order()
        return updates

    def _read_order(self) -> None:
        """Read the Order packet once both it and the faces of level 0 are there."""
        if self._order_packet is not None and self.is_available(0):
            faces = self._decoder.faces(0)
            known = self.header.size_bytes
            self._order = read_order(self._order_packet, faces, self.header.vertices, self._limits, known)

    @property
    def order(self) -> Order | None:
        """How the input's vertices and faces stood, once its packet and the faces of level 0 are there."""
        return self._order

    @property
    def finest(self) -> int | None:
        """Number of the finest level that can be shown now, or None."""
        return self._decoder.finest

    @property
    def best(self) -> int | None:
        """Number of the level or preview that shows the mesh best now, by the distances in the header; or None.

        A preview may lie nearer to the surface than the first levels of the hierarchy, which are finer.
        """
        ranks = {row.level: row.rank for row in self.header.levels}
        exact = [level for level in ranks if self.is_exact(level)]
        return min(exact, key=lambda level: (ranks[level], level), default=self._decoder.finest)

    def is_available(self, level: int) -> bool:
        """Whether the level can be shown now."""
        return self._decoder.is_available(level)

    def is_exact(self, level: int) -> bool:
        """Whether the level is there, and as the encoder made it."""
        return self._decoder.is_exact(level) and all(perturbed < level for perturbed in self._perturbed_levels)

    def mesh(self, level: int) -> Mesh:
        """The mesh of a level as far as it is known now, in the unit of the input.

        Raises:
            KeyError: the level is not available.
            PacketError: its packets make positions that are not finite.
        """
        drawn = self.drawn_positions(level)
        with np.errstate(over="ignore", invalid="ignore"):
            vertices = dequantize(drawn, self.header.bits, np.asarray(self.header.origin), self.header.extent)
        return Mesh(_finite(vertices, level), self._decoder.faces(level).astype(np.int64))

    def drawn_positions(self, level: int) -> NDArray[np.float64]:
        """The vertices of the same mesh, (n, 3) in finest steps.

        Raises:
            KeyError, PacketError: as for `mesh`.
        """
        if not self.is_available(level):
            raise KeyError(f"level {level} is not available yet")
        with np.errstate(over="ignore", invalid="ignore"):
            return _finite(self._decoder.geometry(level), level)

    def _perturbed(self, level: int, part: int, differences: NDArray[np.float64]) -> NDArray[np.float64]:
        """What `perturb` makes of the Diffs of a packet, and a note that the level is no longer as it was sent."""
        assert self._perturb is not None  # noqa: S101 - called by decoders that were given this
        changed = np.asarray(self._perturb(level, part, differences))
        if changed.shape != differences.shape or not np.isfinite(changed).all():
            raise PacketError(
                f"perturb must return {differences.shape} finite numbers", level=level, packet=PacketKind.DIFF.label
            )
        if not np.array_equal(changed, differences):
            self._perturbed_levels.add(level)
        return np.clip(changed, -LARGEST_DIFF, LARGEST_DIFF)


def _finite(positions: NDArray[np.float64], level: int) -> NDArray[np.float64]:
    if not np.isfinite(positions).all():
        raise PacketError("its positions are not finite; the stream is damaged", level=level)
    return positions


def decode(data: bytes | memoryview, level: int = 0, limits: Limits | None = None) -> Mesh:
    """The mesh of one level of a whole `.tide` file.

    Raises:
        StreamError: the file is damaged, cut off, or over the limits.
        KeyError: the stream has no such level.

    >>> from meshtide_codec.encoder import encode
    >>> triangle = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> decode(encode(triangle).to_bytes())
    Mesh(3 vertices, 1 faces)
    """
    header, packets = read_container(data, limits)
    decoder = Decoder(header, limits)
    if not 0 <= level <= header.levels[0].level:
        raise KeyError(f"the stream has levels 0..{header.levels[0].level}, not {level}")
    for packet in packets[: header.packet_count(level)]:
        decoder.push(packet)
    return decoder.mesh(level)
