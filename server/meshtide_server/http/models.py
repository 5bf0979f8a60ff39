"""What the HTTP interface says, as pydantic models: they make the JSON and its description."""

from __future__ import annotations

from datetime import datetime  # noqa: TC003 - pydantic reads the annotations
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue

from meshtide_codec.effort import Effort  # noqa: TC001 - pydantic reads the annotations
from meshtide_server.catalogue import Status  # noqa: TC001 - pydantic reads the annotations
from meshtide_server.hosting.search import box_of

if TYPE_CHECKING:
    from meshtide_server.hosting.mesh import HostedMesh
    from meshtide_server.hosting.stream import HostedStream

_SUMMARY: dict[str, JsonValue] = {
    "id": "stanford-bunny",
    "name": "stanford-bunny.ply",
    "status": "ready",
    "stage": None,
    "progress": 1.0,
    "reason": None,
    "vertices": 34834,
    "faces": 69451,
    "levels": 6,
    "bytes": 94120,
    "box": {"minimum": [-0.09469, 0.03299, -0.06187], "maximum": [0.06101, 0.18732, 0.0588]},
    "tags": ["scan", "animal"],
    "licence": "CC BY 4.0",
    "created": "2026-11-02T09:30:00Z",
    "updated": "2026-11-02T09:30:04Z",
}
_LEVEL: dict[str, JsonValue] = {
    "level": 0,
    "packets": 16,
    "bytes": 94120,
    "vertices": 34834,
    "faces": 69451,
    "rms": 0.0,
    "maximum": 0.0,
}
_PACKET: dict[str, JsonValue] = {
    "index": 0,
    "kind": "Base",
    "level": 5,
    "slice": 0,
    "offset": 412,
    "length": 1630,
    "checksum": "1f0c3a77",
    "sha256": "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
}


class Problem(BaseModel):
    """Why a request could not be answered."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"error": "unknown-mesh", "message": "there is no mesh 'teapot'; GET /meshes lists them all"}]
        }
    )

    error: str = Field(description="Short code, for programs.")
    message: str = Field(description="What is wrong and what to do, for people.")


class Health(BaseModel):
    """That the server answers, and how its meshes are."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"status": "ok", "version": "0.1.0", "meshes": {"ready": 3, "encoding": 1, "failed": 0}}]
        }
    )

    status: Literal["ok"] = "ok"
    version: str
    meshes: dict[str, int] = Field(description="How many meshes are in which state.")


class ReadinessReport(BaseModel):
    """Whether the server can do its work."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"ready": True, "parts": {"library": "ok"}}]})

    ready: bool = Field(description="Whether every part can be used.")
    parts: dict[str, str] = Field(description="Each part, and `ok` or why it cannot be used.")


class Index(BaseModel):
    """Where everything is."""

    name: str = "meshtide"
    version: str
    meshes: str = "/meshes"
    documentation: str = "/docs"


class BoxModel(BaseModel):
    """An axis-parallel box, in the mesh's own units."""

    minimum: tuple[float, float, float]
    maximum: tuple[float, float, float]


class MeshSummary(BaseModel):
    """One hosted mesh."""

    model_config = ConfigDict(json_schema_extra={"examples": [_SUMMARY]})

    id: str = Field(description="Its id in URLs.")
    name: str = Field(description="Name of its file or sample.")
    status: Status = Field(description="Whether it can be fetched yet.")
    stage: str | None = Field(description="What is being done, while it is encoding.")
    progress: float = Field(description="The fraction of that stage that is done; 1 when ready.", ge=0.0, le=1.0)
    reason: str | None = Field(description="Why it failed.")
    vertices: int | None = Field(description="Vertices of the finest level, once known.")
    faces: int | None = Field(description="Faces of the finest level, once known.")
    levels: int | None = Field(description="How many states the stream can show, once known.")
    bytes: int | None = Field(description="Size of the whole stream, once known.")
    box: BoxModel | None = Field(None, description="That holds the mesh, once known.")
    tags: list[str] = Field([], description="Of a published mesh.")
    licence: str | None = Field(None, description="The text of a published mesh's terms.")
    created: datetime | None = Field(None, description="When it was first published.")
    updated: datetime | None = Field(None, description="When it was last changed.")
    source: str | None = Field(None, description="SHA-256 of the published file that it was made of, in hexadecimal.")

    @classmethod
    def of(cls, mesh: HostedMesh) -> MeshSummary:
        """The summary of `mesh`."""
        record, box = mesh.record, box_of(mesh)
        vertices, faces, levels, size = _sizes(mesh)
        return cls(
            id=mesh.id,
            name=mesh.source.name,
            status=mesh.status,
            stage=mesh.stage or None,
            progress=mesh.progress,
            reason=mesh.reason,
            vertices=vertices,
            faces=faces,
            levels=levels,
            bytes=size,
            box=BoxModel(minimum=box.minimum, maximum=box.maximum) if box else None,
            tags=list(record.tags) if record else [],
            licence=record.licence if record else None,
            created=record.created if record else None,
            updated=record.updated if record else None,
            source=record.source if record else None,
        )


def _sizes(mesh: HostedMesh) -> tuple[int | None, int | None, int | None, int | None]:
    """Vertices, faces, levels and bytes of a mesh, as far as they are known."""
    if mesh.stream is not None:
        header = mesh.stream.header
        return header.vertices, header.faces, len(header.levels), mesh.stream.size
    if mesh.record is not None:
        return mesh.record.vertices, mesh.record.faces, mesh.record.levels, mesh.record.size
    return None, None, None, None


