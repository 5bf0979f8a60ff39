"""Reading ranges of bytes that lie somewhere: in a file, in memory, or in a store that is asked for each of them.

Files are read range by range rather than through a memory map: a mapped file that somebody cuts short kills the
process that reads it, a short read is an error of that one reader.
"""

from __future__ import annotations

import asyncio
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from meshtide_codec.errors import StreamError

if TYPE_CHECKING:
    from pathlib import Path

    from meshtide_server.store.protocol import Store


@dataclass(frozen=True, slots=True)
class FileIdentity:
    """What distinguishes one state of a file from another without reading it."""

    device: int
    inode: int
    size: int
    modified: int

    @classmethod
    def of(cls, status: os.stat_result) -> FileIdentity:
        """The identity that `status` describes."""
        return cls(status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)


class OpenFile:
    """A file open for reading ranges of it, by one reader."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor: int | None = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))

    @property
    def identity(self) -> FileIdentity:
        """The identity of the file that was opened, whatever its name stands for by now."""
        return FileIdentity.of(os.fstat(self._opened()))

    def at_hand(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`, read here and now: a part of a stream takes less than a change of threads.

        Raises:
            StreamError: the file has become shorter.
            OSError: it cannot be read.
        """
        parts: list[bytes] = []
        position = start
        while position < end:
            os.lseek(self._opened(), position, os.SEEK_SET)
            part = os.read(self._opened(), end - position)
            if not part:
                raise StreamError(
                    f"{self._path} ended while it was read, {end - position} bytes short; it was changed in place",
                    offset=position,
                )
            parts.append(part)
            position += len(part)
        return parts[0] if len(parts) == 1 else b"".join(parts)

    async def read(self, start: int, end: int) -> bytes:
        """The same, read in a thread, for a disk may be slow."""
        return await asyncio.to_thread(self.at_hand, start, end)

    def close(self) -> None:
        """Close the file."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _opened(self) -> int:
        if self._descriptor is None:
            raise ValueError(f"{self._path} is closed")
        return self._descriptor


class FileReader:
    """A file, in the state that it had when this object was made.

    Raises:
        OSError: it cannot be opened.
    """

    is_near = True

    def __init__(self, path: Path) -> None:
        self.path = path
        file = OpenFile(path)
        self.identity = file.identity
        file.close()

    @property
    def size(self) -> int:
        """Its size in bytes."""
        return self.identity.size

    def open(self) -> OpenFile:
        """Open the file.

        Raises:
            StreamError: it is gone, or another one by now.
        """
        try:
            file = OpenFile(self.path)
        except OSError as error:
            raise StreamError(f"{self.path.name} can no longer be opened: {error.strerror or error}") from error
        if file.identity != self.identity:
            file.close()
            raise StreamError(f"{self.path.name} has changed since it was checked; try again in a moment")
        return file

    def unchanged(self) -> bool:
        """Whether the name still stands for the same file in the same state."""
        try:
            return FileIdentity.of(self.path.stat()) == self.identity
        except OSError:
            return False

    def __repr__(self) -> str:
        return f"FileReader({self.path}, {self.size} bytes)"


class MemoryReader:
    """Bytes in memory, which are always open."""

    is_near = True

    def __init__(self, data: bytes) -> None:
        self._data = data

    @property
    def size(self) -> int:
        """How many there are."""
        return len(self._data)

    def open(self) -> Self:
        """This object."""
        return self

    def at_hand(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`."""
        return self._data[start:end]

    async def read(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`."""
        return self.at_hand(start, end)

    def close(self) -> None:
        """Nothing to let go of."""

    def unchanged(self) -> bool:
        """They never change."""
        return True

    def __repr__(self) -> str:
        return f"MemoryReader({self.size} bytes)"


class ObjectReader:
    """An object of a store that is elsewhere; the store is asked for each range.

    Args:
        store: where it is.
        key: of the object.
    """

    is_near = False
    size = None

    def __init__(self, store: Store, key: str) -> None:
        self._store = store
        self._key = key

    def open(self) -> Self:
        """This object; nothing is asked for before it is read."""
        return self

    def at_hand(self, _start: int, _end: int) -> None:
        """Nothing: the store has to be asked."""

    async def read(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`; raises as `Store.get_range` does."""
        return await self._store.get_range(self._key, start, end)

    def close(self) -> None:
        """Nothing to let go of."""

    def unchanged(self) -> bool:
        """What it was at first is not remembered."""
        return True

    def __repr__(self) -> str:
        return f"ObjectReader({self._key})"
