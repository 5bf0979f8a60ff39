"""What every store does. Objects are whole or absent: nobody ever sees a part of one.

Every method may raise `StoreError` for a store that cannot be reached, is full, or refuses; keys that are none raise
`InvalidKeyError` before anything is done.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Protocol

Data = bytes | AsyncIterator[bytes]
"""What can be put: bytes, or parts of them one after the other, for what is too large for memory."""


@dataclass(frozen=True, slots=True)
class ObjectInfo:
    """What a store knows of an object without reading it.

    Args:
        key: its key.
        size: in bytes.
        etag: what changes whenever the object is put anew with other bytes; its form is the store's own.
    """

    key: str
    size: int
    etag: str


class OpenRanges(Protocol):
    """Bytes that are open for one reader, who has to close them."""

    def at_hand(self, start: int, end: int) -> bytes | None:
        """Bytes `start` to `end`, all of them, or None if they cannot be had without waiting."""

    async def read(self, start: int, end: int) -> bytes:
        """Bytes `start` to `end`, all of them, while others have their turn."""

    def close(self) -> None:
        """Let go of them; may be called twice."""


class RangeReader(Protocol):
    """Bytes that many may read, each after opening them."""

    @property
    def size(self) -> int | None:
        """How many there are; None if that is not known without asking."""

    @property
    def is_near(self) -> bool:
        """Whether they lie on this machine, so that nothing is gained by keeping them in memory."""

    def open(self) -> OpenRanges:
        """Open them for reading.

        Raises:
            StreamError: they are gone, or others by now.
        """

    def unchanged(self) -> bool:
        """Whether they are, as far as can be known without reading them, those that were first seen."""


class Store(Protocol):
    """Objects under keys; see `keys` for what a key is."""

    async def get(self, key: str) -> bytes:
        """All bytes of an object.

        Raises:
            MissingObjectError: there is none.
        """

    async def get_range(self, key: str, start: int, end: int) -> bytes:
        """Bytes `start` to `end` (one past the last) of an object, all of them.

        Raises:
            MissingObjectError: there is none.
            ObjectRangeError: not 0 <= start <= end <= size.
        """

    async def open_range_reader(self, key: str) -> RangeReader:
        """What reads ranges of an object again and again; where the object lies elsewhere, nothing is asked for yet.

        Raises:
            MissingObjectError: there is none, as far as that is known without asking.
        """

    async def put(self, key: str, data: Data) -> ObjectInfo:
        """Make or replace an object, which is on the disk and seen by all once this returns.

        If this fails, or what yields the data does, or the process is killed, the object is as it was before.
        """

    def list(self, prefix: str = "", *, after: str = "") -> AsyncIterator[ObjectInfo]:
        """The objects in a folder and its folders.

        Objects of one folder come in the order of their names, as bytes. Where the folders within it come is the
        store's own, so only a folder without folders can be listed piece by piece.

        Args:
            prefix: the folder, such as "streams"; "" for all objects.
            after: only keys that come after this one in that order, for going on where a listing ended.
        """

    async def head(self, key: str) -> ObjectInfo:
        """What is known of an object without reading it.

        Raises:
            MissingObjectError: there is none.
        """

    async def delete(self, key: str) -> None:
        """Remove an object; it is not an error if there is none."""

    async def close(self) -> None:
        """Let go of connections; may be called twice."""
