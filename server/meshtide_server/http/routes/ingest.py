"""The routes that change what is hosted: uploads, deletions, and the jobs that encode what was uploaded.

An upload is acknowledged once the file is in the store and its job in the catalogue: whatever happens to the server
after that, the mesh is encoded.
"""

from __future__ import annotations

import asyncio
import json
from http import HTTPStatus
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, Depends, Path, Request, Response
from fastapi import Query as QueryParameters
from fastapi.responses import StreamingResponse
from pydantic import BaseModel, ConfigDict, Field, JsonValue

from meshtide_codec.effort import Effort  # noqa: TC001 - pydantic reads the annotations
from meshtide_codec.errors import OptionError
from meshtide_codec.file_suffix import split_name
from meshtide_codec.quantize import LARGEST_B, SMALLEST_B
from meshtide_server.catalogue import JobState, MeshExistsError, MeshRecord, UnknownJobError, UnknownMeshError
from meshtide_server.encoding.uploads import Upload, check_size, checked_suffix, receive
from meshtide_server.hosting.identifiers import unique_id
from meshtide_server.http.application import Running  # noqa: TC001 - fastapi reads the annotations
from meshtide_server.http.dependencies import require_read, require_write
from meshtide_server.http.models import Problem
from meshtide_server.refusals import RefusedError
from meshtide_server.settings import Profile  # noqa: TC001 - pydantic reads the annotations

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterable

    from meshtide_server.catalogue import Job
    from meshtide_server.hosting.published import PublishedMeshes
    from meshtide_server.http.application import ServerParts
    from meshtide_server.settings import Settings

router = APIRouter()

EVENT_SECONDS = 0.25
"""How often a job is looked at for those who watch it."""
LONGEST_WATCH_SECONDS = 3600.0
"""Events end after so long; who wants more asks again."""
LONGEST_NAME = 200
LONGEST_TAG = 100
MOST_TAGS = 50
LONGEST_LICENCE = 20_000
PRINTABLE = r"^[^\x00-\x1f\x7f]*$"
NO_NUL = r"^[^\x00]*$"
"""PostgreSQL keeps no text with such a character."""
_REFUSALS: dict[int | str, dict[str, Any]] = {
    401: {"model": Problem, "description": "No write token was sent, or one that is not known."},
    403: {"model": Problem, "description": "This server takes no writes."},
}
_UPLOADS: dict[int | str, dict[str, Any]] = {
    400: {"model": Problem, "description": "There is no body."},
    408: {"model": Problem, "description": "Nothing of the body came for too long."},
    409: {"model": Problem, "description": "A mesh of that id lies in the server's folder; it cannot be replaced."},
    413: {"model": Problem, "description": "The file is too large."},
    415: {"model": Problem, "description": "No mesh is read from files of that suffix."},
    **_REFUSALS,
}
_UNKNOWN_JOB: dict[int | str, dict[str, Any]] = {404: {"model": Problem, "description": "There is no such job."}}
_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "description": "The file as it is.",
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}
_EXAMPLE: dict[str, JsonValue] = {
    "id": "7c1e5b0e9d2f4a8c8f3a1b2c3d4e5f60",
    "mesh": "scan",
    "state": "running",
    "stage": "levels",
    "progress": 0.6,
    "attempts": 1,
    "error": None,
    "notes": ["texture coordinates (12), 2 materials: not kept"],
}
MeshId = Annotated[
    str, Path(description="Id of a mesh.", pattern=r"^[a-z0-9_][a-z0-9_-]{0,99}$", examples=["stanford-bunny"])
]
JobId = Annotated[str, Path(description="Id of a job.", examples=["7c1e5b0e9d2f4a8c8f3a1b2c3d4e5f60"])]


class JobStatus(BaseModel):
    """How far a job is."""

    model_config = ConfigDict(json_schema_extra={"examples": [_EXAMPLE]})

    id: str = Field(description="Its id in URLs.")
    mesh: str = Field(description="Id of the mesh that it makes.")
    state: JobState = Field(description="queued, running, done or failed.")
    stage: str = Field(description="What is being done.")
    progress: float = Field(description="The fraction of that stage that is done.", ge=0.0, le=1.0)
    attempts: int = Field(description="How often it was begun; one that dies is begun a second time.")
    error: str | None = Field(description="Why it failed, or why its first attempt did.")
    notes: list[str] = Field(description="What of the file is not in the stream, or was read otherwise.")

    @classmethod
    def of(cls, job: Job) -> JobStatus:
        """The status of `job`."""
        return cls(
            id=job.id,
            mesh=job.mesh_id,
            state=job.state,
            stage=job.stage,
            progress=job.progress,
            attempts=job.attempts,
            error=job.error,
            notes=list(job.notes),
        )


