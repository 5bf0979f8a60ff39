"""The job that looks at each mesh: streams are checked, and of other files the streams that were encoded before."""

from __future__ import annotations

import asyncio
import logging
import tempfile
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshtideError
from meshtide_server.hosting.folder import Unencoded
from meshtide_server.hosting.stream_cache import CachePlace, cache_folders, file_digest, name_prefix, stream_key
from meshtide_server.store.range_reader import FileReader

if TYPE_CHECKING:
    from meshtide_server.hosting.folder import FolderMeshes
    from meshtide_server.hosting.mesh import HostedMesh, MeshSource
    from meshtide_server.hosting.stream import HostedStream
    from meshtide_server.settings import Settings

logger = logging.getLogger("meshtide.server")


class Check:
    """Looks at the meshes that wait for it, one after the other.

    Args:
        folder: the meshes.
        settings: where encoded streams are kept, and how they are encoded.
    """

    def __init__(self, folder: FolderMeshes, settings: Settings) -> None:
        self._folder = folder
        self._settings = settings
        self._options = settings.encoding
        self._scratch = ExitStack()
        self._cache_folders: dict[Path | None, tuple[Path, ...]] = {}
        self.looked_through = False
        """Whether everything that was found at the start has been looked at: what is ready then can be served."""

    async def run(self) -> None:
        """Look at what waits; never returns."""
        while True:
            mesh = await self._folder.to_check.get()
            mesh.advance("check")
            with self._folder.failing(mesh, "checked"):
                await self._check(mesh)
            self.looked_through |= self._folder.to_check.empty()

    async def close(self) -> None:
        """Delete the streams that could be kept nowhere else."""
        await asyncio.to_thread(self._scratch.close)

    async def _check(self, mesh: HostedMesh) -> None:
        path = mesh.source.path
        if mesh.source.is_stream and path is not None:
            self._folder.finish(mesh, await self._folder.load(await asyncio.to_thread(FileReader, path)))
            return
        place, digest = await self._folder.in_thread(lambda: self._place(mesh.source))
        stream = await self._from_cache(place)
        if stream is not None:
            await asyncio.to_thread(place.prune)
            self._folder.finish(mesh, stream)
        else:
            mesh.advance("waiting")
            self._folder.to_encode.put_nowait(Unencoded(mesh, place, digest))

    def _place(self, source: MeshSource) -> tuple[CachePlace, str]:
        """Where the stream of a mesh belongs, and the digest of the mesh."""
        digest = file_digest(source.path, lambda: self._folder.stopping) if source.path else f"sample {source.name}"
        directory = self._settings.directory if source.path else None
        if directory not in self._cache_folders:
            self._cache_folders[directory] = cache_folders(directory, self._settings.cache, self._make_scratch)
        prefix, key = name_prefix(source.name, self._options), stream_key(digest, self._options)
        return CachePlace(self._cache_folders[directory], prefix, key), digest

    def _make_scratch(self) -> Path:
        return Path(self._scratch.enter_context(tempfile.TemporaryDirectory(prefix="meshtide-")))

    async def _from_cache(self, place: CachePlace) -> HostedStream | None:
        path = await asyncio.to_thread(place.find)
        if path is None:
            return None
        try:
            return await self._folder.load(await asyncio.to_thread(FileReader, path))
        except (MeshtideError, OSError) as error:
            logger.warning("%s is damaged and will be made anew: %s", path, error)
            with suppress(OSError):
                await asyncio.to_thread(path.unlink)
            return None
