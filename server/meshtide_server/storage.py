"""Where the bytes of a stream lie: in a file, or in memory where no file could be written; in a store: `store_storage`.

Files are read range by range rather than through a memory map: a mapped file that somebody cuts short kills the
process that reads it, a short read is an error of that one stream.
"""

from __future__ import annotations

import asyncio
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self

from meshtide_codec.errors import StreamError

if TYPE_CHECKING:
    from pathlib import Path
    from types import TracebackType


@dataclass(frozen=True, slots=True)
class FileIdentity:
    """What tells one state of a file from another without reading it."""

    device: int
    inode: int
    size: int
    modified: int

    @classmethod
    def of(cls, status: os.stat_result) -> FileIdentity:
        """The identity that `status` describes."""
        return cls(status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)


class AbsentError(Exception):
    """The bytes are not at hand without waiting; `OpenStorage.load` brings them."""


class OpenStorage(Protocol):
    """Bytes that are open for reading; a context manager."""

    def read(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`, all of them; only those of a store raise AbsentError."""

    async def load(self) -> None:
        """Bring what the last `read` has missed, for the next one."""

    async def fetch(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`, all of them, while others have their turn."""

    def close(self) -> None:
        """Let go of them; may be called twice."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class Storage(Protocol):
    """Bytes of known size that can be opened, by many readers at once."""

    @property
    def size(self) -> int:
        """How many bytes there are."""

    def open(self) -> OpenStorage:
        """Open them for reading."""

    def unchanged(self) -> bool:
        """Whether the bytes are, as far as can be told without reading them, those that were first seen."""


class Closing:
    """The context manager's half of OpenStorage."""

    def close(self) -> None:
        """Nothing to let go of unless a subclass says so."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class OpenFile(Closing):
    """A file open for reading ranges of it, by one reader."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor: int | None = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))

    def __enter__(self) -> Self:
        return self

    @property
    def identity(self) -> FileIdentity:
        """The identity of the file that was opened, whatever its name stands for by now."""
        return FileIdentity.of(os.fstat(self._opened()))

    def read(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`.

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

    async def load(self) -> None:
        """Nothing: `read` misses nothing."""

    async def fetch(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`, read in a thread, for a disk may be slow."""
        return await asyncio.to_thread(self.read, start, end)

    def close(self) -> None:
        """Close the file."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _opened(self) -> int:
        if self._descriptor is None:
            raise ValueError(f"{self._path} is closed")
        return self._descriptor


class FileStorage:
    """A file, in the state that it had when this object was made.

    Raises:
        OSError: it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with OpenFile(path) as file:
            self.identity = file.identity

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
        return f"FileStorage({self.path}, {self.size} bytes)"


class OpenMemory(Closing):
    """Bytes in memory, in the manner of an open file."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def __enter__(self) -> Self:
        return self

    def read(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`."""
        return self._data[start:end]

    async def load(self) -> None:
        """Nothing: `read` misses nothing."""

    async def fetch(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`."""
        return self._data[start:end]


class MemoryStorage:
    """Bytes that could not be stored anywhere else."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    @property
    def size(self) -> int:
        """How many there are."""
        return len(self._data)

    def open(self) -> OpenMemory:
        """Open them for reading."""
        return OpenMemory(self._data)

    def unchanged(self) -> bool:
        """They never change."""
        return True

    def __repr__(self) -> str:
        return f"MemoryStorage({self.size} bytes)"
