"""The events of a `.tide` file that is read from where it lies: a thin shell that moves bytes into a FileSession."""

from __future__ import annotations

import asyncio
import time
from contextlib import aclosing
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from meshtide_client.byte_source import ByteSource, LocalSource
from meshtide_client.tide_address import Address, TideAddress
from meshtide_codec.errors import OptionError, ProtocolError, TransferError

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable, Sequence

    from meshtide_client.byte_source import Reading
    from meshtide_client.file_session import FileSession
    from meshtide_client.transport import Link
    from meshtide_codec.stream.session import Event

TransportName = Literal["websocket", "http", "download", "local", "s3"]
TransportChoice = Literal["auto", "websocket", "http", "download"]
CHOICES: tuple[TransportChoice, ...] = ("auto", "websocket", "http", "download")


def transports_for(address: Address, choice: str) -> Sequence[TransportName]:
    """The transports to try, one after the other.

    Raises:
        OptionError: there is no such transport, or not for this address.
    """
    if choice not in CHOICES:
        raise OptionError(f"there is no transport {choice!r}; choose one of {', '.join(CHOICES)}")
    possible: tuple[TransportName, ...] = ("websocket", "http", "download")
    if isinstance(address, TideAddress):
        possible = {"web": ("http", "download"), "s3": ("s3",), "local": ("local",)}[address.kind]  # type: ignore[assignment]
    if choice == "auto":
        return possible
    if choice not in possible:
        raise OptionError(f"{address} cannot be read by {choice}; there is {', '.join(possible)}")
    return [name for name in possible if name == choice]


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
        from meshtide_client.s3_source import S3Source  # noqa: PLC0415 - an extra

        return S3Source(address.location, link.timeout, link.ca_file)
    # The token is for meshtide servers; other people's web servers must not see it.
    return _web(address.location, str(address), link.without_token(), name, local=address.is_loopback)


def _web(url: str, shown: str, link: Link, name: TransportName, *, local: bool) -> ByteSource:
    from meshtide_client.web_source import WebSource  # noqa: PLC0415 - heavy

    return WebSource(url, shown, link, ranges=name == "http", local=local)


async def receive_file(
    source: ByteSource, session: FileSession, take: Callable[[Event], None], shown: str, link: Link
) -> AsyncGenerator[Event, None]:
    """The events of `session` as the bytes of `source` arrive; reading ends with the last one that is wanted.

    Args:
        source: the file.
        session: what is wanted of it.
        take: is called with each event as soon as it is there.
        shown: the file's address, for messages.
        link: its rate.

    Raises:
        TransferError: the connection was lost.
        ProtocolError, PeerError: what answers is something else, or it refused.
        StreamError: the file is damaged, cut off, or over the limits.
        Exception: whatever `take` raises.
    """
    pace = _Pace(link.rate)
    while not session.finished:
        session.skip()
        start, end = session.wanted()
        if start >= end:  # all that is wanted is held
            for event in session.feed(b""):
                take(event)
                yield event
            session.check()
            continue
        async with source.read(start, end) as reading:
            if not reading.ranged and start > 0:
                raise TransferError(f"{shown} has changed while it was read, or no longer answers in ranges")
            async with aclosing(_fed(reading, session, pace, end)) as fed:
                async for event in fed:
                    take(event)
                    yield event
            if not session.finished and (session.position < end or not reading.ranged):
                _check_end(session, reading, shown)


async def _fed(reading: Reading, session: FileSession, pace: _Pace, end: int) -> AsyncGenerator[Event, None]:
    """Feed the session from one answer until it, or what was asked for, is there."""
    async for piece in reading.pieces:
        data = piece
        if reading.ranged and session.position + len(data) > end:
            raise ProtocolError("more bytes came than were asked for")
        await pace.take(len(data))
        for event in session.feed(data):
            yield event
        session.check()
        if session.finished:
            return


def _check_end(session: FileSession, reading: Reading, shown: str) -> None:
    """The answer has ended: with the file, or too early."""
    if reading.size is not None and session.position < reading.size:
        raise TransferError(f"{shown} ended after {session.position} of {reading.size} bytes")
    session.end(session.position)


class _Pace:
    """Takes no more than so many bytes a second."""

    def __init__(self, rate: float | None) -> None:
        self._rate = rate
        self._started = time.monotonic()
        self._bytes = 0

    async def take(self, size: int) -> None:
        """Wait until `size` more bytes are due."""
        if self._rate is not None:
            self._bytes += size
            await asyncio.sleep(max(self._started + self._bytes / self._rate - time.monotonic(), 0.0))
