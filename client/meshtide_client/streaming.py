"""Levels as they arrive: packets in, meshes out, coarse to fine."""

from __future__ import annotations

import math
import sys
import time
from contextlib import aclosing, closing
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_client.arrival import Arrival
from meshtide_client.decoding_thread import DecodingThread
from meshtide_client.holding import Holding
from meshtide_client.partial_file import PartialFile
from meshtide_client.tide_address import parse_address
from meshtide_client.transport import Link
from meshtide_codec.decoder import Decoder
from meshtide_codec.errors import ContainerError
from meshtide_codec.stream.container import PREAMBLE_BYTES
from meshtide_codec.stream.packets import LARGEST_LEVEL
from meshtide_codec.stream.plain_values import LARGEST_INTEGER
from meshtide_codec.stream.session import DoneEvent, HeaderEvent, PacketEvent, Until

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable, Iterable

    from meshtide_client.tide_address import Address
    from meshtide_codec.limits import Limits
    from meshtide_codec.mesh import Mesh
    from meshtide_codec.stream.header import LevelEntry, StreamHeader
    from meshtide_codec.stream.packets import Packet


@dataclass(frozen=True, slots=True)
class LevelFigures:
    """What is known of a level that has arrived, besides its mesh.

    Args:
        level: its number, 0 the finest.
        vertices: its vertex count.
        faces: its face count.
        exact: whether it is as the encoder made it: every packet that it builds on was decoded.
        rms: root mean square distance from the finest mesh, as a fraction of its bounding box's diagonal; NaN where
            a lossy link has left nobody knows what.
        maximum: largest distance, in the same unit.
        size: bytes of the file up to here: preamble, header and packets.
        seconds: since the download began.
    """

    level: int
    vertices: int
    faces: int
    exact: bool
    rms: float
    maximum: float
    size: int
    seconds: float


@dataclass(frozen=True, slots=True)
class ReceivedLevel(LevelFigures):
    """A level that has arrived: its figures and its mesh.

    Args:
        mesh: its vertices and faces as arrays.
    """

    mesh: Mesh

    @property
    def figures(self) -> LevelFigures:
        """The figures alone, to be kept when the mesh is not."""
        return LevelFigures(**{field.name: getattr(self, field.name) for field in fields(LevelFigures)})


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
        notify: is told in one sentence when a connection was lost, a file was damaged, or the stream has changed
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
        reception = Reception(
            address, holding, until=until, link=link, limits=limits, notify=notify, transport=transport
        )
        async with aclosing(reception.levels()) as levels:
            async for level in levels:
                yield level


