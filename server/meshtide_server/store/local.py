"""A store in a folder: one file an object, written beside its place and moved there.

A put writes a partial file in the folder `.parts`, has the system write it to the disk (fsync), renames it to its place
and has the folder written too: after a crash at any moment a key stands for the whole old object or the whole new one.
A writer holds a lock on its partial file, so that another process that opens the same folder can tell those of writers
that still run from those that a crash left behind, which it deletes.
"""

from __future__ import annotations

import asyncio
import logging
import os
import secrets
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from meshtide_server.store.errors import MissingObjectError, ObjectRangeError, StoreError
from meshtide_server.store.keys import check_key, check_prefix
from meshtide_server.store.protocol import ObjectInfo
from meshtide_server.store.range_reader import FileReader

try:
    import fcntl
except ImportError:  # Windows, which refuses to delete a file that is open: no lock is needed there
    fcntl = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Iterator

    from meshtide_server.store.protocol import Data

logger = logging.getLogger("meshtide.server")

Result = TypeVar("Result")

PARTS = ".parts"
"""Folder of the partial files; no key begins with a dot."""
_BINARY = getattr(os, "O_BINARY", 0)


class LocalStore:
    """Objects as files in a folder, which is made if it is missing.

    Args:
        root: the folder.

    Raises:
        StoreError: it cannot be made or written to.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._parts = root / PARTS
        try:
            self._parts.mkdir(parents=True, exist_ok=True)
            self._clean()
        except OSError as error:
            raise StoreError(f"nothing can be kept in {root}: {error.strerror or error}") from error

    def path(self, key: str) -> Path:
        """The file of an object, which may or may not exist.

        Raises:
            InvalidKeyError: it is not a key.
        """
        return self.root.joinpath(*check_key(key).split("/"))

    async def get(self, key: str) -> bytes:
        """All bytes of an object."""
        return await self._in_thread(key, self.path(key).read_bytes)

    async def get_range(self, key: str, start: int, end: int) -> bytes:
        """Bytes `start` to `end` of an object."""
        path = self.path(key)
        return await self._in_thread(key, lambda: _read_range(path, key, start, end))

    async def open_range_reader(self, key: str) -> FileReader:
        """What reads ranges of an object where it lies."""
        path = self.path(key)
        return await self._in_thread(key, lambda: FileReader(path))

    async def put(self, key: str, data: Data) -> ObjectInfo:
        """Make or replace an object."""
        path = self.path(key)
        part = await self._in_thread(key, lambda: _PartialFile(self._parts))
        try:
            if isinstance(data, bytes):
                await self._in_thread(key, lambda: part.write(data))
            else:
                async for piece in data:
                    await self._in_thread(key, lambda piece=piece: part.write(piece))  # type: ignore[misc]
            return await self._in_thread(key, lambda: _info(key, part.move(path, self.root)))
        finally:
            part.discard()

    async def list(self, prefix: str = "", *, after: str = "") -> AsyncIterator[ObjectInfo]:
        """The objects in a folder, in the order of their names."""
        folder = check_prefix(prefix)
        names = await self._in_thread(prefix, lambda: sorted(self._keys(folder)))
        for key in names:
            if key > after:
                with suppress(MissingObjectError):  # it may have been deleted meanwhile
                    yield await self.head(key)

    async def head(self, key: str) -> ObjectInfo:
        """What is known of an object."""
        path = self.path(key)
        return await self._in_thread(key, lambda: _info(key, _file_status(path)))

    async def delete(self, key: str) -> None:
        """Remove an object."""
        path = self.path(key)

        def remove() -> None:
            path.unlink()
            _sync_folder(path.parent)

        with suppress(MissingObjectError):
            await self._in_thread(key, remove)

    async def close(self) -> None:
        """Nothing to let go of."""

    async def _in_thread(self, key: str, work: Callable[[], Result]) -> Result:
        """Do what may wait for the disk in a thread, its errors as this package's own."""
        try:
            return await asyncio.to_thread(work)
        except (FileNotFoundError, NotADirectoryError, IsADirectoryError) as error:
            raise MissingObjectError(key) from error
        except OSError as error:
            raise StoreError(f"object {key!r} in {self.root}: {error.strerror or error}") from error

    def _keys(self, folder: str) -> Iterator[str]:
        start = self.path(folder) if folder else self.root
        for place, folders, files in os.walk(start):
            folders[:] = [name for name in folders if not name.startswith(".")]
            for name in files:
                if not name.startswith("."):
                    yield Path(place, name).relative_to(self.root).as_posix()

    def _clean(self) -> None:
        """Delete the partial files that nobody writes any more."""
        for path in self._parts.iterdir():
            with suppress(OSError):
                if _is_abandoned(path):
                    path.unlink()
                    logger.info("deleted %s, which a crash left behind", path)

    def __repr__(self) -> str:
        return f"LocalStore({self.root})"


