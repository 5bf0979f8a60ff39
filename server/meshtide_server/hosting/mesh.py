"""One mesh that the server hosts: where it comes from, how far it is, and its stream once that is ready."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from meshtide_codec.printable import printable
from meshtide_server.catalogue import Status

if TYPE_CHECKING:
    from pathlib import Path

    from meshtide_server.catalogue import MeshRecord
    from meshtide_server.hosting.stream import HostedStream
    from meshtide_server.store.range_reader import FileIdentity

TIDE_SUFFIX = ".tide"


@dataclass(frozen=True, slots=True)
class MeshSource:
    """Where a mesh comes from.

    Args:
        name: file name, or name of the sample.
        path: the file, or None for a sample.
        identity: of the file.
    """

    name: str
    path: Path | None = None
    identity: FileIdentity | None = None

    @property
    def is_stream(self) -> bool:
        """Whether it is a stream already."""
        return self.path is not None and self.path.suffix.lower() == TIDE_SUFFIX


@dataclass
class HostedMesh:
    """A mesh and its state.

    Args:
        id: its id in URLs.
        source: where it comes from.
        status: whether it can be served.
        stage: what is being done while it is encoding.
        progress: the fraction of that stage that is done.
        reason: why it failed.
        stream: its stream, once it is ready.
        record: its record in the catalogue, if it comes from there.
    """

    id: str
    source: MeshSource
    status: Status = Status.ENCODING
    stage: str = "waiting"
    progress: float = 0.0
    reason: str | None = None
    stream: HostedStream | None = field(default=None, repr=False)
    record: MeshRecord | None = field(default=None, repr=False)

    def advance(self, stage: str, progress: float = 0.0) -> None:
        """Note what is being done."""
        self.stage, self.progress = stage, min(max(progress, 0.0), 1.0)

    def succeed(self, stream: HostedStream | None) -> None:
        """The stream is there; None for one that is looked up when it is asked for."""
        self.status, self.stream, self.stage, self.progress = Status.READY, stream, "", 1.0

    def fail(self, reason: str) -> None:
        """It cannot be served."""
        self.status, self.reason, self.stage = Status.FAILED, printable(reason), ""

    @property
    def not_ready_message(self) -> str:
        """For people: how far it is."""
        return f"mesh {self.id!r} is being encoded: {self.stage}, {self.progress:.0%}; try again in a moment"

    @property
    def failed_message(self) -> str:
        """For people: why it cannot be served."""
        return f"mesh {self.id!r} cannot be served: {self.reason}"
