"""Publishing a stream: from a `.tide` file to a mesh that every server of the same store and catalogue shows.

The order of the steps is what keeps the two of them together. The whole stream is checked; its object is noted as
unused, then put; stream, packets and mesh come into the catalogue in one transaction, in which the store is asked once
more for the object. Killed at any moment, this leaves a whole mesh or none, and at most an unused object that is
deleted after a while; run again, it does what was left to do.
"""

from __future__ import annotations

import asyncio
import hashlib
from contextlib import closing
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from meshtide_server.catalogue import Box, MeshRecord, Status, StreamRecord
from meshtide_server.hosting.search import grid_box
from meshtide_server.hosting.stream import HostedStream, load_stream
from meshtide_server.store import MissingObjectError, StoreError, stream_key
from meshtide_server.store.range_reader import FileReader, MemoryReader

if TYPE_CHECKING:
    from collections.abc import AsyncIterator
    from pathlib import Path

    from meshtide_codec.limits import Limits
    from meshtide_server.catalogue import Catalogue
    from meshtide_server.store import Store

CHUNK = 1 << 20
ATTEMPTS = 3
"""How often an object is put that is deleted, as long unused, in the very moment in which it is needed again."""


@dataclass(frozen=True, slots=True)
class Publication:
    """What is published beside the stream.

    Args:
        id: of the mesh, in URLs.
        name: for people.
        tags: to find it by.
        licence: the text of its terms.
        source: SHA-256 of the mesh file that the stream was made of, in hexadecimal, if it is known.
        box: that holds the mesh; the box of its quantization grid when left out.
    """

    id: str
    name: str
    tags: tuple[str, ...] = ()
    licence: str = ""
    source: str | None = None
    box: Box | None = None


async def publish(
    store: Store,
    catalogue: Catalogue,
    data: bytes | Path,
    publication: Publication,
    *,
    overwrite: bool = True,
    job: tuple[str, str] | None = None,
    limits: Limits | None = None,
) -> MeshRecord:
    """Check a stream, keep it, and show it as a mesh.

    Args:
        store: takes the stream.
        catalogue: takes the mesh.
        data: the `.tide` file, or its path.
        publication: the mesh's description.
        overwrite: whether a mesh of that id is replaced.
        job: id and owner of the job that made the stream; it is done with this.
        limits: what the stream may hold.

    Returns:
        The mesh as it is in the catalogue.

    Raises:
        StreamError: it is not a whole stream.
        MeshExistsError: there is a mesh of that id, and `overwrite` is not set.
        UnknownMeshError: the job is not its owner's any more.
        StoreError, DatabaseUnavailableError: what the store or the database could not do.
        OSError: the file cannot be read.
    """
    stream, record = await asyncio.to_thread(_examine, data, limits)
    mesh = _describe(stream, record, publication)
    key = stream_key(record.sha256)

    async def present() -> bool:
        try:
            return (await store.head(key)).size == record.size
        except MissingObjectError:
            return False

    for _ in range(ATTEMPTS):
        if not await present():
            await catalogue.streams.note_unused(record.sha256)
            await store.put(key, data if isinstance(data, bytes) else _pieces(data))
        shown = await catalogue.register(mesh, record, present, replace=overwrite, job=job)
        if shown is not None:
            return shown
    raise StoreError(f"object {key!r} was put {ATTEMPTS} times and is not there; is something else deleting it?")


def _examine(data: bytes | Path, limits: Limits | None) -> tuple[HostedStream, StreamRecord]:
    file = MemoryReader(data) if isinstance(data, bytes) else FileReader(data)
    stream = load_stream(file, limits)
    digest = hashlib.sha256()
    with closing(file.open()) as opened:
        for start in range(0, stream.size, CHUNK):
            digest.update(opened.at_hand(start, min(start + CHUNK, stream.size)))
    return stream, StreamRecord(
        sha256=digest.hexdigest(),
        fingerprint=stream.fingerprint,
        header=stream.header_bytes,
        size=stream.size,
        packets=stream.packet_digests,
    )


def _describe(stream: HostedStream, record: StreamRecord, publication: Publication) -> MeshRecord:
    header = stream.header
    mesh = MeshRecord(
        id=publication.id,
        name=publication.name,
        tags=tuple(sorted(set(publication.tags))),
        licence=publication.licence,
        state=Status.READY,
        stream=record.sha256,
        source=publication.source,
        size=record.size,
    )
    return replace(
        mesh,
        vertices=header.vertices,
        faces=header.faces,
        levels=len(header.levels),
        box=publication.box or grid_box(header.origin, header.extent),
    )


async def _pieces(path: Path) -> AsyncIterator[bytes]:
    with await asyncio.to_thread(path.open, "rb") as file:
        while piece := await asyncio.to_thread(file.read, CHUNK):
            yield piece
