"""What nobody needs any more leaves the store: streams that no mesh has, and uploads that no job is for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_server.catalogue.catalogue import UNUSED_FOR
from meshtide_server.store import stream_key
from meshtide_server.store.keys import SOURCES

if TYPE_CHECKING:
    from datetime import timedelta

    from meshtide_server.catalogue import Catalogue
    from meshtide_server.store import Store


async def collect_unused(store: Store, catalogue: Catalogue) -> list[str]:
    """Delete the objects of streams that no mesh has needed for a while; returns their SHA-256."""
    return await catalogue.collect(lambda sha256: store.delete(stream_key(sha256)))


async def collect_orphans(store: Store, catalogue: Catalogue, older_than: timedelta = UNUSED_FOR) -> list[str]:
    """Delete uploaded files that nobody needs: those of servers killed between two steps, and of jobs that were ended.

    Args:
        store: holds them.
        catalogue: knows who needs them.
        older_than: after so long, an upload that was noted and never became a job has been given up.

    Returns:
        The keys of the objects that were deleted.
    """
    await catalogue.sources.forget_abandoned(older_than)
    keys = [info.key async for info in store.list(SOURCES)]
    needed = await catalogue.sources.needed(keys)
    return [key for key in keys if key not in needed and await catalogue.sources.collect(key, store.delete)]
