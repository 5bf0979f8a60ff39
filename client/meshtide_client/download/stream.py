"""Levels as they arrive: the plain way for programs that show a mesh while it comes."""

from __future__ import annotations

from contextlib import aclosing, closing
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_client.connection.tide_address import parse_address
from meshtide_client.download.download import Download
from meshtide_client.download.holding import Holding
from meshtide_client.download.partial_file import PartialFile

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable

    from meshtide_client.connection.link import Link
    from meshtide_client.download.levels import ReceivedLevel
    from meshtide_codec.limits import Limits
    from meshtide_codec.stream.session import Until


async def stream(
    url: str,
    *,
    until: Until | None = None,
    resume: Path | str | None = None,
    link: Link | None = None,
    limits: Limits | None = None,
    notify: Callable[[str], None] | None = None,
    transport: str = "auto",
) -> AsyncGenerator[ReceivedLevel, None]:
    """The levels of the mesh at `url` as they become available, coarse to fine.

    Args:
        url: the mesh's address, such as ``http://localhost:8000/meshes/stanford-bunny``, or that of a `.tide` file
            on any web server, in a bucket (``s3://bucket/bunny.tide``) or on this machine.
        until: how much of it is wanted; all when left out.
        resume: a file where packets are kept as they arrive. What it holds from an earlier download is not
            fetched again; its levels come first. When the stream is complete it is a whole `.tide` file.
        link: timeout, retries and rate of the connection.
        limits: what the stream may claim of memory.
        notify: called with one sentence when a connection was lost, a file was damaged, or the stream has changed
            on the server; in the last case the coarsest level comes again, of the new stream.
        transport: "websocket", "http" (ranges of the file), "download" (one plain request), or "auto" for the first
            of them that works.

    Raises:
        OptionError: `url` is not the address of a mesh, or cannot be read by that transport.
        TransferError: there was no connection, or it was lost too often; what arrived stays in `resume`.
        ProtocolError, PeerError: what answers is not a meshtide server, or it refused.
        StreamError: the stream is damaged or over the limits.
        OSError: `resume` cannot be written.

    Leaving the loop early leaves the connection to the garbage collector; `contextlib.aclosing` closes it at once::

        async with aclosing(meshtide_client.stream(url)) as levels:
            async for level in levels:
                if level.rms < 0.001:
                    break
    """
    address = parse_address(url)
    with closing(PartialFile(Path(resume), limits=limits, notify=notify) if resume else Holding()) as holding:
        download = Download(address, holding, until=until, link=link, limits=limits, notify=notify, transport=transport)
        async with aclosing(download.levels()) as levels:
            async for level in levels:
                yield level
