"""What the tests of bulk ingest share: files to be ingested, and what came out."""

from __future__ import annotations

import asyncio
import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec.command_options import profile_options
from meshtide_codec.encoder import encode
from meshtide_codec.mesh_files import load_mesh, save_mesh
from meshtide_codec.stream.mesh_query import MeshQuery
from meshtide_codec.testing import grid
from meshtide_server.catalogue import Catalogue, MeshRecord
from meshtide_server.store import stream_key
from meshtide_server.store.opening import open_store

if TYPE_CHECKING:
    from pathlib import Path

BITS = 8
PROFILE = "classic"  # the quicker one


@dataclass(frozen=True)
class Chosen:
    """A file to be ingested."""

    file: Path
    digest: str
    mesh: str | None = None


def chosen(file: Path, mesh: str | None = None) -> Chosen:
    return Chosen(file, hashlib.sha256(file.read_bytes()).hexdigest(), mesh)


def small_meshes(folder: Path, count: int) -> list[Path]:
    """So many mesh files, each of another content."""
    folder.mkdir(exist_ok=True)
    files = [folder / f"patch-{number:03}.ply" for number in range(count)]
    for number, file in enumerate(files):
        save_mesh(grid(3, seed=number), file)
    return files


def expected_stream(file: Path) -> bytes:
    """What the file is to be encoded to."""
    return encode(load_mesh(file), profile_options(PROFILE, BITS, {}, {})).to_bytes()


@dataclass(frozen=True)
class Kept:
    """What store and catalogue hold."""

    meshes: dict[str, MeshRecord]
    streams: dict[str, bytes]
    """Of the meshes, by their ids."""
    keys: set[str]
    """Of all objects of the store."""

    @property
    def expected_keys(self) -> set[str]:
        """Of the objects that the meshes need."""
        return {stream_key(mesh.stream or "") for mesh in self.meshes.values()}


def kept(store_url: str, database_url: str) -> Kept:
    """Read store and catalogue."""

    async def read() -> Kept:
        catalogue, store = await Catalogue.open(database_url), open_store(store_url)
        try:
            page = await catalogue.meshes.list(MeshQuery(), 1000)
            streams = {mesh.id: await store.get(stream_key(mesh.stream or "")) for mesh in page.meshes}
            return Kept({mesh.id: mesh for mesh in page.meshes}, streams, {info.key async for info in store.list()})
        finally:
            await catalogue.close()
            await store.close()

    return asyncio.run(read())


def kept_in(folder: Path) -> Kept:
    """The same of what --data names."""
    return kept(str(folder / "store"), f"sqlite:///{folder / 'catalogue.db'}")
