"""What the bytes of a stream are spent on: previews, Maps, faces, filters, Diffs, and what frames them.

A Base or Map&Conn packet holds a Map and faces as parts of one payload (`compact.reliable_coding`,
`classic.level_coding`), which are told apart here by the lengths in front of them; nothing is decoded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec.classic import options as classic_options
from meshtide_codec.stream.container import PREAMBLE_BYTES
from meshtide_codec.stream.packets import PacketKind
from meshtide_codec.stream.parts import read_number, split_parts

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from meshtide_codec.stream.header import StreamHeader
    from meshtide_codec.stream.packets import Packet

HEADER = "Header"
PREVIEW = "Preview"
CELLS = "Cells"
MAP = "Map"
CONN = "Conn"
PARAM = "Param"
DIFF = "Diff"
PERMUTATION = "Permutation"
LAYERS = (HEADER, PREVIEW, CELLS, MAP, CONN, PARAM, DIFF, PERMUTATION)
"""Layers in the order in which they are listed; Cells are the positions of a classic stream's coarsest level."""

_WHOLE = {
    PacketKind.PREVIEW: PREVIEW,
    PacketKind.PARAM: PARAM,
    PacketKind.DIFF: DIFF,
    PacketKind.PERMUTATION: PERMUTATION,
}


@dataclass(frozen=True, slots=True)
class LayerBytes:
    """Bytes of one layer of one level.

    Args:
        level: the level, None for the header.
        layer: one of `LAYERS`.
        size: bytes; lengths between parts count to the part that they precede.
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
    for packet in packets:
        rows += [LayerBytes(packet.level, layer, size) for layer, size in _of_packet(packet, header).items() if size]
    return rows


def totals(rows: Sequence[LayerBytes]) -> dict[str, int]:
    """Bytes by layer, in the order of `LAYERS`, those that are there."""
    sums = {layer: sum(row.size for row in rows if row.layer == layer) for layer in LAYERS}
    return {layer: size for layer, size in sums.items() if size}


def _of_packet(packet: Packet, header: StreamHeader) -> dict[str, int]:
    classic = header.profile == classic_options.PROFILE
    if packet.kind is PacketKind.MAP_CONN:
        return _map_and_faces(packet.payload, MAP)
    if packet.kind is PacketKind.BASE:
        return _map_and_faces(packet.payload, CELLS) if classic else _base(packet, header)
    return {_WHOLE[packet.kind]: len(packet.payload)}


def _map_and_faces(payload: bytes, first: str) -> dict[str, int]:
    faces = len(split_parts(payload, 2)[1])
    return {first: len(payload) - faces, CONN: faces}


def _base(packet: Packet, header: StreamHeader) -> dict[str, int]:
    """A compact Base: face counts, then Map and faces of each depth down to that of the coarsest level."""
    if not packet.payload:
        return {}
    depths = header.bits - packet.level
    position = 0
    for _ in range(depths):
        _, position = read_number(packet.payload, position)
    faces = sum(map(len, split_parts(packet.payload[position:], 2 * depths)[1::2]))
    return {MAP: len(packet.payload) - faces, CONN: faces}
