"""The routes of whoever looks after a catalogue: a mesh's name, tags and licence, and which tags there are."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, model_validator

from meshtide_server.catalogue import Status, UnknownMeshError
from meshtide_server.catalogue.meshes import LARGEST_PAGE
from meshtide_server.hosting.published import shown
from meshtide_server.http.application import Running  # noqa: TC001 - fastapi reads the annotations
from meshtide_server.http.conditional import conditional_json
from meshtide_server.http.dependencies import READERS, UNAUTHORIZED, require_write
from meshtide_server.http.models import MeshSummary, Problem
from meshtide_server.http.routes.ingest import (
    LONGEST_LICENCE,
    LONGEST_NAME,
    LONGEST_TAG,
    MOST_TAGS,
    NO_NUL,
    PRINTABLE,
    MeshId,
    published_of,
    refuse_folder_mesh,
)
from meshtide_server.refusals import RefusedError

if TYPE_CHECKING:
    from typing import Self

router = APIRouter()

_REFUSALS: dict[int | str, dict[str, Any]] = {
    401: {"model": Problem, "description": "No write token was sent, or one that is not known."},
    403: {"model": Problem, "description": "This server takes no writes."},
    404: {"model": Problem, "description": "There is no such published mesh."},
    409: {"model": Problem, "description": "It lies in the server's folder, or is being encoded."},
}


class MeshChange(BaseModel):
    """A mesh's name, tags and licence from now on; what is left out stays as it is."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"tags": ["scan", "animal"], "licence": "CC BY 4.0"}]}
    )

    name: str | None = Field(
        None, min_length=1, max_length=LONGEST_NAME, pattern=PRINTABLE, description="For people, such as a file's name."
    )
    tags: list[Annotated[str, Field(max_length=LONGEST_TAG, pattern=PRINTABLE)]] | None = Field(
        None, max_length=MOST_TAGS, description="All of them; an empty list takes them away."
    )
    licence: str | None = Field(None, max_length=LONGEST_LICENCE, pattern=NO_NUL, description="The text of its terms.")

    @model_validator(mode="after")
    def _check_anything(self) -> Self:
        if self.name is None and self.tags is None and self.licence is None:
            raise ValueError("nothing is to be changed; give name, tags or licence")
        return self


class TagCount(BaseModel):
    """A tag, and how many meshes have it."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"tag": "scan", "meshes": 120}]})

    tag: str
    meshes: int


_TAGS = TypeAdapter(list[TagCount])


@router.patch(
    "/meshes/{mesh_id}",
    summary="Change a mesh's name, tags or licence",
    tags=["ingest"],
    responses=_REFUSALS,
    dependencies=[Depends(require_write)],
)
async def change_mesh(server: Running, mesh_id: MeshId, change: MeshChange) -> MeshSummary:
    """Change name, tags or licence of a published mesh; its stream stays as it is, and may be kept by caches."""
    published = published_of(server)
    refuse_folder_mesh(server, mesh_id)
    tags = None if change.tags is None else tuple(sorted(set(change.tags)))
    try:
        record = await published.catalogue.change(mesh_id, name=change.name, tags=tags, licence=change.licence)
    except UnknownMeshError as error:
        raise RefusedError(HTTPStatus.NOT_FOUND, "unknown-mesh", f"no mesh {mesh_id!r} is published here") from error
    if record.state == Status.ENCODING:
        message = f"mesh {mesh_id!r} is being encoded, and gets its description with that; try again afterwards"
        raise RefusedError(HTTPStatus.CONFLICT, "encoding", message)
    await published.refresh_mesh(mesh_id)
    return MeshSummary.of(shown(record))


@router.get(
    "/tags",
    summary="Which tags there are",
    response_model=list[TagCount],
    tags=["meshes"],
    responses={
        304: {"description": "What the client holds (If-None-Match) is still the answer."},
        503: {"model": Problem, "description": "The catalogue does not answer."},
        **UNAUTHORIZED,
    },
    dependencies=READERS,
)
async def tags(
    request: Request,
    server: Running,
    limit: Annotated[int, Query(ge=1, le=LARGEST_PAGE, description="How many at most.")] = 100,
) -> Response:
    """The tags of published meshes, those of most meshes first."""
    counts = await server.library.published.tags(limit) if server.library.published is not None else []
    body = _TAGS.dump_json([TagCount(tag=tag, meshes=count) for tag, count in counts])
    return conditional_json(request, body)
