"""A server's session that has its stream in memory: what the shell around a session does, without waiting."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from meshtide_codec.stream.session import PacketRange, ServerSession

if TYPE_CHECKING:
    from meshtide_codec.stream.header import StreamHeader


class StreamSource(Protocol):
    """A stream that is at hand."""

    @property
    def header(self) -> StreamHeader:
        """The stream's header."""

    @property
    def header_bytes(self) -> bytes:
        """The header as it is sent."""

    def packet_part(self, index: int, start: int, end: int) -> bytes | memoryview:
        """Bytes `start` to `end` of packet `index`."""


class ServerEnd(ServerSession):
    """The server's end of one stream, which reads by itself what it has to send."""

    def __init__(self, mesh: str, source: StreamSource) -> None:
        super().__init__(mesh, source.header, source.header_bytes)
        self._source = source

    def next_frame(self) -> bytes | None:
        """The next frame to send, or None while there is nothing to send."""
        due = self.next()
        if isinstance(due, PacketRange):
            return due.frame(bytes(self._source.packet_part(due.index, due.start, due.end)))
        return due
