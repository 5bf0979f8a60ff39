"""What the bytes of a stream are spent on: previews, Maps, faces, filters, Diffs, and what frames them.

A Base or Map&Conn packet holds a Map (in a classic stream cells, or how vertices split) and faces, range-coded in one
go. So it is decoded, and counted to the byte in which one goes over into the other, give or take a few.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec.classic.options import ClassicHeader
from meshtide_codec.decoder import Decoder
from meshtide_codec.packets import PacketKind
from meshtide_codec.stream.container import PREAMBLE_BYTES

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import StreamHeader

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
        size: bytes.
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
    decoder = Decoder(header)
    for packet in packets:
        size, before = len(packet.payload), decoder.map_bytes
        if packet.kind in _WHOLE:
            sizes = {_WHOLE[packet.kind]: size}
        else:
            decoder.push(packet)
            cells = packet.kind is PacketKind.BASE and isinstance(header.options, ClassicHeader)
            maps = min(decoder.map_bytes - before, size)
            sizes = {CELLS if cells else MAP: maps, CONN: size - maps}
        rows += [LayerBytes(packet.level, layer, size) for layer, size in sizes.items() if size]
    return rows


def totals(rows: Sequence[LayerBytes]) -> dict[str, int]:
    """Bytes by layer, in the order of `LAYERS`, those that are there."""
    sums = {layer: sum(row.size for row in rows if row.layer == layer) for layer in LAYERS}
    return {layer: size for layer, size in sums.items() if size}
