"""A `.tide` file that is read from where it lies: a thin shell that moves bytes into a FileSession."""

from __future__ import annotations

from contextlib import AsyncExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_client.connection.tide_address import Address, TideAddress
from meshtide_client.download.byte_source import ByteSource, LocalSource
from meshtide_client.download.pace import Pace
from meshtide_codec.errors import ProtocolError, TransferError

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_client.connection.link import Link
    from meshtide_client.download.byte_source import Reading
    from meshtide_client.download.file_session import FileSession
    from meshtide_client.download.transport import TransportName
    from meshtide_codec.stream.session import Event


class FileTransport:
    """The events of a session as the bytes of a file arrive; reading ends with the last one that is wanted.

    Args:
        source: the file.
        session: what is wanted of it.
        take: is called with each event as soon as it is there.
        shown: the file's address, for messages.
        rate: bytes a second that are taken, None for no bound.
    """

    def __init__(
        self,
        source: ByteSource,
        session: FileSession,
        take: Callable[[Event], None],
        shown: str,
        rate: float | None = None,
    ) -> None:
        self._source = source
        self._session = session
        self._take = take
        self._shown = shown
        self._pace = Pace(rate)
        self._reading: Reading | None = None
        self._end = 0
        self._open = AsyncExitStack()
        self.connected = False

    @property
    def name(self) -> str:
        """See Transport; a web server that knows no ranges makes a plain download of them."""
        return self._source.name

    @property
    def received_bytes(self) -> int:
        """See Transport."""
        return self._session.received_bytes

    async def next_events(self) -> list[Event] | None:
        """See Transport."""
        self._session.check()
        while not self._session.finished:
            events = await self._events()
            for event in events:
                self._take(event)
            if events:
                self.connected = True
                return events
        return None

    async def aclose(self) -> None:
        """See Transport."""
        await self._open.aclose()
        await self._source.close()

    async def _events(self) -> list[Event]:
        """What the next piece of the file completes: often nothing."""
        session = self._session
        if self._reading is None:
            session.skip()
            start, self._end = session.wanted()
            if start >= self._end:  # all that is wanted is held
                return session.feed(b"")
            self._reading = await self._open.enter_async_context(self._source.read(start, self._end))
            if not self._reading.ranged and start > 0:
                raise TransferError(f"{self._shown} has changed while it was read, or no longer answers in ranges")
        reading = self._reading
        piece = await anext(reading.pieces, None)
        if piece is None:
            if session.position < self._end or not reading.ranged:
                self._check_end(reading)
            self._reading = None
            await self._open.aclose()
            return []
        if reading.ranged and session.position + len(piece) > self._end:
            raise ProtocolError("more bytes came than were asked for")
        await self._pace.take(len(piece))
        return session.feed(piece)

    def _check_end(self, reading: Reading) -> None:
        """The answer has ended: with the file, or too early."""
        position = self._session.position
        if reading.size is not None and position < reading.size:
            raise TransferError(f"{self._shown} ended after {position} of {reading.size} bytes")
        self._session.end(position)


def open_source(address: Address, name: TransportName, link: Link) -> ByteSource:
    """The file of `address`.

    Raises:
        OptionError: an extra is missing.
    """
    if not isinstance(address, TideAddress):
        return _web(address.file_url, f"{address}.tide", link, name, local=address.server.is_loopback)
    if address.kind == "local":
        return LocalSource(Path(address.location))
    if address.kind == "s3":
        from meshtide_client.download.s3_source import S3Source  # noqa: PLC0415 - an extra

        return S3Source(address.location, link.timeout, link.ca_file)
    # The token is for meshtide servers; other people's web servers must not see it.
    return _web(address.location, str(address), link.without_token(), name, local=address.is_loopback)


def _web(url: str, shown: str, link: Link, name: TransportName, *, local: bool) -> ByteSource:
    from meshtide_client.download.web_source import WebSource  # noqa: PLC0415 - heavy

    return WebSource(url, shown, link, ranges=name == "http", local=local)
