"""What a server is asked for by whoever looks after its meshes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import httpx

from meshtide_client.address import MeshAddress, ServerAddress
from meshtide_client.credentials import authorization, find_token
from meshtide_client.listing import hosted_mesh
from meshtide_client.problem import read_problem
from meshtide_codec.errors import OptionError, ProtocolError, TransferError
from meshtide_codec.stream import plain_values

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_client.listing import HostedMesh

_TIMEOUT = 30.0
_LONGEST_TAG = 1000


def change_mesh(
    url: str,
    *,
    name: str | None = None,
    tags: Sequence[str] | None = None,
    licence: str | None = None,
    timeout: float = _TIMEOUT,
    token: str | None = None,
) -> HostedMesh:
    """Change what is told of a published mesh, without encoding it again; what is None stays as it is.

    Args:
        url: of the mesh, such as ``http://localhost:8000/meshes/vase``.
        name: for people.
        tags: all of them.
        licence: the text of its terms.
        timeout: seconds without any news.
        token: for writing, or None for that of the environment.

    Raises:
        OptionError: `url` names no mesh, or nothing is to be changed.
        PeerError: the server refused.
        TransferError, ProtocolError: there is no connection, or what answers is no meshtide server.
    """
    address = MeshAddress.parse(url)
    told = {"name": name, "tags": None if tags is None else list(tags), "licence": licence}
    change = {key: value for key, value in told.items() if value is not None}
    if not change:
        raise OptionError("nothing is to be changed; give a name, tags or a licence")
    answer = _ask(address.server, "PATCH", address.page_url, timeout, token, json=change)
    try:
        return hosted_mesh(answer)
    except (plain_values.BadValueError, LookupError, TypeError, AttributeError) as error:
        raise ProtocolError(f"{address} does not describe a mesh ({error}); check the address") from error


def delete_mesh(url: str, *, timeout: float = _TIMEOUT, token: str | None = None) -> None:
    """Take a published mesh away, for good; raises as `change_mesh` does.

    Args:
        url: of the mesh.
        timeout: seconds without any news.
        token: for writing, or None for that of the environment.
    """
    address = MeshAddress.parse(url)
    _ask(address.server, "DELETE", address.page_url, timeout, token)


def list_tags(url: str, *, limit: int = 1000, timeout: float = _TIMEOUT, token: str | None = None) -> dict[str, int]:
    """The tags of a server's published meshes and how many meshes have each, those of most meshes first.

    Args:
        url: of the server, such as ``http://localhost:8000``.
        limit: how many at most, up to 1000.
        timeout: seconds without any news.
        token: to be shown to the server, or None for that of the environment.

    Raises:
        OptionError, PeerError, TransferError, ProtocolError: as `change_mesh`.
    """
    server = ServerAddress.parse(url)
    place = f"{server.listing_url.rpartition('/')[0]}/tags"
    answer = _ask(server, "GET", place, timeout, token, params={"limit": limit})
    try:
        rows = plain_values.array(answer, "the list of tags")
        return {
            plain_values.text(row["tag"], "tag", _LONGEST_TAG): plain_values.integer(row["meshes"], "meshes")
            for row in rows
        }
    except (plain_values.BadValueError, LookupError, TypeError) as error:
        raise ProtocolError(f"{server} does not list tags ({error}); check the address") from error


def _ask(
    server: ServerAddress,
    method: str,
    url: str,
    timeout: float,
    token: str | None,
    **more: Any,  # noqa: ANN401 - httpx's
) -> Any:  # noqa: ANN401 - anything may come
    """The JSON that is answered; None for an answer without a body."""
    headers = authorization(token or find_token())
    try:
        with httpx.Client(timeout=timeout, trust_env=not server.is_loopback, headers=headers) as client:
            response = client.request(method, url, **more)
    except httpx.TimeoutException as error:
        raise TransferError(f"{server} did not answer within {timeout:g} seconds") from error
    except httpx.RemoteProtocolError as error:
        raise ProtocolError(f"what answers at {server} is not a meshtide server ({error})") from error
    except httpx.HTTPError as error:
        raise TransferError(f"cannot reach {server}: {error}") from error
    if not response.is_success:
        if (problem := read_problem(response.content)) is not None:
            raise problem
        raise ProtocolError(f"{server} answered with HTTP status {response.status_code}; check the address")
    try:
        return response.json() if response.content else None
    except (ValueError, RecursionError) as error:
        raise ProtocolError(f"{server} answered with something else than JSON; check the address") from error
