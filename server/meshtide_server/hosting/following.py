"""The job that follows the catalogue, which other servers change too, and tidies up the store now and then."""

from __future__ import annotations

import asyncio
import logging
import time
from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshtideError
from meshtide_server.hosting.collecting import collect_orphans, collect_unused
from meshtide_server.operations import metrics

if TYPE_CHECKING:
    from meshtide_server.hosting.published import PublishedMeshes

logger = logging.getLogger("meshtide.server")

COLLECT_SECONDS = 600.0
"""How often streams that no mesh has, and uploads that no job needs, are looked for in the store."""


async def follow(published: PublishedMeshes, seconds: float) -> None:
    """Hold what is in memory against the catalogue every `seconds`; never returns."""
    collected: float | None = None
    while True:
        await asyncio.sleep(seconds)
        try:
            await published.refresh()
            if collected is None or time.monotonic() - collected > COLLECT_SECONDS:
                collected = time.monotonic()
                for sha256 in await collect_unused(published.store, published.catalogue):
                    logger.info("deleted stream %s, which no mesh has", sha256)
                for key in await collect_orphans(published.store, published.catalogue):
                    logger.info("deleted upload %s, which no job needs", key)
        except MeshtideError as error:
            logger.warning("the catalogue cannot be followed: %s", error)
        except Exception:
            logger.exception("while the catalogue was followed")
            metrics.fault("library")
