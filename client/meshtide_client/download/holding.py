"""What a client holds of one stream: its header, and its packets from the first one on, without gaps.

`Holding` counts packets without keeping them; `PartialFile` writes them to disk, so that they outlive the process.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import ProtocolError
from meshtide_codec.stream.container import PREAMBLE_BYTES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import LevelEntry, StreamHeader


class Holding:
    """What has arrived of one stream; `header` is None until its header is there."""

    def __init__(self) -> None:
        self.header: StreamHeader | None = None
        self.header_bytes = b""
        self.count = 0
        """Packets held, from the first one on."""

    @property
    def size(self) -> int:
        """Bytes of the file so far: preamble, header and packets."""
        if self.header is None:
            return 0
        return PREAMBLE_BYTES + len(self.header_bytes) + int(self.header.packet_offsets[self.count])

    @property
    def state(self) -> LevelEntry | None:
        """The finest state that is complete, or None."""
        rows = () if self.header is None else self.header.levels
        return next((row for row in reversed(rows) if row.packet_count <= self.count), None)

    def begin(self, header: StreamHeader, header_bytes: bytes) -> None:
        """Start over with a new stream; what was held of another one is given up."""
        self.header = header
        self.header_bytes = header_bytes
        self.count = 0

    def append(self, index: int, data: bytes) -> None:
        """Take packet `index`, whose bytes have been verified.

        Raises:
            ProtocolError: it is not the next one.
        """
        if index != self.count:
            raise ProtocolError(f"packet {index} arrived where packet {self.count} was due")
        self._store(data)
        self.count += 1

    def stored_packets(self) -> Sequence[Packet]:
        """The packets that were held before this process began; returned only once."""
        return ()

    def close(self) -> None:
        """Nothing is open."""

    def summary(self, *, repeat: bool = True) -> str:  # noqa: ARG002 - for holdings that outlive the process
        """One clause that says what is held, for messages.

        Args:
            repeat: whether the same request has a chance of getting further.
        """
        row = self.state
        if row is None:
            return "no level is complete yet"
        return f"level {row.level} is complete ({row.vertices} vertices, {row.faces} faces)"

    def _store(self, data: bytes) -> None:
        """Keep the bytes of the next packet; here they are not kept."""