class LevelRow(BaseModel):
    """One state that a client can show."""

    model_config = ConfigDict(json_schema_extra={"examples": [_LEVEL]})

    level: int = Field(description="Its number; 0 is the finest.")
    packets: int = Field(description="How many packets, from the first, it needs.")
    bytes: int = Field(description="How much of the .tide file, from its start, it needs.")
    vertices: int
    faces: int
    rms: float = Field(description="RMS distance from the finest mesh, as a fraction of its box's diagonal.")
    maximum: float = Field(description="Largest distance, in the same unit.")


class PacketRow(BaseModel):
    """One packet; its bytes are `offset` to `offset + length - 1` of the .tide file."""

    model_config = ConfigDict(json_schema_extra={"examples": [_PACKET]})

    index: int
    kind: str = Field(description="Base, Map&Conn, Param, Diff, ...")
    level: int
    slice: int
    offset: int = Field(description="Where it starts in the .tide file.")
    length: int
    checksum: str = Field(description="CRC-32, in hexadecimal.")
    sha256: str = Field(description="SHA-256, in hexadecimal: its address is /packets/{sha256}.")


class MeshDetail(BaseModel):
    """All that is known of a mesh, and the header of its stream."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "stanford-bunny",
                    "name": "stanford-bunny.ply",
                    "status": "ready",
                    "tags": _SUMMARY["tags"],
                    "licence": _SUMMARY["licence"],
                    "created": _SUMMARY["created"],
                    "updated": _SUMMARY["updated"],
                    "box": _SUMMARY["box"],
                    "source": "6b86b273ff34fce19d6b804eff5a3f5747ada4eaa22f1d49c01e52ddb7875b4b",
                    "sha256": "d4735e3a265e16eee03f59718b9b5d03019c07d8b6c51f90da3a666eec13ab35",
                    "vertices": _SUMMARY["vertices"],
                    "faces": _SUMMARY["faces"],
                    "fingerprint": "5b0c0f4e" * 8,
                    "profile": "compact",
                    "effort": "high",
                    "options": {"effort": "high", "strengths": [8, 4, 1, 0], "mirror": None, "slices": [0]},
                    "bits": 12,
                    "origin": [-0.09469, 0.03299, -0.06187],
                    "extent": 0.1557,
                    "bytes": 94120,
                    "levels": [_LEVEL],
                    "packets": [_PACKET],
                }
            ]
        }
    )

    id: str
    name: str
    status: Status = Field(description="Always ready: others are refused with the reason.")
    tags: list[str] = Field([], description="Of a published mesh.")
    licence: str | None = Field(None, description="The text of a published mesh's terms.")
    created: datetime | None = Field(None, description="When it was first published.")
    updated: datetime | None = Field(None, description="When it was last changed.")
    box: BoxModel | None = Field(description="That holds the mesh.")
    source: str | None = Field(None, description="SHA-256 of the uploaded file, in hexadecimal, if there was one.")
    sha256: str | None = Field(None, description="SHA-256 of a published mesh's .tide file, in hexadecimal.")
    vertices: int = Field(description="Vertices of the finest level.")
    faces: int = Field(description="Faces of the finest level.")
    fingerprint: str = Field(description="Of the stream, in hexadecimal; also the entity tag of the .tide file.")
    profile: str
    effort: Effort | None = Field(description="What counted when it was encoded; none in profile classic.")
    options: dict[str, Any] = Field(description="The header's fields of the stream's profile.")
    bits: int = Field(description="Quantization bits per coordinate.")
    origin: tuple[float, float, float] = Field(description="Position of grid point (0, 0, 0).")
    extent: float = Field(description="Length of the grid's side.")
    bytes: int = Field(description="Size of the whole .tide file.")
    levels: list[LevelRow] = Field(description="In the order in which they become complete.")
    packets: list[PacketRow] = Field(description="In transmission order.")

    @classmethod
    def of(cls, mesh: HostedMesh, stream: HostedStream) -> MeshDetail:
        """The description of `stream`, which is `mesh`'s."""
        header, record, box = stream.header, mesh.record, box_of(mesh)
        return cls(
            id=mesh.id,
            name=mesh.source.name,
            status=mesh.status,
            tags=list(record.tags) if record else [],
            licence=record.licence if record else None,
            created=record.created if record else None,
            updated=record.updated if record else None,
            box=BoxModel(minimum=box.minimum, maximum=box.maximum) if box else None,
            source=record.source if record else None,
            sha256=record.stream if record else None,
            vertices=header.vertices,
            faces=header.faces,
            fingerprint=stream.fingerprint,
            profile=header.profile,
            effort=header.options.effort,
            options=header.options.plain(),
            bits=header.bits,
            origin=header.origin,
            extent=header.extent,
            bytes=stream.size,
            levels=[
                LevelRow(
                    level=row.level,
                    packets=row.packet_count,
                    bytes=stream.level_bytes(row),
                    vertices=row.vertices,
                    faces=row.faces,
                    rms=row.rms,
                    maximum=row.maximum,
                )
                for row in header.levels
            ],
            packets=[
                PacketRow(
                    index=index,
                    kind=row.kind.label,
                    level=row.level,
                    slice=row.slice,
                    offset=stream.packet_offset(index),
                    length=row.length,
                    checksum=f"{row.checksum:08x}",
                    sha256=digest.hex(),
                )
                for index, (row, digest) in enumerate(zip(header.packets, stream.packet_digests, strict=True))
            ],
        )
