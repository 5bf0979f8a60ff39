"""What the packets of a stream cost: bytes and bits per vertex, by kind and by level.

Everything here is read from the header, so it costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from meshtide_codec.stream.container import PREAMBLE_BYTES

if TYPE_CHECKING:
    from meshtide_codec.stream.header import StreamHeader


def bytes_by_kind(header: StreamHeader) -> dict[str, int]:
    """Bytes of all packets of each kind, framing included, by the kind's name."""
    totals: dict[str, int] = {}
    for entry in header.packets:
        totals[entry.kind.label] = totals.get(entry.kind.label, 0) + entry.length
    return totals


def bytes_by_level(header: StreamHeader) -> dict[int, dict[str, int]]:
    """The same for each level, coarsest first."""
    totals: dict[int, dict[str, int]] = {row.level: {} for row in header.levels}
    for entry in header.packets:
        kinds = totals.setdefault(entry.level, {})
        kinds[entry.kind.label] = kinds.get(entry.kind.label, 0) + entry.length
    return totals


def stream_report(header: StreamHeader, header_length: int) -> dict[str, Any]:
    """All that a header holds, as plain values that can become JSON.

    Args:
        header: of the stream.
        header_length: its length in bytes.
    """
    file_bytes = PREAMBLE_BYTES + header_length + int(header.packet_offsets[-1])
    by_level = bytes_by_level(header)
    return {
        "profile": header.profile,
        "effort": header.options.effort,
        "options": header.options.plain(),
        "bits": header.bits,
        "origin": list(header.origin),
        "extent": header.extent,
        "vertices": header.vertices,
        "faces": header.faces,
        "bytes": file_bytes,
        "bits_per_vertex": 8 * file_bytes / header.vertices,
        "header_bytes": PREAMBLE_BYTES + header_length,
        "packets": len(header.packets),
        "bytes_by_kind": bytes_by_kind(header),
        "bits_per_vertex_by_kind": {kind: 8 * size / header.vertices for kind, size in bytes_by_kind(header).items()},
        "levels": [
            {
                "level": row.level,
                "vertices": row.vertices,
                "faces": row.faces,
                "packets": row.packet_count,
                "cumulative_bytes": PREAMBLE_BYTES + header_length + header.level_bytes(row),
                "bytes_by_kind": by_level[row.level],
                "rms": row.rms,
                "maximum": row.maximum,
            }
            for row in header.levels
        ],
    }
