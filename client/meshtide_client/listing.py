"""What a server hosts, asked over HTTP."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import httpx

from meshtide_client.address import ServerAddress
from meshtide_client.credentials import authorization, find_token
from meshtide_client.problem import read_problem
from meshtide_codec.errors import PeerError, ProtocolError, TransferError
from meshtide_codec.stream import plain_values

if TYPE_CHECKING:
    from collections.abc import Mapping

_DEFAULT_TIMEOUT = 30.0
_LONGEST_TEXT = 1000
_LARGEST_ANSWER = 1 << 26
STATIC_INDEX = "index.json"
"""Name of the list of meshes in the folder `meshes` of a static copy."""


@dataclass(frozen=True, slots=True)
class HostedMesh:
    """One mesh of a server.

    Args:
        id: its id in URLs.
        name: of its file or sample.
        status: "ready", "encoding" or "failed".
        stage: what is being done while it is encoding.
        progress: the fraction of that stage that is done.
        reason: why it failed.
        vertices: of the finest level; like the next three, None while it is not known.
        faces: of the finest level.
        levels: how many states its stream can show.
        bytes: size of the stream.
    """

    id: str
    name: str
    status: str
    stage: str | None
    progress: float
    reason: str | None
    vertices: int | None
    faces: int | None
    levels: int | None
    bytes: int | None


def list_meshes(url: str, *, timeout: float = _DEFAULT_TIMEOUT, token: str | None = None) -> tuple[HostedMesh, ...]:
    """The meshes of the server at `url`, such as ``http://localhost:8000``, or of a static copy of one.

    Args:
        url: the server's address.
        timeout: seconds without any news.
        token: to be shown to the server, or None for that of the environment.

    Raises:
        OptionError: `url` is not the address of a server.
        TransferError: there is no connection within `timeout` seconds, or it was lost.
        ProtocolError, PeerError: what answers is not a meshtide server, or it refused.
    """
    server = ServerAddress.parse(url)
    token = token or find_token()
    try:
        answer = _get(server, server.listing_url, timeout, token)
        if answer is None:
            raise ProtocolError(f"{server.listing_url} does not list meshes (no JSON); check the address")
    except PeerError:
        raise
    except ProtocolError as error:
        try:  # a static copy has the list in a file
            answer = _get(server, f"{server.listing_url}/{STATIC_INDEX}", timeout, token)
        except (ProtocolError, TransferError):
            raise error from None
    try:
        if isinstance(answer, dict):
            answer = answer.get("meshes")
        return tuple(_hosted_mesh(row) for row in plain_values.array(answer, "the list of meshes"))
    except (plain_values.BadValueError, LookupError, TypeError) as error:
        raise ProtocolError(f"{server.listing_url} does not list meshes ({error}); check the address") from error


def _get(server: ServerAddress, url: str, timeout: float, token: str | None) -> Any:  # noqa: ANN401 - anything may come
    try:
        with (
            httpx.Client(
                timeout=timeout,
                trust_env=not server.is_loopback,
                follow_redirects=True,
                headers=authorization(token),
            ) as client,
            client.stream("GET", url) as response,
        ):
            body = bytearray()
            for piece in response.iter_bytes():
                body += piece
                if len(body) > _LARGEST_ANSWER:
                    raise ProtocolError(f"{url} answers with more than {_LARGEST_ANSWER} bytes; check the address")
    except httpx.TimeoutException as error:
        raise TransferError(f"{server} did not answer within {timeout:g} seconds") from error
    except httpx.RemoteProtocolError as error:
        raise ProtocolError(f"what answers at {server} is not a meshtide server ({error})") from error
    except httpx.HTTPError as error:
        raise TransferError(f"cannot reach {server}: {error}") from error
    value = _json(bytes(body))
    if response.status_code != httpx.codes.OK:
        if (problem := read_problem(bytes(body))) is not None:
            raise problem
        raise ProtocolError(f"{url} answered with HTTP status {response.status_code}; check the address")
    return value


def _json(body: bytes) -> Any:  # noqa: ANN401 - anything may come
    try:
        return json.loads(body)
    except (ValueError, RecursionError):
        return None


def _hosted_mesh(row: Mapping[str, Any]) -> HostedMesh:
    def text(name: str) -> str:
        return plain_values.text(row[name], name, _LONGEST_TEXT)

    def count(name: str) -> int | None:
        return None if row.get(name) is None else plain_values.integer(row[name], name)

    return HostedMesh(
        id=text("id"),
        name=text("name"),
        status=text("status"),
        stage=None if row.get("stage") is None else text("stage"),
        progress=plain_values.number(row["progress"], "progress", 0.0, 1.0),
        reason=None if row.get("reason") is None else text("reason"),
        vertices=count("vertices"),
        faces=count("faces"),
        levels=count("levels"),
        bytes=count("bytes"),
    )