class UploadQuery(BaseModel):
    """What is said of an upload beside its bytes."""

    filename: str = Field(
        description="Name of the file; its suffix gives the format.",
        max_length=LONGEST_NAME,
        pattern=PRINTABLE,
        examples=["scan.ply"],
    )
    tag: list[Annotated[str, Field(max_length=LONGEST_TAG, pattern=PRINTABLE)]] = Field(
        default=[], description="To find it by.", max_length=MOST_TAGS
    )
    licence: str = Field(default="", description="The text of its terms.", max_length=LONGEST_LICENCE, pattern=NO_NUL)
    bits: int | None = Field(default=None, description="Bits per coordinate.", ge=SMALLEST_B, le=LARGEST_B)
    profile: Profile | None = Field(default=None, description="How it is encoded.", examples=["compact"])
    effort: Effort | None = Field(
        default=None,
        description="What counts where it is encoded in profile compact: default, time, or high, size.",
        examples=["high"],
    )

    def mesh(self, mesh_id: str, source: Upload) -> MeshRecord:
        """The mesh as it comes into the catalogue."""
        name = PurePosixPath(self.filename).name
        return MeshRecord(mesh_id, name, tuple(sorted(set(self.tag))), self.licence, source=source.sha256)

    def options(self, settings: Settings) -> dict[str, Any]:
        """How it is to be encoded, as jobs know it.

        Raises:
            RefusedError: 422, an effort that the profile does not know.
        """
        try:
            return settings.encoding.changed(self.bits, self.profile, self.effort).plain()
        except OptionError as error:
            raise RefusedError(HTTPStatus.UNPROCESSABLE_ENTITY, "invalid", str(error)) from error


Query = Annotated[UploadQuery, QueryParameters()]


@router.post(
    "/meshes",
    status_code=202,
    summary="Upload a mesh",
    tags=["ingest"],
    responses=_UPLOADS,
    dependencies=[Depends(require_write)],
    openapi_extra=_BODY,
)
async def upload(request: Request, server: Running, response: Response, query: Query) -> JobStatus:
    """Upload a mesh file, or a .tide file, as the body; its id is made of the file's name.

    curl --data-binary @scan.ply -H "Authorization: Bearer TOKEN" "http://host:8000/meshes?filename=scan.ply"
    """
    stem, suffix = split_name(query.filename)
    options = query.options(server.settings)
    source = await _received(request, server, query)
    taken = await server.library.taken_ids(stem)
    while True:
        mesh_id = unique_id(stem, suffix.lower(), taken)
        try:
            return await _accepted(server, response, query.mesh(mesh_id, source), source, options, replace=False)
        except MeshExistsError:
            taken.add(mesh_id)


@router.put(
    "/meshes/{mesh_id}",
    status_code=202,
    summary="Upload a mesh under an id",
    tags=["ingest"],
    responses=_UPLOADS,
    dependencies=[Depends(require_write)],
    openapi_extra=_BODY,
)
async def put_mesh(request: Request, server: Running, response: Response, mesh_id: MeshId, query: Query) -> JobStatus:
    """Upload a mesh file, or a .tide file, under an id of your own; a published mesh of that id is replaced."""
    refuse_folder_mesh(server, mesh_id)
    options = query.options(server.settings)
    source = await _received(request, server, query)
    return await _accepted(server, response, query.mesh(mesh_id, source), source, options, replace=True)


@router.delete(
    "/meshes/{mesh_id}",
    status_code=204,
    summary="Delete a mesh",
    tags=["ingest"],
    responses={
        404: {"model": Problem, "description": "There is no such published mesh."},
        409: {"model": Problem, "description": "It lies in the server's folder; delete its file there."},
        **_REFUSALS,
    },
    dependencies=[Depends(require_write)],
)
async def delete_mesh(server: Running, mesh_id: MeshId) -> None:
    """Delete a published mesh, with its jobs; its stream goes with the last mesh that has the same."""
    published = published_of(server)
    refuse_folder_mesh(server, mesh_id)
    sources = await _sources_of(published, mesh_id)
    try:
        await published.catalogue.delete(mesh_id)
    except UnknownMeshError as error:
        raise RefusedError(HTTPStatus.NOT_FOUND, "unknown-mesh", f"no mesh {mesh_id!r} is published here") from error
    await published.refresh()
    await _collect(published, sources)


