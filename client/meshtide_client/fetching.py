"""Fetch a mesh and wait for it: the plain, blocking way, with what a download needs around it.

Packets are kept in a file beside the output while they arrive, so that a download that was broken off is gone on
with by the next one; the output itself is replaced only when the mesh is there.
"""

from __future__ import annotations

import asyncio
import glob
import hashlib
import os
from concurrent.futures import ThreadPoolExecutor
from contextlib import aclosing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from meshtide_client.holding import Holding
from meshtide_client.link.lossy_reception import LossyReception
from meshtide_client.partial_file import PartialFile
from meshtide_client.streaming import Reception
from meshtide_client.tide_address import TideAddress, parse_address
from meshtide_codec.errors import MeshFileError, OptionError
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.mesh_files.formats import SUFFIXES as MESH_SUFFIXES
from meshtide_codec.mesh_files.write import format_of
from meshtide_codec.output_files import is_written_in_place, orderly_termination
from meshtide_codec.output_policy import check_apart, output_file, output_folder
from meshtide_codec.printable import shown
from meshtide_codec.stream.container import MAGIC, PREAMBLE_BYTES

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_client.link.lossy_link import LinkReport, LossyLink
    from meshtide_client.streaming import LevelFigures, ReceivedLevel
    from meshtide_client.tide_address import Address
    from meshtide_client.transport import Link
    from meshtide_codec.limits import Limits
    from meshtide_codec.mesh import Mesh
    from meshtide_codec.stream.header import StreamHeader
    from meshtide_codec.stream.session import Until

_PARTIAL_SUFFIX = ".partial.tide"
_LONGEST_NAME = 255
"""Bytes of a file name that common file systems take."""


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
    link_report: LinkReport | None = None


@dataclass(frozen=True, slots=True)
class Destination:
    """Where a fetch leaves its files.

    Args:
        output: file of the finest mesh, or None.
        stream_file: `.tide` file of the packets, kept afterwards, or None.
        keep_levels: folder for the mesh of each level, or None.
        overwrite: whether files of meshes that are there already are replaced.
        kind: format of the output, in place of what its name tells; what is no regular file is PLY without it.

    Raises:
        MeshFileError: the output's format is unknown.
    """

    output: Path | None = None
    stream_file: Path | None = None
    keep_levels: Path | None = None
    overwrite: bool = True
    kind: str | None = None

    def __post_init__(self) -> None:
        if self.output is not None and f".{self.format}" not in MESH_SUFFIXES:
            told = "its name must end with one of" if self.kind is None else f"{self.kind} is none of the formats"
            raise MeshFileError(f"cannot write {self.output}: {told} {_suffixes()}")

    @property
    def format(self) -> str:
        """Of the output, such as ply."""
        return "ply" if self.output is None else format_of(self.output, self.kind)

    @property
    def partial_path(self) -> Path | None:
        """Where packets are kept while they arrive."""
        if self.stream_file is not None or self.output is None:
            return self.stream_file
        if is_written_in_place(self.output):
            return None
        return self.output.with_name(_partial_name(self.output.name))

    def prepare(self, address: Address) -> None:
        """Make sure that files can be written, and may be, before anything is downloaded.

        Args:
            address: what is fetched; a file of this machine is not written over.

        Raises:
            OptionError: two of the files are one, or one is there that is not to be replaced.
            OSError: a folder may not be written.
        """
        read = [address.location] if isinstance(address, TideAddress) and address.kind == "local" else []
        if self.output is not None:
            check_apart(self.output, self.stream_file)
        self.check_output(*read)
        if self.stream_file is not None and is_written_in_place(self.stream_file):
            raise OptionError(f"{shown(self.stream_file)} is no regular file, which a stream is kept in; name another")
        if self.partial_path is not None:
            output_file(self.partial_path, read, overwrite=self.overwrite, own=_is_download)
        if self.keep_levels is not None:
            check_levels(self.keep_levels, address.file_stem, overwrite=self.overwrite)
            self.keep_levels.mkdir(parents=True, exist_ok=True)
        files = [file for file in (self.output, self.stream_file) if file is not None and not is_written_in_place(file)]
        folders = [self.keep_levels] + [file.parent for file in files]
        for folder in folders:
            if folder is not None:
                _check_writable(folder)

    def check_output(self, *read: Path | str) -> None:
        """Make sure that the output may be written.

        Raises:
            OptionError: it is what is read, or is there and not to be replaced.
        """
        if self.output is not None:
            output_file(self.output, read, overwrite=self.overwrite)

    def open(self, limits: Limits | None, notify: Callable[[str], None] | None) -> Holding:
        """The holding that packets go into.

        Raises:
            OptionError: the stream file holds something else, and is not to be replaced.
            TransferError: another process is writing it.
            OSError: it cannot be read or written.
        """
        path = self.partial_path
        if path is None:
            return Holding()
        own = self.stream_file is None
        return PartialFile(path, limits=limits, notify=notify, disposable=own, keep=not own and not self.overwrite)


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
    loss: LossyLink | None = None,
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
        notify: is told in one sentence what a person should know, such as that a connection was lost.
        progress: is called with the bytes of the file that are there, and that there will be.
        transport: "websocket", "http" (ranges of the file), "download" (one plain request), or "auto" for the first
            of them that works.
        loss: a lossy link that the packets go over before they are decoded, for experiments.
        overwrite: whether files of meshes that are there already are replaced; a stream file that holds another stream
            is renamed.
        kind: format of the output, such as obj, in place of what its name tells.

    Raises:
        OptionError: `url` is not the address of a mesh, or cannot be read by that transport, or `until` allows less
            than the coarsest level, or the lossy link cannot be; a file is what is read, or is there and not to be
            replaced.
        TransferError: there was no connection, or it was lost too often; the message says what is kept.
        ProtocolError, PeerError: what answers is not a meshtide server, or it refused.
        StreamError: the stream is damaged or over the limits.
        MeshFileError, OSError: a file cannot be written.
    """
    address = parse_address(url)
    destination = Destination(_path(output), _path(stream_file), _path(keep_levels), overwrite, kind)
    destination.prepare(address)
    holding = destination.open(limits, notify)
    try:
        destination.check_output()  # another fetch may have finished since
        settings: dict[str, Any] = {
            "until": until,
            "link": link,
            "limits": limits,
            "notify": notify,
            "progress": progress,
            "transport": transport,
        }
        reception = (
            Reception(address, holding, **settings)
            if loss is None
            else LossyReception(address, holding, loss, **settings)
        )
        result = _run(_Fetch(address, destination, reception, on_level))
        if destination.output is not None:
            save_mesh(result.mesh, destination.output, kind=destination.format, replace=overwrite)
        if isinstance(holding, PartialFile) and destination.stream_file is None:
            holding.discard()
    except KeyboardInterrupt:
        if notify is not None and holding.header is not None:
            notify(holding.told())
        raise
    finally:
        holding.close()
    return result


@dataclass(frozen=True, slots=True)
class _Fetch:
    """One fetch under way."""

    address: Address
    destination: Destination
    reception: Reception
    on_level: Callable[[ReceivedLevel], None] | None

    async def result(self) -> FetchResult:
        """Wait for all levels."""
        last: ReceivedLevel | None = None
        written: set[str] = set()
        levels: list[LevelFigures] = []
        async with aclosing(self.reception.levels()) as arriving:
            async for level in arriving:
                last = level
                levels.append(level.figures)
                if self.destination.keep_levels is not None:
                    name = f"{self.address.file_stem}-level-{level.level}.ply"
                    replace = self.destination.overwrite or name in written
                    path = self.destination.keep_levels / name
                    await asyncio.to_thread(_save, level.mesh, path, replace=replace)
                    written.add(name)
                if self.on_level is not None:
                    self.on_level(level)
        header = self.reception.header
        assert header is not None  # noqa: S101 - no stream ends without
        if last is None:
            least = PREAMBLE_BYTES + len(header.to_bytes()) + header.level_bytes(header.levels[0])
            raise OptionError(f"the bound allows no level; the coarsest takes {least} bytes")
        return FetchResult(
            address=self.address,
            header=header,
            mesh=last.mesh,
            figures=last.figures,
            levels=tuple(levels),
            received_bytes=self.reception.received_bytes,
            more=self.reception.more,
            seconds=self.reception.seconds,
            transport=self.reception.transport or "none",
            link_report=self.reception.link_report if isinstance(self.reception, LossyReception) else None,
        )


def _run(under_way: _Fetch) -> FetchResult:
    """Run to the end, also where an event loop is running already, as in a notebook."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        pass
    else:
        return _run_in_thread(under_way)
    with orderly_termination():  # levels are written by other threads
        return asyncio.run(under_way.result())


