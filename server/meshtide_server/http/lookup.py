"""The stream that a request or a websocket asks for, or the refusal that it gets."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING

from meshtide_server.catalogue import CatalogueError, Status
from meshtide_server.http.problems import unavailable
from meshtide_server.refusals import RefusedError
from meshtide_server.store import StoreError

if TYPE_CHECKING:
    from meshtide_server.hosting.library import Library
    from meshtide_server.hosting.mesh import HostedMesh
    from meshtide_server.hosting.stream import HostedStream


async def find_stream(library: Library, mesh_id: str) -> tuple[HostedMesh, HostedStream]:
    """The mesh of that id and its stream.

    Raises:
        RefusedError: there is no such mesh, or it is not ready, or it has failed, or cannot be looked up now.
    """
    try:
        found = await library.find(mesh_id)
    except (StoreError, CatalogueError) as error:
        raise unavailable(error) from error
    except OSError as error:
        raise unavailable(StoreError(f"the stream of {mesh_id} cannot be opened: {error}")) from error
    if found is None:
        message = f"there is no mesh {mesh_id[:100]!r}; GET /meshes lists them all"
        raise RefusedError(HTTPStatus.NOT_FOUND, "unknown-mesh", message)
    if found.status == Status.FAILED:
        raise RefusedError(HTTPStatus.CONFLICT, "mesh-failed", found.failed_message)
    if found.stream is None:
        raise RefusedError(HTTPStatus.SERVICE_UNAVAILABLE, "not-ready", found.not_ready_message, retry_after=1)
    return found, found.stream
