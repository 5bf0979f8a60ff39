"""A bulk ingest from its options to its end: where to, by whom, and what is there already."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from meshtide_codec.errors import OptionError
from meshtide_codec.stream.mesh_query import MeshQuery
from meshtide_server.bulk_ingest.ingestion import Ingestion
from meshtide_server.bulk_ingest.local_workers import LocalWorkers
from meshtide_server.catalogue import Catalogue
from meshtide_server.catalogue.database import checked_url
from meshtide_server.settings import Settings
from meshtide_server.settings_sources import explanation
from meshtide_server.store.memory import MemoryStore
from meshtide_server.store.opening import open_store

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Iterable
    from pathlib import Path

    from meshtide_server.bulk_ingest.dask_cluster import DaskCluster
    from meshtide_server.bulk_ingest.ingestion import ChosenFile
    from meshtide_server.catalogue import MeshRecord


@dataclass(frozen=True, slots=True)
class KnownMesh:
    """A mesh of the catalogue, as a listing shows it.

    Args:
        id: its id.
        name: name of the file that it was made of.
        status: "ready", "encoding" or "failed".
        source: SHA-256 of that file, in hexadecimal, if it is known.
    """

    id: str
    name: str
    status: str
    source: str | None


class BulkIngest:
    """Encodes files and publishes them; what is not given here is taken from the settings of a server.

    Args:
        data: folder of store and catalogue.
        store: address of another store.
        database: address of another catalogue; one with a password belongs into the environment, MESHTIDE_DATABASE.
        bits: per coordinate.
        profile: "compact" or "classic".
        effort: "default" or "high"; of profile compact.
        tags: of all meshes.
        licence: the text of their terms.
        workers: processes that encode here, or None for as many as a server has.
        scheduler: address of a Dask cluster that encodes instead.
        patience: seconds to wait for the cluster.

    Raises:
        OptionError: one of them is wrong, or one is missing.
    """

    def __init__(
        self,
        *,
        data: Path | None = None,
        store: str | None = None,
        database: str | None = None,
        bits: int | None = None,
        profile: str | None = None,
        effort: str | None = None,
        tags: tuple[str, ...] = (),
        licence: str = "",
        workers: int | None = None,
        scheduler: str | None = None,
        patience: float = 30.0,
    ) -> None:
        if database is not None and checked_url(database).password is not None:
            raise OptionError("everybody on this machine can read the command line: set MESHTIDE_DATABASE instead")
        how = {"bits": bits, "profile": profile, "effort": effort}
        given = {"data": data, "store": store, "database": database, **how}
        settings: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        try:
            self._settings = Settings(**settings)
        except ValidationError as error:
            raise OptionError(explanation(error)) from None
        if not self._settings.keeps_meshes:
            raise OptionError("say where to: a store and a database, or data, a folder for both")
        if scheduler is not None and workers is not None:
            raise OptionError("workers are processes of this machine; those of a Dask cluster are its own affair")
        self._tags = tags
        self._licence = licence
        self._workers = workers
        self._scheduler = scheduler
        self._patience = patience

    def known(self) -> tuple[KnownMesh, ...]:
        """The meshes of the catalogue.

        Raises:
            DatabaseUnavailableError, NewerSchemaError: it cannot be read.
        """
        return asyncio.run(self._known())

    def run(
        self,
        files: Iterable[ChosenFile],
        report: Callable[[Path, str | None, str, str | None, tuple[str, ...]], None],
        stage: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Encode files and publish them.

        Args:
            files: taken one by one, in another thread, when there is somebody to encode them.
            report: called for each file that is through: itself, its mesh, "done", "kept", "failed" or "left", why, and
                what of it is not kept.
            stage: called now and then with what a worker of this machine does.

        Raises:
            OptionError: it is not an address of a cluster, or the extra `dask` is not installed.
            StoreError, DatabaseUnavailableError, NewerSchemaError, TransferError: store, catalogue or cluster cannot
                be opened. What goes wrong later is reported for the files.
        """
        asyncio.run(self._run(files, report, stage))

    async def _known(self) -> tuple[KnownMesh, ...]:
        async with AsyncExitStack() as stack:
            records = _records(await self._catalogue(stack))
            return tuple([KnownMesh(row.id, row.name, row.state.value, row.source) async for row in records])

    async def _run(
        self,
        files: Iterable[ChosenFile],
        report: Callable[[Path, str | None, str, str | None, tuple[str, ...]], None],
        stage: Callable[[str], None],
    ) -> None:
        async with AsyncExitStack() as stack:
            catalogue = await self._catalogue(stack)
            store = open_store(self._settings.store_url)
            stack.push_async_callback(store.close)
            if isinstance(store, MemoryStore):
                raise OptionError("a store in memory is gone when this command ends; name a folder or a bucket")
            encoders = await self._encoders(stage)
            stack.push_async_callback(encoders.close)
            ingestion = Ingestion(
                store,
                catalogue,
                encoders,
                self._settings,
                tags=self._tags,
                licence=self._licence,
                taken={record.id async for record in _records(catalogue)},
                report=report,
            )
            await ingestion.run(files)

    async def _catalogue(self, stack: AsyncExitStack) -> Catalogue:
        catalogue = await Catalogue.open(self._settings.database_url)
        stack.push_async_callback(catalogue.close)
        return catalogue

    async def _encoders(self, stage: Callable[[str], None]) -> LocalWorkers | DaskCluster:
        if self._scheduler is None:
            return LocalWorkers(self._workers or self._settings.encoder_processes, stage)
        from meshtide_server.bulk_ingest.dask_cluster import DaskCluster  # noqa: PLC0415 - needs an extra

        return await DaskCluster.connect(self._scheduler, self._patience)


async def _records(catalogue: Catalogue) -> AsyncIterator[MeshRecord]:
    """All meshes, read page by page."""
    query = MeshQuery()
    while True:
        page = await catalogue.meshes.list(query)
        for record in page.meshes:
            yield record
        if page.next is None:
            return
        query = replace(query, after=page.next)