class _PartialFile:
    """A partial file, locked while it is written."""

    def __init__(self, folder: Path) -> None:
        while True:
            self.path = folder / f"{os.getpid()}-{secrets.token_hex(8)}.part"
            self._descriptor: int | None = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _BINARY, 0o644)
            if _lock(self._descriptor) and os.fstat(self._descriptor).st_nlink:
                return
            os.close(self._descriptor)  # somebody who cleaned up took it for abandoned before it was locked

    def write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[os.write(self._opened(), view) :]

    def move(self, path: Path, root: Path) -> os.stat_result:
        """Put the file in its place, for good; returns its status."""
        os.fsync(self._opened())
        status = os.fstat(self._opened())
        if fcntl is None:
            self._close()  # Windows does not rename a file that is open
        _make_folders(path.parent, root)
        try:
            self.path.replace(path)
        except (IsADirectoryError, NotADirectoryError, FileExistsError) as error:
            raise StoreError(f"{path} cannot be a file: a folder stands in its place") from error
        _sync_folder(path.parent)
        return status

    def discard(self) -> None:
        """Delete the file if it was not moved."""
        self._close()
        self.path.unlink(missing_ok=True)

    def _opened(self) -> int:
        assert self._descriptor is not None  # noqa: S101 - it is closed last
        return self._descriptor

    def _close(self) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def _lock(descriptor: int) -> bool:
    """Lock a file for this process, unless another one holds it."""
    if fcntl is not None:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True


def _is_abandoned(path: Path) -> bool:
    """Whether no writer holds a partial file."""
    descriptor = os.open(path, os.O_RDONLY | _BINARY)
    try:
        return _lock(descriptor)
    finally:
        os.close(descriptor)


def _make_folders(folder: Path, root: Path) -> None:
    """Make the folders from `root` down to `folder`, each one written to the disk."""
    missing = []
    while folder != root and not folder.is_dir():
        missing.append(folder)
        folder = folder.parent
    for path in reversed(missing):
        try:
            path.mkdir(exist_ok=True)
        except (FileExistsError, NotADirectoryError) as error:
            raise StoreError(f"{path} cannot be a folder: a file stands in its place") from error
        _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Have the names in a folder written to the disk; Windows does so by itself."""
    if fcntl is None:
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _file_status(path: Path) -> os.stat_result:
    status = path.stat()
    if path.is_dir():
        raise IsADirectoryError(path)
    return status


def _info(key: str, status: os.stat_result) -> ObjectInfo:
    return ObjectInfo(key, status.st_size, f"{status.st_ino:x}-{status.st_mtime_ns:x}-{status.st_size:x}")


def _read_range(path: Path, key: str, start: int, end: int) -> bytes:
    with path.open("rb", buffering=0) as file:
        size = os.fstat(file.fileno()).st_size
        if not 0 <= start <= end <= size:
            raise ObjectRangeError(key, start, end, size)
        file.seek(start)
        data = bytearray()
        while len(data) < end - start:
            piece = file.read(end - start - len(data))
            if not piece:
                raise StoreError(f"{path} ended while it was read; it was changed in place")
            data += piece
        return bytes(data)