class Reception:
    """One download and its decoder.

    Args:
        address: the mesh.
        holding: where packets go, and where earlier ones are.
        until: how much of the stream is wanted.
        link: timeout, retries and rate of the connection.
        limits: what the stream may claim.
        notify: is told in one sentence what a person should know.
        progress: is called with the bytes of the file that are there, and that there will be.
        transport: as in `stream`.
    """

    def __init__(
        self,
        address: Address,
        holding: Holding,
        *,
        until: Until | None = None,
        link: Link | None = None,
        limits: Limits | None = None,
        notify: Callable[[str], None] | None = None,
        progress: Callable[[int, int], None] | None = None,
        transport: str = "auto",
    ) -> None:
        self._until = _sendable(until or Until())
        self._limits = limits
        self._holding = holding
        self._progress = progress or (lambda _size, _total: None)
        self._arrival = Arrival(
            address,
            holding,
            until=self._until,
            link=link or Link(),
            notify=notify or (lambda _: None),
            limits=limits,
            transport=transport,
        )
        self._decoder: Decoder | None = None
        self._decoded = 0
        self._nearest = math.inf
        self._wanted = 0
        self._started = time.monotonic()

    @property
    def header(self) -> StreamHeader | None:
        """The stream's header, once it is there."""
        return self._holding.header

    @property
    def more(self) -> bool:
        """Whether the stream has packets that are not held."""
        header = self._holding.header
        return header is None or self._holding.count < len(header.packets)

    @property
    def received_bytes(self) -> int:
        """Bytes of header and packets that have come over the network."""
        return self._arrival.received_bytes

    @property
    def transport(self) -> str | None:
        """The transport that brought what has come."""
        return self._arrival.transport

    @property
    def seconds(self) -> float:
        """Seconds since the download began."""
        return time.monotonic() - self._started

    async def levels(self) -> AsyncGenerator[ReceivedLevel, None]:
        """The levels as they become complete; see `stream` for what is raised."""
        with closing(DecodingThread()) as thread:
            async with aclosing(self._arrival.events()) as events:
                async for event in events:
                    for packet in self._new_packets(event):
                        for level in await thread.run(self._decode, packet):
                            yield level

    def _new_packets(self, event: HeaderEvent | PacketEvent | DoneEvent) -> Iterable[Packet]:
        """The packets that `event` makes available for decoding."""
        packets: Iterable[Packet] = ()
        if isinstance(event, PacketEvent):
            packets = [event.packet]
        elif isinstance(event, HeaderEvent) and (self._decoder is None or not event.resumed):
            self._wanted = self._until.packet_count(event.header, len(event.header_bytes))
            self._decoder = self._new_decoder(event.header)
            self._decoded = 0
            self._nearest = math.inf
            packets = list(self._holding.stored_packets())[: self._wanted]
        header = self._holding.header
        if header is not None:
            total = self._file_size(int(header.packet_offsets[self._wanted]))
            self._progress(min(self._holding.size, total), total)
        return packets

    def _new_decoder(self, header: StreamHeader) -> Decoder:
        return Decoder(header, self._limits)

    def _decode(self, packet: Packet) -> list[ReceivedLevel]:
        """The levels that `packet`, the next one, completes, if they show the mesh better than those before.

        A preview may lie nearer to the surface than the first levels of the hierarchy that follow it. The finest
        level, and one that was asked for by its number, always count; no claim of another one to be as good as the
        finest puts those behind it aside.
        """
        assert self._decoder is not None  # noqa: S101 - the header comes first
        decoder = self._decoder
        decoder.push(packet)
        self._decoded += 1
        completed = []
        for row in decoder.header.levels:
            if row.packet_count == self._decoded and (row.rms < self._nearest or row.level in {0, self._until.level}):
                completed.append(row)
                self._nearest = min(self._nearest, row.rank)
        return [self._received_level(decoder, row) for row in completed]

    def _received_level(self, decoder: Decoder, row: LevelEntry) -> ReceivedLevel:
        """The figures are those of the mesh as it was decoded; what the header says of it may be wrong.

        Raises:
            ContainerError: the level is not there, although the header says that it should be.
        """
        if not decoder.is_available(row.level):
            raise ContainerError(
                f"level {row.level} is not complete after {row.packet_count} packets, as the header says; "
                "the stream is damaged"
            )
        mesh = decoder.mesh(row.level)
        return ReceivedLevel(
            level=row.level,
            vertices=len(mesh.vertices),
            faces=len(mesh.faces),
            exact=decoder.is_exact(row.level),
            rms=row.rms,
            maximum=row.maximum,
            size=self._file_size(decoder.header.level_bytes(row)),
            seconds=self.seconds,
            mesh=mesh,
        )

    def _file_size(self, packet_bytes: int) -> int:
        """Bytes of the file when its packets have so many."""
        return PREAMBLE_BYTES + len(self._holding.header_bytes) + packet_bytes


def _sendable(until: Until) -> Until:
    """The same bounds in numbers that a wire message can hold."""
    level = until.level if until.level is None else min(until.level, LARGEST_LEVEL)
    error = until.error if until.error is None else min(until.error, sys.float_info.max)
    size = until.size if until.size is None else min(until.size, LARGEST_INTEGER)
    return Until(level, error, size)
