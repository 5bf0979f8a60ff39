"""The compact decoder: rebuilds previews and levels from their packets, in any order, also without the Diffs.

Base and Map&Conn give the cells and faces of each level, whatever happens to the Diffs. A Diff tells more bits of the
vertices that are alone in their cells; one that is missing leaves its vertices drawn inside the cells that are known,
and the later Diffs of its slice wait for it.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from meshtide_codec.compact.diff_coder import known_positions
from meshtide_codec.compact.difference_coding import DifferenceCoder
from meshtide_codec.compact.display_filter import drawn_positions
from meshtide_codec.compact.effort import DeepLayers
from meshtide_codec.compact.level import root_level
from meshtide_codec.compact.options import CompactHeader
from meshtide_codec.compact.perturbation import SliceShifts, shifted_positions
from meshtide_codec.compact.previewing import decode_preview
from meshtide_codec.compact.reliable_coding import NO_FACES, ReliableCoder
from meshtide_codec.errors import ContainerError, MapConnError, PacketError
from meshtide_codec.stream.packets import Packet, PacketKind

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.compact.diff_coder import SliceState
    from meshtide_codec.compact.level import Level
    from meshtide_codec.compact.perturbation import Perturb
    from meshtide_codec.compact.previewing import GridPreview
    from meshtide_codec.limits import Limits
    from meshtide_codec.stream.header import StreamHeader


class CompactDecoder:
    """Decoder of one compact stream; see `meshtide_codec.decoder.Decoder` for its use.

    Args:
        header: the stream's header.
        limits: what the packets may claim.
        perturb: changes Diffs after they are decoded, see `Decoder`; vertices stay in their leaf cells.
    """

    def __init__(self, header: StreamHeader, limits: Limits, perturb: Perturb | None = None) -> None:
        self._limits = limits
        self._bits = header.bits
        self._options = CompactHeader.from_header(header)
        self._coarsest = header.bits - self._options.base_depth
        self._face_counts = {row.level: row.faces for row in header.levels}
        self._vertex_counts = {row.level: row.vertices for row in header.levels}
        for entry in header.packets:
            if entry.kind is PacketKind.MAP_CONN and entry.level not in self._face_counts:
                raise ContainerError(f"damaged stream header: its level table lacks level {entry.level}")
        self._reliable = ReliableCoder(header.bits, header.vertices, self._options.mirror, deep=self._options.deep)
        self._levels: list[Level] = []
        self._waiting: dict[int, bytes] = {}
        self._previews: dict[int, GridPreview] = {}
        slices = self._options.slices
        root = root_level(header.vertices)
        deep = DeepLayers.DIFFS in self._options.deep
        mirror = self._options.mirror
        self._coders = [DifferenceCoder(root, slices, i, mirror, deep=deep) for i in range(len(slices))]
        self._diffs: list[dict[int, bytes]] = [{} for _ in self._coders]
        self._reached = Counter({0: len(self._coders)})  # how many slices have come to which depth
        self._told = 0  # Diffs that have told something of a vertex
        self._shifts = [] if perturb is None else [SliceShifts(self._bits, i, perturb) for i in range(len(slices))]
        self._taken: set[tuple[PacketKind, int, int]] = set()

    def push(self, packet: Packet) -> list[int]:
        """Take one packet; returns the levels, coarse to fine, that became available or better by it.

        Raises:
            PacketError: the packet does not belong to this stream, or came before, or its payload is damaged.
            LimitError: a level over the limits.
        """
        available, told, least = set(self._available()), self._told, min(self._reached)
        try:
            self._take(packet)
        except PacketError as error:
            level = packet.level if error.level is None else error.level
            raise type(error)(error.message, level=level, packet=packet.kind.label, offset=error.offset) from error
        better = self._told > told or min(self._reached) > least
        changed = packet.level if better and packet.kind is PacketKind.DIFF else -1
        return [
            number
            for number in self._available()
            if number not in available or (number <= changed and number <= self._coarsest)
        ]

    @property
    def finest(self) -> int | None:
        """Number of the finest level that can be shown, or None."""
        available = self._available()
        return available[-1] if available else None

    def is_available(self, number: int) -> bool:
        """Whether the level or preview of that number can be shown."""
        return number in self._available()

    def is_exact(self, number: int) -> bool:
        """Whether the level is as the encoder made it: every Diff that comes with it or before it is there."""
        if number in self._previews:
            return True
        sent = [depth for depth in self._options.diff_depths if depth <= self._bits - number]
        return self.is_available(number) and min(self._reached) >= max(sent, default=0)

    def faces(self, number: int) -> NDArray[np.int32]:
        """Faces (m, 3) of an available level."""
        if number in self._previews:
            return self._previews[number].faces
        faces = self._level(number).faces
        return NO_FACES if faces is None else faces

    def geometry(self, number: int) -> NDArray[np.float64]:
        """Positions (n, 3) of an available level as they are to be drawn, in finest steps."""
        if number in self._previews:
            return self._previews[number].drawn(self._bits)
        level = self._level(number)
        middles, depths = known_positions(level, self._states(), self._options.slices)
        strength = self._options.strengths[level.depth - self._options.base_depth]
        drawn = drawn_positions(level, middles, depths, self._bits, strength)
        if not self._shifts:
            return drawn
        return shifted_positions(drawn, level, self._states(), self._options.slices, self._shifts)

    def _available(self) -> list[int]:
        """What can be shown, coarsest first: previews, then levels."""
        levels = range(self._coarsest, self._bits - len(self._levels), -1) if self._levels else range(0)
        return [*sorted(self._previews, reverse=True), *levels]

    def _level(self, number: int) -> Level:
        return self._levels[self._bits - number]

    def _states(self) -> list[SliceState]:
        return [coder.state for coder in self._coders]

    def _take(self, packet: Packet) -> None:
        key = (packet.kind, packet.level, packet.slice)
        if key in self._taken:
            raise PacketError("it came twice")
        depth = self._bits - packet.level
        if packet.kind is PacketKind.BASE and packet.slice == 0 and packet.level == self._coarsest:
            self._levels = self._reliable.decode_base(packet.payload, self._options.base_depth, self._limits)
            self._decode_waiting()
        elif packet.kind is PacketKind.MAP_CONN and packet.slice == 0 and packet.level in self._face_counts:
            if packet.level >= self._coarsest:
                raise PacketError("this stream has no such packet")
            self._waiting[depth] = packet.payload
            self._decode_waiting()
        elif packet.kind is PacketKind.DIFF and depth in self._options.diff_depths and packet.slice < len(self._coders):
            self._diffs[packet.slice][depth] = packet.payload
            self._decode_diffs(packet.slice)
        elif packet.kind is PacketKind.PREVIEW and packet.slice == 0 and self._preview_place(packet.level) >= 0:
            self._previews[packet.level] = self._decoded_preview(packet)
        else:
            raise PacketError("this stream has no such packet")
        self._taken.add(key)

    def _preview_place(self, number: int) -> int:
        """The place of the preview that stands as level `number`, or a negative one."""
        place = self._coarsest + self._options.previews - number
        return place if place < self._options.previews else -1

    def _decoded_preview(self, packet: Packet) -> GridPreview:
        if packet.level not in self._vertex_counts:
            raise PacketError("the header has no state of this level")
        return decode_preview(packet.payload, self._vertex_counts[packet.level], self._bits, self._limits)

    def _decode_waiting(self) -> None:
        """Decode levels as far as Map&Conn packets have come, and what Diffs have waited for them."""
        while self._levels and len(self._levels) <= self._bits:
            coarse = self._levels[-1]
            depth = coarse.depth + 1
            if coarse.all_leaves:
                if depth in self._waiting:
                    raise MapConnError("nothing is left to split; the stream is damaged", level=self._bits - depth)
                self._levels.append(coarse.deepened())
                continue
            if depth not in self._waiting:
                break
            try:
                fine = self._reliable.decode_map_conn(
                    self._waiting.pop(depth), coarse, self._face_counts[self._bits - depth]
                )
            except MapConnError as error:  # the packet may be an earlier one, which had to wait
                raise MapConnError(error.message, level=self._bits - depth, offset=error.offset) from error
            self._levels.append(fine)
        for index in range(len(self._coders)):
            self._decode_diffs(index)

    def _decode_diffs(self, index: int) -> None:
        """Decode the Diffs of a slice as far as they and their levels have come."""
        coder, waiting = self._coders[index], self._diffs[index]
        if not waiting:
            return
        for depth in self._options.diff_depths:
            if depth <= coder.depth:
                continue
            if depth not in waiting or len(self._levels) <= depth:
                return
            before = coder.depth
            coder.decode(waiting.pop(depth), self._levels[before + 1 : depth + 1])
            self._note(before, coder)
            if self._shifts:
                self._shifts[index].go_on(coder.state)

    def _note(self, before: int, coder: DifferenceCoder) -> None:
        """Count a slice among those of the depth that it has reached, without a look at all the others."""
        if coder.depth == before:
            return
        self._told += len(coder.state.cells) > 0
        self._reached[coder.depth] += 1
        self._reached[before] -= 1
        if self._reached[before] == 0:
            del self._reached[before]
