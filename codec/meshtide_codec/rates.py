"""What the packets of a stream cost: bytes and bits per vertex, by kind and by level.

Everything here is read from the header, so it costs nothing and compiles nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from meshtide_codec.compact.effort import Effort
from meshtide_codec.stream.container import PREAMBLE_BYTES

if TYPE_CHECKING:
    from meshtide_codec.stream.header import StreamHeader

_DEEPEST = 20


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


def effort_of(header: StreamHeader) -> Effort | None:
    """The effort at which a stream was encoded: high if any layer is coded deeply; None: its profile knows none."""
    if header.profile != "compact":
        return None
    return Effort.HIGH if header.options.get("e") else Effort.DEFAULT


def stream_report(header: StreamHeader, header_length: int) -> dict[str, Any]:
    """All that a header tells, as plain values that can become JSON.

    Args:
        header: of the stream.
        header_length: its length in bytes.
    """
    file_bytes = PREAMBLE_BYTES + header_length + int(header.packet_offsets[-1])
    by_level = bytes_by_level(header)
    return {
        "profile": header.profile,
        "effort": effort_of(header),
        "options": _plain(header.options),
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


def _plain(value: object, depth: int = 0) -> Any:  # noqa: ANN401 - anything may stand in a header
    """A value as JSON can hold it: bytes become lists of numbers, numbers that are none become null.

    What lies deeper than any encoder puts it is told by its type.
    """
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    if isinstance(value, bytes):
        return list(value)
    if isinstance(value, Mapping) and depth < _DEEPEST:
        return {str(name): _plain(item, depth + 1) for name, item in value.items()}
    if isinstance(value, list | tuple) and depth < _DEEPEST:
        return [_plain(item, depth + 1) for item in value]
    return type(value).__name__
