"""Copying a store into another one: for a backup, for getting one back, and for moving from a folder to a bucket.

What the target has under the same key with the same size is left alone: keys are made of the bytes' SHA-256. So a
copy that was interrupted goes on where it was, and one that is made every night takes what is new. Nothing is deleted.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_server.store.errors import MissingObjectError, StoreError

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable

    from meshtide_server.store.protocol import ObjectInfo, Store

PIECE_BYTES = 8 << 20
"""An object is read and written in pieces, for it may be larger than memory."""
AT_A_TIME = 8


@dataclass
class Copied:
    """What was done.

    Args:
        objects: that were copied.
        bytes: of these.
        kept: objects that the target had.
        gone: objects that were deleted from the source in the meantime.
    """

    objects: int = 0
    bytes: int = 0
    kept: int = 0
    gone: int = 0


async def copy_store(source: Store, target: Store, progress: Callable[[Copied], None] = lambda _: None) -> Copied:
    """Put every object of `source` into `target`.

    Args:
        source: is only read.
        target: gets what it has not.
        progress: is told after each object.

    Raises:
        StoreError: one of the two does not do what it is asked to; what was copied by then is whole.
    """
    copied = Copied()
    places = asyncio.Semaphore(AT_A_TIME)

    async def one(info: ObjectInfo) -> None:
        try:
            await _copy(source, target, info, copied)
        except MissingObjectError:
            copied.gone += 1
        finally:
            places.release()
        progress(copied)

    try:
        async with asyncio.TaskGroup() as group:
            async for info in source.list():
                await places.acquire()
                group.create_task(one(info))
    except BaseExceptionGroup as errors:
        raise errors.exceptions[0] from None
    return copied


async def _copy(source: Store, target: Store, info: ObjectInfo, copied: Copied) -> None:
    try:
        there = (await target.head(info.key)).size == info.size
    except MissingObjectError:
        there = False
    if there:
        copied.kept += 1
        return
    put = await target.put(info.key, _pieces(source, info))
    if put.size != info.size:
        raise StoreError(f"{put.size} of {info.size} bytes of object {info.key!r} were copied; is it being changed?")
    copied.objects += 1
    copied.bytes += info.size


async def _pieces(source: Store, info: ObjectInfo) -> AsyncIterator[bytes]:
    for start in range(0, info.size, PIECE_BYTES):
        yield await source.get_range(info.key, start, min(start + PIECE_BYTES, info.size))