def _run_in_thread(under_way: _Fetch) -> FetchResult:
    with ThreadPoolExecutor(max_workers=1) as executor:
        return executor.submit(lambda: asyncio.run(under_way.result())).result()


def check_levels(folder: Path, stem: str, *, overwrite: bool) -> None:
    """Make sure that levels of a mesh may be written into a folder.

    Raises:
        OptionError: it is a file, or holds levels of that name that are not to be replaced.
        OSError: it may not be written.
    """
    output_folder(folder)
    found = [] if overwrite else sorted(folder.glob(f"{glob.escape(stem)}-level-*.ply"))
    if found:
        raise OptionError(f"{shown(found[0])} is there already; name another folder, or add --overwrite")


def _save(mesh: Mesh, path: Path, *, replace: bool) -> None:
    save_mesh(mesh, path, replace=replace)


def _partial_name(name: str) -> str:
    """The name of the file beside an output; shortened where a file system would not take it."""
    whole = f"{name}{_PARTIAL_SUFFIX}"
    if len(os.fsencode(whole)) <= _LONGEST_NAME:
        return whole
    return f"{hashlib.sha256(os.fsencode(name)).hexdigest()[:32]}{_PARTIAL_SUFFIX}"


def _is_download(path: Path) -> bool:
    """Whether a file begins as a stream does, so that it can be gone on with; an empty one has not got so far."""
    with path.open("rb") as file:
        start = file.read(len(MAGIC))
    return start == MAGIC[: len(start)]


def _check_writable(folder: Path) -> None:
    try:
        with TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror}; the download was not started", str(folder)) from error


def _path(path: Path | str | None) -> Path | None:
    return None if path is None else Path(path)


def _suffixes() -> str:
    return ", ".join(sorted(MESH_SUFFIXES))