@router.get(
    "/jobs/{job_id}",
    summary="How far an upload is",
    tags=["ingest"],
    responses=_UNKNOWN_JOB,
    dependencies=[Depends(require_read)],
)
async def job_status(server: Running, job_id: JobId) -> JobStatus:
    """The state of a job; it is done when its mesh can be fetched."""
    return JobStatus.of(await _job(server, job_id))


@router.get(
    "/jobs/{job_id}/events",
    summary="Watch an upload",
    tags=["ingest"],
    response_class=StreamingResponse,
    responses={
        200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}, "description": "Its states."},
        **_UNKNOWN_JOB,
    },
    dependencies=[Depends(require_read)],
)
async def job_events(request: Request, server: Running, job_id: JobId) -> Response:
    """Server-sent events: the state of a job whenever it changes, until it is done or has failed."""
    first = await _job(server, job_id)
    headers = {"Cache-Control": "no-cache"}
    if request.method == "HEAD":  # which does not wait for events that it would not get
        return StreamingResponse(iter(()), media_type="text/event-stream", headers=headers)
    return StreamingResponse(_events(server, first), media_type="text/event-stream", headers=headers)


async def _events(server: ServerParts, job: Job) -> AsyncIterator[str]:
    loop = asyncio.get_running_loop()
    end = loop.time() + LONGEST_WATCH_SECONDS
    sent: JobStatus | None = None
    while loop.time() < end and not server.draining.is_set():
        status = JobStatus.of(job)
        if status != sent:
            yield f"event: job\ndata: {json.dumps(status.model_dump(mode='json'))}\n\n"
            sent = status
        if job.state in {JobState.DONE, JobState.FAILED}:
            return
        await asyncio.sleep(EVENT_SECONDS)
        try:
            job = await _job(server, job.id)
        except RefusedError:
            yield "event: gone\ndata: {}\n\n"
            return


async def _received(request: Request, server: ServerParts, query: UploadQuery) -> Upload:
    """The body of an upload, in the store."""
    published, settings = published_of(server), server.settings
    suffix = checked_suffix(query.filename)
    announced = request.headers.get("Content-Length", "")
    if announced.isdecimal():
        check_size(int(announced), settings.max_upload)  # before any of it is read
    return await receive(
        request.stream(),
        suffix,
        published.store,
        published.catalogue,
        limit=settings.max_upload,
        stall_seconds=settings.upload_stall_timeout,
    )


async def _accepted(
    server: ServerParts, response: Response, mesh: MeshRecord, source: Upload, options: dict[str, Any], *, replace: bool
) -> JobStatus:
    """Queue the job of an upload, and answer that it is taken."""
    published = published_of(server)
    earlier = await _sources_of(published, mesh.id) if replace else ()
    _, job = await published.catalogue.add_with_job(mesh, source.key, options, replace=replace, note=source.note)
    await _collect(published, earlier)
    if server.jobs is not None:
        server.jobs.notify()
    response.headers["Location"] = f"/jobs/{job.id}"
    return JobStatus.of(job)


async def _sources_of(published: PublishedMeshes, mesh_id: str) -> set[str]:
    """The uploaded files that a mesh's jobs were for."""
    return {job.source_key for job in await published.catalogue.jobs.list(mesh_id=mesh_id)}


async def _collect(published: PublishedMeshes, sources: Iterable[str]) -> None:
    """Delete uploaded files unless other jobs need them."""
    for key in sources:
        await published.catalogue.sources.collect(key, published.store.delete)


async def _job(server: ServerParts, job_id: str) -> Job:
    """The job; when it is done, this server shows its mesh."""
    published = published_of(server)
    try:
        job = await published.catalogue.jobs.get(job_id)
        if job.state == JobState.DONE:
            await published.refresh_mesh(job.mesh_id)
    except (UnknownJobError, UnknownMeshError) as error:
        raise RefusedError(HTTPStatus.NOT_FOUND, "unknown-job", f"there is no job {job_id[:64]!r}") from error
    return job


def refuse_folder_mesh(server: ServerParts, mesh_id: str) -> None:
    """Nothing, unless a mesh of that id lies in the server's folder, where no request changes anything.

    Raises:
        RefusedError: 409, it does.
    """
    found = server.library.known(mesh_id)
    if found is not None and found.record is None:
        message = f"mesh {mesh_id!r} lies in the server's folder; change its file there"
        raise RefusedError(HTTPStatus.CONFLICT, "folder-mesh", message)


def published_of(server: ServerParts) -> PublishedMeshes:
    """Store and catalogue.

    Raises:
        RefusedError: 403, the server has none.
    """
    published = server.library.published
    if published is None:
        message = "this server has no place to keep meshes; start it with --data, or with a store and a database"
        raise RefusedError(HTTPStatus.FORBIDDEN, "read-only", message)
    return published
