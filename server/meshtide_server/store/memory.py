"""A store in memory: for tests, and for servers that keep nothing."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from meshtide_server.store.errors import MissingObjectError, ObjectRangeError
from meshtide_server.store.keys import check_key, check_prefix
from meshtide_server.store.protocol import ObjectInfo
from meshtide_server.store.range_reader import ObjectReader

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from meshtide_server.store.protocol import Data


class MemoryStore:
    """Objects in a dictionary, lost with the process."""

    def __init__(self) -> None:
        self._objects: dict[str, tuple[bytes, ObjectInfo]] = {}

    async def get(self, key: str) -> bytes:
        """All bytes of an object."""
        return self._find(key)[0]

    async def get_range(self, key: str, start: int, end: int) -> bytes:
        """Bytes `start` to `end` of an object."""
        data, _ = self._find(key)
        if not 0 <= start <= end <= len(data):
            raise ObjectRangeError(key, start, end, len(data))
        return data[start:end]

    async def open_range_reader(self, key: str) -> ObjectReader:
        """What reads ranges of an object."""
        return ObjectReader(self, check_key(key))

    async def put(self, key: str, data: Data) -> ObjectInfo:
        """Make or replace an object."""
        check_key(key)
        whole = bytes(data) if isinstance(data, bytes) else b"".join([part async for part in data])
        info = ObjectInfo(key, len(whole), hashlib.sha256(whole).hexdigest())
        self._objects[key] = (whole, info)
        return info

    async def list(self, prefix: str = "", *, after: str = "") -> AsyncIterator[ObjectInfo]:
        """The objects in a folder, in the order of their names."""
        folder = check_prefix(prefix)
        for key in sorted(key for key in self._objects if key > after and (not folder or key.startswith(f"{folder}/"))):
            found = self._objects.get(key)
            if found is not None:  # it may have been deleted meanwhile
                yield found[1]

    async def head(self, key: str) -> ObjectInfo:
        """What is known of an object."""
        return self._find(key)[1]

    async def delete(self, key: str) -> None:
        """Remove an object."""
        self._objects.pop(check_key(key), None)

    async def close(self) -> None:
        """Nothing to let go of: whoever holds this object keeps its contents."""

    def _find(self, key: str) -> tuple[bytes, ObjectInfo]:
        try:
            return self._objects[check_key(key)]
        except KeyError:
            raise MissingObjectError(key) from None

    def __repr__(self) -> str:
        return f"MemoryStore({len(self._objects)} objects)"
