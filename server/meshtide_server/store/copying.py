"""Copying a store into another one, for a backup, for getting one back, for moving; and checking a store.

Keys hold the SHA-256 of their bytes, so every object that is read is checked against it: what is damaged is not copied.
What the target has under the same key with the same size is left alone: keys are made of the bytes' SHA-256. So a
copy that was interrupted goes on where it was, and one that is made every night takes what is new. Nothing is deleted.
"""

from __future__ import annotations

import asyncio
import hashlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from meshtide_server.store.errors import DamagedObjectError, MissingObjectError, ObjectRangeError, StoreError
from meshtide_server.store.keys import digest_of

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Awaitable, Callable

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
        damaged: keys of objects whose bytes have another SHA-256 than they should; these were not copied.
    """

    objects: int = 0
    bytes: int = 0
    kept: int = 0
    gone: int = 0
    damaged: list[str] = field(default_factory=list)


@dataclass
class Checked:
    """What was found.

    Args:
        objects: that are as they were put.
        bytes: of these.
        damaged: keys of objects that are not.
    """

    objects: int = 0
    bytes: int = 0
    damaged: list[str] = field(default_factory=list)


async def copy_store(source: Store, target: Store, progress: Callable[[Copied], None] = lambda _: None) -> Copied:
    """Put every object of `source` into `target`.

    Args:
        source: is only read.
        target: gets what it has not.
        progress: called after each object.

    Raises:
        StoreError: one of the two does not do what it is asked to; what was copied by then is whole.
    """
    copied = Copied()

    async def copy(info: ObjectInfo) -> None:
        try:
            await _copy(source, target, info, copied)
        except MissingObjectError:
            copied.gone += 1
        except DamagedObjectError:
            copied.damaged.append(info.key)
        progress(copied)

    await _for_each(source, copy)
    copied.damaged.sort()
    return copied


async def check_store(store: Store, progress: Callable[[Checked], None] = lambda _: None) -> Checked:
    """Read every object of `store` and check it against the SHA-256 in its key.

    Args:
        store: is only read.
        progress: called after each object.

    Raises:
        StoreError: the store does not do what it is asked to.
    """
    checked = Checked()

    async def check(info: ObjectInfo) -> None:
        try:
            async for _ in _pieces(store, info):
                pass
        except MissingObjectError:
            return  # deleted since it was listed
        except DamagedObjectError:
            checked.damaged.append(info.key)
        else:
            checked.objects += 1
            checked.bytes += info.size
        progress(checked)

    await _for_each(store, check)
    checked.damaged.sort()
    return checked


async def _for_each(store: Store, work: Callable[[ObjectInfo], Awaitable[None]]) -> None:
    """Have `work` done on every object, on several at a time; the first error ends all."""
    places = asyncio.Semaphore(AT_A_TIME)

    async def one(info: ObjectInfo) -> None:
        try:
            await work(info)
        finally:
            places.release()

    try:
        async with asyncio.TaskGroup() as group:
            async for info in store.list():
                await places.acquire()
                group.create_task(one(info))
    except BaseExceptionGroup as errors:
        raise errors.exceptions[0] from None


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
    """An object piece by piece; after the last one, an error if these were not the bytes of its key."""
    digest = hashlib.sha256()
    for start in range(0, info.size, PIECE_BYTES):
        try:
            piece = await source.get_range(info.key, start, min(start + PIECE_BYTES, info.size))
        except ObjectRangeError as error:
            raise DamagedObjectError(f"object {info.key!r} is shorter than its store says: {error}") from error
        await asyncio.to_thread(digest.update, piece)
        yield piece
    if digest_of(info.key) not in {None, digest.hexdigest()}:
        raise DamagedObjectError(f"object {info.key!r} is damaged: its bytes have another SHA-256")
