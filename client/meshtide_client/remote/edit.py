"""What a server is asked for by whoever looks after its meshes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import httpx

from meshtide_client.connection.address import MeshAddress, ServerAddress
from meshtide_client.connection.credentials import find_token
from meshtide_client.remote.listing import hosted_mesh
from meshtide_client.remote.web_client import WebClient, refusal
from meshtide_codec.errors import OptionError, ProtocolError
from meshtide_codec.stream import plain_values

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from meshtide_client.remote.listing import ListedMesh

_TIMEOUT = 30.0
_LONGEST_TAG = 1000


class _How(NamedTuple):
    """How a server is asked."""

    timeout: float
    token: str | None
    ca_file: Path | str | None


def change_mesh(
    url: str,
    *,
    name: str | None = None,
    tags: Sequence[str] | None = None,
    licence: str | None = None,
    timeout: float = _TIMEOUT,
    token: str | None = None,
    ca_file: Path | str | None = None,
) -> ListedMesh:
    """Change what a server says of a published mesh, without encoding it again; what is None stays as it is.

    Args:
        url: of the mesh, such as ``http://localhost:8000/meshes/vase``.
        name: for people.
        tags: all of them.
        licence: the text of its terms.
        timeout: seconds without any news.
        token: for writing, or None for that of the environment.
        ca_file: of the authorities that vouch for the server, or None for those of the environment or the machine.

    Raises:
        OptionError: `url` names no mesh, or nothing is to be changed.
        PeerError: the server refused.
        TransferError, ProtocolError: there is no connection, or what answers is not a meshtide server.
    """
    address = MeshAddress.parse(url)
    wanted = {"name": name, "tags": None if tags is None else list(tags), "licence": licence}
    change = {key: value for key, value in wanted.items() if value is not None}
    if not change:
        raise OptionError("nothing is to be changed; give a name, tags or a licence")
    answer = _ask(address.server, "PATCH", address.page_url, _How(timeout, token, ca_file), json=change)
    try:
        return hosted_mesh(answer)
    except (plain_values.BadValueError, LookupError, TypeError, AttributeError) as error:
        raise ProtocolError(
            f"{address} does not describe a mesh ({plain_values.fault_of(error)}); check the address"
        ) from error


def delete_mesh(
    url: str, *, timeout: float = _TIMEOUT, token: str | None = None, ca_file: Path | str | None = None
) -> None:
    """Take a published mesh away, for good; raises as `change_mesh` does.

    Args:
        url: of the mesh.
        timeout: seconds without any news.
        token: for writing, or None for that of the environment.
        ca_file: of the authorities that vouch for the server, or None for those of the environment or the machine.
    """
    address = MeshAddress.parse(url)
    _ask(address.server, "DELETE", address.page_url, _How(timeout, token, ca_file))


def list_tags(
    url: str,
    *,
    limit: int = 1000,
    timeout: float = _TIMEOUT,
    token: str | None = None,
    ca_file: Path | str | None = None,
) -> dict[str, int]:
    """The tags of a server's published meshes and how many meshes have each, those of most meshes first.

    Args:
        url: of the server, such as ``http://localhost:8000``.
        limit: how many at most, up to 1000.
        timeout: seconds without any news.
        token: to be shown to the server, or None for that of the environment.
        ca_file: as in `change_mesh`.

    Raises:
        OptionError, PeerError, TransferError, ProtocolError: as `change_mesh`.
    """
    server = ServerAddress.parse(url)
    place = f"{server.listing_url.rpartition('/')[0]}/tags"
    answer = _ask(server, "GET", place, _How(timeout, token, ca_file), params={"limit": limit})
    try:
        rows = plain_values.array(answer, "the list of tags")
        return {
            plain_values.text(row["tag"], "tag", _LONGEST_TAG): plain_values.integer(row["meshes"], "meshes")
            for row in rows
        }
    except (plain_values.BadValueError, LookupError, TypeError) as error:
        raise ProtocolError(
            f"{server} does not list tags ({plain_values.fault_of(error)}); check the address"
        ) from error


def _ask(
    server: ServerAddress,
    method: str,
    url: str,
    how: _How,
    **more: Any,  # noqa: ANN401 - httpx's
) -> Any:  # noqa: ANN401 - anything may come
    """The JSON that is answered; None for an answer without a body."""
    with WebClient(server, timeout=how.timeout, token=how.token or find_token(), ca_file=how.ca_file) as client:
        answer = client.ask(method, url, **more)
    if not httpx.codes.is_success(answer.status):
        raise refusal(answer, str(server))
    try:
        return answer.value() if answer.body else None
    except ValueError as error:
        raise ProtocolError(f"{server} answered with something else than JSON; check the address") from error
