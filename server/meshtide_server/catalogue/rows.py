"""What a catalogue holds, as frozen dataclasses: meshes, streams, packets and jobs."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping

Point = tuple[float, float, float]


class Status(StrEnum):
    """How far a hosted mesh is."""

    ENCODING = "encoding"
    READY = "ready"
    FAILED = "failed"


class JobState(StrEnum):
    """How far a job is."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"


UNFINISHED = frozenset({JobState.QUEUED, JobState.RUNNING})
"""States of jobs that still need their uploaded files."""


class Box(NamedTuple):
    """An axis-parallel box, in the mesh's own units."""

    minimum: Point
    maximum: Point


def now() -> datetime:
    """This moment, in UTC, as precise as the catalogue keeps it."""
    return datetime.now(UTC)


@dataclass(frozen=True, slots=True)
class MeshRecord:
    """One mesh.

    Args:
        id: its id in URLs.
        name: for people, such as a file's name.
        tags: sorted, without doubles.
        licence: the text of its terms.
        state: how far it is.
        reason: why it failed.
        stream: SHA-256 of its `.tide` file, in hexadecimal, once there is one.
        source: SHA-256 of the file that was uploaded, if it was.
        size: of its stream, in bytes.
        vertices: of its finest level.
        faces: of its finest level.
        levels: how many states its stream can show.
        box: that holds it.
        created: when it came into the catalogue.
        updated: when it was last changed.
    """

    id: str
    name: str
    tags: tuple[str, ...] = ()
    licence: str = ""
    state: Status = Status.ENCODING
    reason: str | None = None
    stream: str | None = None
    source: str | None = None
    size: int | None = None
    vertices: int | None = None
    faces: int | None = None
    levels: int | None = None
    box: Box | None = None
    created: datetime = field(default_factory=now)
    updated: datetime = field(default_factory=now)


@dataclass(frozen=True, slots=True)
class StreamRecord:
    """One `.tide` file in the store.

    Args:
        sha256: of the file, in hexadecimal.
        fingerprint: of its header, in hexadecimal.
        header: the header's bytes.
        size: of the file, in bytes.
        packets: SHA-256 of each packet's bytes, in order.
    """

    sha256: str
    fingerprint: str
    header: bytes = field(repr=False)
    size: int
    packets: tuple[bytes, ...] = field(repr=False)


class PacketLocation(NamedTuple):
    """Where a packet lies: its stream, and its bytes there."""

    stream: str
    position: int
    offset: int
    length: int


class MeshDescription(NamedTuple):
    """What is known of a mesh beside its stream; the fields are those of MeshRecord."""

    name: str
    tags: tuple[str, ...]
    licence: str
    source: str | None


@dataclass(frozen=True, slots=True)
class Job:
    """One upload to be encoded.

    Args:
        id: its id in URLs.
        mesh_id: the mesh that it makes.
        source_key: the uploaded file in the store.
        options: how to encode it, as JSON knows it.
        state: how far it is.
        attempts: how often it was begun.
        owner: who works on it.
        heartbeat: when the owner was last heard of.
        stage: what is being done.
        progress: the fraction of that stage that is done.
        error: why it failed, or why its first attempt did.
        created: when it was queued.
        finished: when it was done or failed for good.
        description: of the mesh, once its stream has replaced the one that is there; None if there is none.
        notes: what of the file is not in the stream, or was read differently.
    """

    id: str
    mesh_id: str
    source_key: str
    options: Mapping[str, Any] = field(default_factory=dict)
    state: JobState = JobState.QUEUED
    attempts: int = 0
    owner: str | None = None
    heartbeat: datetime | None = None
    stage: str = "waiting"
    progress: float = 0.0
    error: str | None = None
    created: datetime = field(default_factory=now)
    finished: datetime | None = None
    description: MeshDescription | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class MeshPage:
    """Some of the meshes that were asked for, in the order of their ids.

    Args:
        meshes: themselves.
        next: what to ask for as `after` to get the following ones; None if these are the last.
    """

    meshes: tuple[MeshRecord, ...]
    next: str | None
