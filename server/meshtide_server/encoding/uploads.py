"""Uploads: a request's body becomes an object of the store, known by the SHA-256 of its bytes.

The body goes to a temporary file while it is counted and hashed, so an upload of any size takes little memory, and one
that is too large, ends early, or comes to a standstill, leaves nothing behind. Only then is it put into the store,
whole. There it stays until no job needs it any more; what a server that was killed has left is looked for now and then.
"""

from __future__ import annotations

import asyncio
import hashlib
import tempfile
from dataclasses import dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING, BinaryIO, cast

from starlette.requests import ClientDisconnect

from meshtide_codec.file_suffix import split_name
from meshtide_codec.mesh_files import is_mesh_path
from meshtide_codec.mesh_files.source import format_suffix
from meshtide_server.hosting.mesh import TIDE_SUFFIX
from meshtide_server.refusals import RefusedError
from meshtide_server.store import MissingObjectError
from meshtide_server.store.keys import source_key

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from meshtide_server.catalogue import Catalogue
    from meshtide_server.store import Store

CHUNK = 1 << 20
REFUSED_SUFFIXES = frozenset({".gltf"})
"""Formats whose parts lie in files of their own, which an upload does not bring along: .glb is the same in one file."""


@dataclass(frozen=True, slots=True)
class Upload:
    """A file in the store that waits to be encoded.

    Args:
        key: of the object.
        sha256: of its bytes, in hexadecimal.
        size: how many there are.
        note: in the catalogue, that the object is needed; `Catalogue.add_with_job` takes it.
    """

    key: str
    sha256: str
    size: int
    note: str


def checked_suffix(filename: str) -> str:
    """The suffix of an uploaded file, which gives its format, and whether a mesh file is packed by gzip.

    Raises:
        RefusedError: 415, no mesh is read from such a file.

    >>> checked_suffix("Scan.PLY"), checked_suffix("scan.ply.gz"), checked_suffix("scan.tide")
    ('.ply', '.ply.gz', '.tide')
    """
    suffix = split_name(filename).suffix.lower()
    name = f"mesh{suffix}"
    if format_suffix(name) in REFUSED_SUFFIXES or not (suffix == TIDE_SUFFIX or is_mesh_path(name)):
        message = (
            f"no mesh is read from files named *{suffix or filename[:50]}; send .ply, .obj, .off, .stl, .glb, one of "
            "them with .gz, or .tide"
        )
        raise RefusedError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "unknown-format", message)
    return suffix


def check_size(size: int, limit: int) -> None:
    """Hold the size of an upload, as far as it is known, against what this server takes.

    Raises:
        RefusedError: 413, it is larger.
    """
    if size > limit:
        message = f"the upload is longer than the {limit} bytes that this server takes (MESHTIDE_MAX_UPLOAD)"
        raise RefusedError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "too-large", message)


async def receive(
    body: AsyncIterator[bytes], suffix: str, store: Store, catalogue: Catalogue, *, limit: int, stall_seconds: float
) -> Upload:
    """Take a request's body and put it into the store.

    Args:
        body: in pieces.
        suffix: of the file's name.
        store: takes it.
        catalogue: knows who needs it.
        limit: bytes at most.
        stall_seconds: how long the next piece may be waited for.

    Raises:
        RefusedError: 413, it is longer than that; 408, nothing came for so long; 400, there is nothing in it.
        StoreError: the store did not take it.
        DatabaseUnavailableError: the catalogue did not.
    """
    digest = hashlib.sha256()
    size = 0
    with tempfile.TemporaryFile() as file:
        async for piece in _flowing(body, stall_seconds):
            size += len(piece)
            check_size(size, limit)
            digest.update(piece)
            await asyncio.to_thread(file.write, piece)
        if size == 0:
            raise RefusedError(HTTPStatus.BAD_REQUEST, "empty", "the request has no body; send the file as it is")
        sha256 = digest.hexdigest()
        key = source_key(sha256, suffix)
        note = await catalogue.sources.expect(key)  # before it is looked for, lest it be deleted then
        if not await _holds(store, key, size):
            await store.put(key, _pieces(cast("BinaryIO", file)))
    return Upload(key, sha256, size, note)


async def _flowing(body: AsyncIterator[bytes], stall_seconds: float) -> AsyncIterator[bytes]:
    """The pieces of a body, as long as none keeps us waiting."""
    pieces = aiter(body)
    while True:
        try:
            async with asyncio.timeout(stall_seconds):
                piece = await anext(pieces)
        except StopAsyncIteration:
            return
        except TimeoutError:
            message = f"nothing of the upload came for {stall_seconds:g} s (MESHTIDE_UPLOAD_STALL_TIMEOUT)"
            raise RefusedError(HTTPStatus.REQUEST_TIMEOUT, "stalled", message) from None
        except ClientDisconnect:  # nobody is there to read it
            message = "the client left before the end of the upload"
            raise RefusedError(HTTPStatus.BAD_REQUEST, "cut-off", message) from None
        yield piece


async def _holds(store: Store, key: str, size: int) -> bool:
    try:
        return (await store.head(key)).size == size
    except MissingObjectError:
        return False


async def _pieces(file: BinaryIO) -> AsyncIterator[bytes]:
    await asyncio.to_thread(file.seek, 0)
    while piece := await asyncio.to_thread(file.read, CHUNK):
        yield piece
