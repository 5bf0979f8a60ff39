"""Whether a `.tide` file of a stranger is what it says: it is decoded to its end, and its header held against that.

Checksums tell damage, not lies. A header may name a profile or options that nobody knows, promise levels that its
packets do not make, counts that they do not have, or a preview that is nearer to the mesh than its farthest point; a
client would find out late, with a part of the mesh on the screen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.decoder import Decoder
from meshtide_codec.errors import ContainerError
from meshtide_codec.stream.container import read_container

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_codec.limits import Limits
    from meshtide_codec.mesh import Mesh
    from meshtide_codec.stream.header import LevelEntry

STAGE = "check the stream"


def check_stream(data: bytes, limits: Limits, progress: Callable[[str, float], None]) -> Mesh:
    """Decode all of a stream; returns its finest level.

    Args:
        data: the whole `.tide` file.
        limits: what it may hold.
        progress: is told how far it is.

    Raises:
        StreamError: it is damaged, over the limits, or not what its header claims.
    """
    header, packets = read_container(data, limits)
    decoder = Decoder(header, limits)
    last = {row.level: row for row in header.levels}
    pushed = 0
    for row in header.levels:
        if row.maximum < row.rms:
            raise _false(row, f"a largest distance of {row.maximum:g} and a mean one of {row.rms:g}, which is larger")
        for packet in packets[pushed : row.packet_count]:
            decoder.push(packet)
        pushed = row.packet_count
        progress(STAGE, pushed / len(packets))
        if not decoder.is_available(row.level):
            raise _false(row, "it, and they do not make it")
        if row is last[row.level] and not decoder.is_exact(row.level):
            raise _false(row, "all of it, and a part is missing")
        _check_mesh(row, decoder.mesh(row.level))
    for packet in packets[pushed:]:
        decoder.push(packet)
    finest = header.levels[-1]
    if finest.rms or finest.maximum:
        raise _false(finest, f"a distance of {finest.maximum:g} from itself")
    return decoder.mesh(finest.level)


def _check_mesh(row: LevelEntry, mesh: Mesh) -> None:
    made = (len(mesh.vertices), len(mesh.faces))
    if made != (row.vertices, row.faces):
        what = f"{row.vertices} vertices and {row.faces} faces, and they make {made[0]} and {made[1]}"
        raise _false(row, what)


def _false(row: LevelEntry, what: str) -> ContainerError:
    return ContainerError(f"the header claims of level {row.level}, with {row.packet_count} packets, {what}")
