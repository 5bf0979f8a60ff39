"""Fetch a mesh and wait for it: the plain, blocking way, with what a download needs around it.

Packets are kept in a file beside the output while they arrive, so that the next fetch resumes a
download that was interrupted; the output itself is replaced only when the mesh is there.
"""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from contextlib import aclosing, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_client.connection.tide_address import TideAddress, parse_address
from meshtide_client.download.destination import Destination
from meshtide_client.download.download import Download
from meshtide_client.download.partial_file import PartialFile
from meshtide_codec.errors import OptionError
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.output_files import made_folder
from meshtide_codec.stream.container import PREAMBLE_BYTES
from meshtide_codec.termination import Terminated, terminable

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine

    from meshtide_client.connection.link import Link
    from meshtide_client.connection.tide_address import Address
    from meshtide_client.download.levels import LevelFigures, ReceivedLevel
    from meshtide_client.download.packet_filter import FilterReport, PacketFilter
    from meshtide_codec.limits import Limits
    from meshtide_codec.mesh import Mesh
    from meshtide_codec.stream.header import StreamHeader
    from meshtide_codec.stream.session import Until


@dataclass(frozen=True, slots=True)
class FetchResult:
    """What a fetch brought.

    Args:
        address: where the mesh came from.
        header: of its stream.
        mesh: its finest level that was asked for.
        figures: what is known of that level.
        levels: the same of every level on the way, coarse to fine.
        received_bytes: bytes of header and packets that came over the network this time.
        more: whether the stream goes on after what was asked for.
        seconds: from the start to the end.
        transport: how it came: websocket, http, download, s3 or local.
        link_report: what a lossy link did, if there was one.
    """

    address: Address
    header: StreamHeader
    mesh: Mesh
    figures: LevelFigures
    levels: tuple[LevelFigures, ...]
    received_bytes: int
    more: bool
    seconds: float
    transport: str
    link_report: FilterReport | None = None


def fetch(
    url: str,
    output: Path | str | None = None,
    *,
    until: Until | None = None,
    stream_file: Path | str | None = None,
    keep_levels: Path | str | None = None,
    link: Link | None = None,
    limits: Limits | None = None,
    on_level: Callable[[ReceivedLevel], None] | None = None,
    notify: Callable[[str], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
    transport: str = "auto",
    loss: PacketFilter | None = None,
    overwrite: bool = True,
    kind: str | None = None,
) -> FetchResult:
    """Fetch the mesh at `url`, and wait until it is there.

    Args:
        url: the mesh's address, such as ``http://localhost:8000/meshes/stanford-bunny``, or that of a `.tide` file
            on any web server, in a bucket (``s3://bucket/bunny.tide``) or on this machine.
        output: file to write the mesh to; an existing one is replaced only when all is there. While packets arrive
            they are kept beside it in a file that ends in ``.partial.tide``; the next fetch goes on from there.
        until: how much of the mesh is wanted; all when left out.
        stream_file: a `.tide` file for the packets, which stays; what it holds already is not fetched again.
        keep_levels: folder to write every level to.
        link: timeout, retries and rate of the connection.
        limits: what the stream may claim of memory.
        on_level: is called with each level as it arrives.
        notify: called with one sentence that a person should read, such as that a connection was lost.
        progress: is called with the bytes of the file that are there, and that there will be.
        transport: "websocket", "http" (ranges of the file), "download" (one plain request), or "auto" for the first
            of them that works.
        loss: a lossy link that the packets go over before they are decoded, for experiments.
        overwrite: whether files of meshes that are there already are replaced; a stream file that holds another stream
            is renamed.
        kind: format of the output, such as obj, in place of what its name says.

    Raises:
        OptionError: `url` is not the address of a mesh, or cannot be read by that transport, or `until` allows less
            than the coarsest level, or the lossy link cannot be; a file is what is read, or is there and not to be
            replaced.
        TransferError: there was no connection, or it was lost too often; the message says what is kept.
        ProtocolError, PeerError: what answers is not a meshtide server, or it refused.
        StreamError: the stream is damaged or over the limits.
        MissingLibraryError, MeshFileError, OSError: a file cannot be written.
    """
    address = parse_address(url)
    local = isinstance(address, TideAddress) and address.kind == "local"
    destination = Destination(
        _path(output), _path(stream_file), _path(keep_levels), overwrite, kind, resumable=not local
    )
    destination.prepare(address)
    holding = destination.open(limits, notify)
    levels = nullcontext() if destination.keep_levels is None else made_folder(destination.keep_levels)
    try:
        destination.check_output()  # another fetch may have finished since
        download = Download(
            address,
            holding,
            until=until,
            link=link,
            limits=limits,
            notify=notify,
            progress=progress,
            transport=transport,
            loss=loss,
        )
        with levels:
            result = _run(lambda: _fetched(download, destination, on_level))
        if destination.output is not None:
            save_mesh(result.mesh, destination.output, kind=kind, replace=overwrite)
        if isinstance(holding, PartialFile) and destination.stream_file is None:
            holding.discard()
    except (KeyboardInterrupt, Terminated):
        if notify is not None and holding.header is not None:
            notify(holding.summary())
        raise
    finally:
        holding.close()
    return result


async def _fetched(
    download: Download, destination: Destination, on_level: Callable[[ReceivedLevel], None] | None
) -> FetchResult:
    """Wait for all levels; each is written, if levels are kept."""
    last: ReceivedLevel | None = None
    written: set[str] = set()
    levels: list[LevelFigures] = []
    async with aclosing(download.levels()) as arriving:
        async for level in arriving:
            last = level
            levels.append(level.figures)
            if destination.keep_levels is not None:
                name = f"{download.address.file_stem}-level-{level.level}.ply"
                replace = destination.overwrite or name in written
                await asyncio.to_thread(_save, level.mesh, destination.keep_levels / name, replace=replace)
                written.add(name)
            if on_level is not None:
                on_level(level)
    header = download.header
    assert header is not None  # noqa: S101 - no stream ends without
    if last is None:
        least = PREAMBLE_BYTES + len(header.to_bytes()) + header.level_bytes(header.levels[0])
        raise OptionError(f"the bound allows no level; the coarsest takes {least} bytes")
    return FetchResult(
        address=download.address,
        header=header,
        mesh=last.mesh,
        figures=last.figures,
        levels=tuple(levels),
        received_bytes=download.received_bytes,
        more=download.more,
        seconds=download.seconds,
        transport=download.transport or "none",
        link_report=download.link_report,
    )


def _run(fetched: Callable[[], Coroutine[None, None, FetchResult]]) -> FetchResult:
    """Run to the end, also where an event loop is running already, as in a notebook."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        with terminable():  # levels are written by other threads
            return asyncio.run(fetched())
    with ThreadPoolExecutor(max_workers=1) as executor:
        return executor.submit(lambda: asyncio.run(fetched())).result()


def _save(mesh: Mesh, path: Path, *, replace: bool) -> None:
    save_mesh(mesh, path, replace=replace)


def _path(path: Path | str | None) -> Path | None:
    return None if path is None else Path(path)
