"""From packets to meshes, level by level (Sans-I/O): the decoder that fits a stream's profile.

::

    decoder = Decoder(header)
    for packet in packets:                      # in any order; Diffs may be missing
        for update in decoder.push(packet):     # what became available or better by it
            show(decoder.mesh(update.level))
"""

from __future__ import annotations

from ctypes import byref
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec import core
from meshtide_codec.argument_types import check_type
from meshtide_codec.errors import LimitError, PacketError
from meshtide_codec.limits import Limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.order import Order, read_order
from meshtide_codec.packets import Packet, PacketKind
from meshtide_codec.quantize import dequantize
from meshtide_codec.stream.container import read_container
from meshtide_codec.stream.header import StreamHeader, parsed

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


LARGEST_DIFF = float(1 << 40)
"""Steps of any grid beyond which it makes no difference how far outside of the cube a perturbed vertex is."""


_ANY_SHARE = {"vertices_per_byte": 1 << 63, "faces_per_byte": 1 << 63}
"""Shares are held against the limits where a header is read."""


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
        only_finest: whether levels are given back, as far as that is possible, once a finer one is there and has its
            Diffs: then they are not available any more.

    Raises:
        TypeError: it is no header.
        ContainerError: a header that makes no sense.
        LimitError: a level over the limits.
    """

    def __init__(
        self,
        header: StreamHeader,
        limits: Limits | None = None,
        perturb: Callable[[int, int, NDArray[np.float64]], NDArray[np.float64]] | None = None,
        *,
        only_finest: bool = False,
    ) -> None:
        check_type("the header", header, StreamHeader, remedy="read_container returns it with the packets")
        check_type("limits", limits, Limits, type(None))
        limits = limits or Limits()
        for row in header.levels:
            limits.check_mesh(row.vertices, row.faces, level=row.level)
        self.header = header
        self._limits = limits
        self._order: Order | None = None
        self._order_packet: Packet | None = None
        self._order_error: PacketError | LimitError | None = None
        self._perturb = perturb
        self._perturbed_levels: set[int] = set()
        data = header.to_bytes()
        self._stream = parsed(data, replace(limits, header_bytes=len(data), **_ANY_SHARE))
        self._states = core.states(*header.options.trained_states)
        self._core = core.Handle("mt_decoder_free")
        limited = core.Limited.of(limits)
        core.call("mt_decoder_new", self._stream, byref(limited), self._states, byref(self._core.pointer))
        if perturb is not None:
            core.library().mt_decoder_watch_diffs(self._core)
        if only_finest:
            core.library().mt_decoder_keep_finest_only(self._core)

    def push(self, packet: Packet) -> list[LevelUpdate]:
        """Take one packet; returns the levels that became available or better by it, coarse to fine.

        Raises:
            TypeError: it is no packet.
            PacketError: the packet does not belong to this stream, came before, or is damaged; what was decoded
                before stays usable.
        """
        check_type("a packet", packet, Packet, remedy="ContainerReader.feed and read_container return packets")
        if packet.kind is PacketKind.ORDER:
            self._take_order(packet)
            return []
        payload = packet.payload
        try:
            core.call("mt_decoder_push", self._core, packet.kind, packet.level, packet.slice, payload, len(payload))
        finally:
            if self._perturb is not None:  # those that waited may be there though a later one was damaged
                self._change_diffs()
        changed = _levels(core.library().mt_decoder_changed(self._core))
        updates = [LevelUpdate(level, self.is_exact(level)) for level in changed]
        if 0 in changed and self._order is None and self._order_packet is not None:
            try:
                self._read_order(self._order_packet)
            except (PacketError, LimitError) as error:
                self._order_error = error
        return updates

    def _take_order(self, packet: Packet) -> None:
        """Read the Order packet if the faces of level 0 are there, or keep it until they are."""
        places = ((row.kind, row.level, row.slice) for row in self.header.packets)
        if (packet.kind, packet.level, packet.slice) not in places:
            raise PacketError("this stream has no such packet", level=packet.level, packet=packet.kind.label)
        if self._order_packet is not None:
            raise PacketError("it came twice", level=packet.level, packet=packet.kind.label)
        self._order_error = None
        if self.is_available(0):
            self._read_order(packet)
        else:
            self._order_packet = packet

    def _read_order(self, packet: Packet) -> None:
        """Read the Order packet; one that is damaged is forgotten, so that a right one may come."""
        self._order_packet = None
        faces = self._shown(0).copied_faces()
        known = self.header.size_bytes
        self._order = read_order(packet, faces, self.header.vertices, self._limits, known)
        self._order_packet = packet

    @property
    def order(self) -> Order | None:
        """How the input's vertices and faces stood, once its packet and the faces of level 0 are there.

        Raises:
            PacketError, LimitError: its packet came before the faces, and turned out damaged.
        """
        if self._order_error is not None:
            raise self._order_error
        return self._order

    @property
    def finest(self) -> int | None:
        """Number of the finest level that can be shown now, or None."""
        available = _levels(core.library().mt_decoder_available(self._core))
        return available[-1] if available else None

    @property
    def best(self) -> int | None:
        """Number of the level or preview that shows the mesh best now, by the distances in the header; or None.

        A preview may lie nearer to the surface than the first levels of the hierarchy, which are finer.
        """
        ranks = {row.level: row.rank for row in self.header.levels}
        exact = [level for level in ranks if self.is_exact(level)]
        return min(exact, key=lambda level: (ranks[level], level), default=self.finest)

    @property
    def map_bytes(self) -> int:
        """Bytes of the Base and Map&Conn packets so far that code vertices, within a few; faces take the others."""
        return int(core.library().mt_decoder_map_bytes(self._core))

    def is_available(self, level: int) -> bool:
        """Whether the level can be shown now."""
        return level >= 0 and bool(core.library().mt_decoder_available(self._core) >> level & 1)

    def is_exact(self, level: int) -> bool:
        """Whether the level is there, and as the encoder made it."""
        exact = level >= 0 and bool(core.library().mt_decoder_exact(self._core) >> level & 1)
        return exact and all(perturbed < level for perturbed in self._perturbed_levels)

    def mesh(self, level: int) -> Mesh:
        """The mesh of a level as far as it is known now, in the unit of the input.

        Raises:
            KeyError: the level is not available.
            PacketError: its packets make positions that are not finite, or a face twice.
        """
        shown = self._shown(level)
        return _placed(self.header, level, shown.copied_positions(), shown.copied_faces())

    def drawn_positions(self, level: int) -> NDArray[np.float64]:
        """The vertices of the same mesh, (n, 3) in finest steps.

        Raises:
            KeyError, PacketError: as for `mesh`.
        """
        return _finite(self._shown(level).copied_positions(), level)

    def _shown(self, level: int) -> core.Shown:
        """What the core draws of a level, lent until the next call."""
        if not self.is_available(level):
            raise KeyError(f"level {level} is not available yet")
        shown = core.Shown()
        core.call("mt_decoder_show", self._core, level, byref(shown))
        return shown

    def _change_diffs(self) -> None:
        """Has what `perturb` makes of the Diffs that were decoded last added in their place."""
        for number in range(core.library().mt_decoder_diff_count(self._core)):
            lent = core.Diffs()
            core.call("mt_decoder_diffs", self._core, number, byref(lent))
            changed = self._perturbed(lent.level, lent.slice, lent.copied_values())
            core.call("mt_decoder_replace_diffs", self._core, number, changed, len(changed))

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
        return np.ascontiguousarray(np.clip(changed, -LARGEST_DIFF, LARGEST_DIFF), np.float64)


def _levels(bits: int) -> list[int]:
    """The levels of a set of bits, coarse to fine."""
    return [level for level in range(bits.bit_length() - 1, -1, -1) if bits >> level & 1]


def _placed(header: StreamHeader, level: int, positions: NDArray[np.float64], faces: NDArray[np.int32]) -> Mesh:
    """The mesh of what the core has drawn, in the unit of the input."""
    with np.errstate(over="ignore", invalid="ignore"):
        vertices = dequantize(positions, header.bits, np.asarray(header.origin), header.extent)
    return Mesh(_finite(vertices, level), faces.astype(np.int64))


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
    check_type("the level", level, int)
    header, packets = read_container(data, limits)
    decoder = Decoder(header, limits, only_finest=True)
    if not 0 <= level <= header.levels[0].level:
        raise KeyError(f"the stream has levels 0..{header.levels[0].level}, not {level}")
    for packet in packets[: header.packet_count(level)]:
        if packet.kind is not PacketKind.PREVIEW or packet.level == level:  # nothing builds on a preview
            decoder.push(packet)
    shown = decoder._shown(level)  # noqa: SLF001 - of this module
    drawn = shown.copied_positions(), shown.copied_faces()
    del decoder, shown  # what the core has taken is given back before the mesh is made of it
    return _placed(header, level, *drawn)
