"""What the bytes of a stream are spent on: previews, Maps, faces, filters, Diffs, and what frames them.

A Base or Map&Conn packet holds a Map and faces. In a classic stream they are parts of a payload, told apart by the
length in front of them (`classic.level_coding`). In a compact stream they are range-coded in one go
(`compact.reliable_coding`), so they are decoded, and counted to the byte in which one goes over into the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec.classic import options as classic_options
from meshtide_codec.compact.options import CompactHeader
from meshtide_codec.compact.reliable_coding import ReliableCoder
from meshtide_codec.limits import Limits
from meshtide_codec.stream.container import PREAMBLE_BYTES
from meshtide_codec.stream.packets import PacketKind
from meshtide_codec.stream.parts import split_parts

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from meshtide_codec.compact.level import Level
    from meshtide_codec.stream.header import StreamHeader
    from meshtide_codec.stream.packets import Packet

HEADER = "Header"
PREVIEW = "Preview"
CELLS = "Cells"
MAP = "Map"
CONN = "Conn"
PARAM = "Param"
DIFF = "Diff"
ORDER = "Order"
LAYERS = (HEADER, PREVIEW, CELLS, MAP, CONN, PARAM, DIFF, ORDER)
"""Layers in the order in which they are listed; Cells are the positions of a classic stream's coarsest level."""

_WHOLE = {
    PacketKind.PREVIEW: PREVIEW,
    PacketKind.PARAM: PARAM,
    PacketKind.DIFF: DIFF,
    PacketKind.ORDER: ORDER,
}


@dataclass(frozen=True, slots=True)
class LayerBytes:
    """Bytes of one layer of one level.

    Args:
        level: the level, None for the header.
        layer: one of `LAYERS`.
        size: bytes; lengths in front of parts count to the first of them.
    """

    level: int | None
    layer: str
    size: int


def layer_bytes(header: StreamHeader, packets: Iterable[Packet]) -> list[LayerBytes]:
    """All bytes of the file of a stream, each counted once, in transmission order.

    Args:
        header: of the stream.
        packets: all of them, as the encoder made them.
    """
    rows = [LayerBytes(None, HEADER, PREAMBLE_BYTES + len(header.to_bytes()))]
    split = _classic_parts if header.profile == classic_options.PROFILE else _CompactParts(header)
    for packet in packets:
        sizes = {_WHOLE[packet.kind]: len(packet.payload)} if packet.kind in _WHOLE else split(packet)
        rows += [LayerBytes(packet.level, layer, size) for layer, size in sizes.items() if size]
    return rows


def totals(rows: Sequence[LayerBytes]) -> dict[str, int]:
    """Bytes by layer, in the order of `LAYERS`, those that are there."""
    sums = {layer: sum(row.size for row in rows if row.layer == layer) for layer in LAYERS}
    return {layer: size for layer, size in sums.items() if size}


def _classic_parts(packet: Packet) -> dict[str, int]:
    faces = len(split_parts(packet.payload, 2)[1])
    return {CELLS if packet.kind is PacketKind.BASE else MAP: len(packet.payload) - faces, CONN: faces}


class _CompactParts:
    """Maps and faces of the Base and Map&Conn packets of a compact stream, which come one after the other."""

    def __init__(self, header: StreamHeader) -> None:
        self._header = header
        options = CompactHeader.from_header(header)
        self._coder = ReliableCoder(header.bits, header.vertices, options.mirror, deep=options.deep)
        self._coarse: Level | None = None

    def __call__(self, packet: Packet) -> dict[str, int]:
        before = self._coder.map_bytes
        depth = self._header.bits - packet.level
        if self._coarse is None:
            self._coarse = self._coder.decode_base(packet.payload, depth, Limits())[-1]
        else:
            faces = self._header.entry(packet.level).faces
            self._coarse = self._coder.decode_map_conn(packet.payload, self._coarse, faces)
        maps = self._coder.map_bytes - before
        return {MAP: maps, CONN: len(packet.payload) - maps}
