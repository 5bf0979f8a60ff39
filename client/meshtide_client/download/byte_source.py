"""A file that can be read from a byte on, wherever it lies: what the transports of files have in common."""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import AsyncIterator
    from contextlib import AbstractAsyncContextManager
    from pathlib import Path

PIECE = 1 << 16
"""Bytes that are read at a time from a disk."""


@dataclass(frozen=True, slots=True)
class Reading:
    """An answer to a request for bytes.

    Args:
        start: which byte of the file comes first; 0 where the request's range was passed over.
        ranged: whether the range was kept to.
        pieces: the bytes.
        size: of the whole file, if it is known.
    """

    start: int
    ranged: bool
    pieces: AsyncIterator[bytes]
    size: int | None


class ByteSource(Protocol):
    """A file."""

    name: str
    """Of the transport, for people and programs."""

    def read(self, start: int, end: int | None) -> AbstractAsyncContextManager[Reading]:
        """Bytes `start` to `end`, or to the file's end.

        Raises:
            TransferError: the bytes cannot be had now.
            ProtocolError, PeerError: what answers is something else, or it refused.
        """

    async def close(self) -> None:
        """Let go of the file."""


class LocalSource:
    """A file of this machine."""

    name = "local"

    def __init__(self, path: Path) -> None:
        self._path = path

    @asynccontextmanager
    async def read(self, start: int, end: int | None) -> AsyncIterator[Reading]:
        """See ByteSource; raises OSError if the disk has no such file."""
        size = (await asyncio.to_thread(self._path.stat)).st_size
        yield Reading(start, ranged=True, pieces=self._pieces(start, end), size=size)

    async def close(self) -> None:
        """Nothing is open between two readings."""

    async def _pieces(self, start: int, end: int | None) -> AsyncIterator[bytes]:
        def piece(position: int) -> bytes:
            with self._path.open("rb") as file:
                file.seek(position)
                return file.read(PIECE if end is None else min(PIECE, end - position))

        position = start
        while (end is None or position < end) and (data := await asyncio.to_thread(piece, position)):
            yield data
            position += len(data)
