"""What a server hosts, asked over HTTP, page by page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import parse_qs, urlencode, urlsplit

import httpx

from meshtide_client.connection.address import ServerAddress
from meshtide_client.connection.credentials import find_token
from meshtide_client.connection.secrecy import without_secrets
from meshtide_client.remote.web_client import Answer, WebClient, refusal
from meshtide_codec.argument_types import check_type
from meshtide_codec.errors import OptionError, PeerError, ProtocolError, TransferError
from meshtide_codec.stream import plain_values
from meshtide_codec.stream.mesh_query import MeshQuery

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from meshtide_codec.stream.mesh_query import Parameter

_DEFAULT_TIMEOUT = 30.0
_LONGEST_TEXT = 1000
_LONGEST_LICENCE = 1 << 16
_MOST_TAGS = 1000
_MOST_PARAMETERS = 100
_PAGE = 1000
"""Meshes that a server is asked for at a time; no server gives more."""
STATIC_INDEX = "index.json"
"""Name of the list of meshes in the folder `meshes` of a static copy."""


@dataclass(frozen=True, slots=True)
class BoundingBox:
    """An axis-parallel box, in the mesh's own units."""

    minimum: tuple[float, ...]
    maximum: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ListedMesh:
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
        tags: of a published mesh.
        licence: the text of a published mesh's terms.
        created: when it was first published, as ISO 8601 has it.
        updated: when it was last changed.
        box: that holds it, once known.
        source: SHA-256 of the published file that it was made of, in hexadecimal.
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
    tags: tuple[str, ...] = ()
    licence: str | None = None
    created: str | None = None
    updated: str | None = None
    box: BoundingBox | None = None
    source: str | None = None


class _Page(NamedTuple):
    """What came: a value (None for what is no JSON), and the id after which the next page begins, if there is one."""

    value: Any
    next: str | None = None


def list_meshes(
    url: str,
    *,
    search: MeshQuery | None = None,
    limit: int | None = None,
    timeout: float = _DEFAULT_TIMEOUT,
    token: str | None = None,
    ca_file: Path | str | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> tuple[ListedMesh, ...]:
    """The meshes of the server at `url`, such as ``http://localhost:8000``, or of a static copy of one.

    Args:
        url: the server's address.
        search: which of them; all when left out. A static copy cannot be searched.
        limit: how many at most; None for all.
        timeout: seconds without any news.
        token: to be shown to the server, or None for that of the environment.
        ca_file: of the authorities that vouch for the server, or None for those of the environment or the machine.
        progress: called after each page with how many there are by then.

    Raises:
        OptionError: `url` is not the address of a server, or there is a search, and a static copy answers.
        TransferError: there is no connection within `timeout` seconds, or it was lost.
        ProtocolError, PeerError: what answers is not a meshtide server, or it refused.
    """
    check_type("the search", search, MeshQuery, type(None))
    server = ServerAddress.parse(url)
    with WebClient(server, timeout=timeout, token=token or find_token(), ca_file=ca_file) as client:
        return _all_pages(client, server, (search or MeshQuery()).parameters(), limit, progress)


def _all_pages(
    client: WebClient,
    server: ServerAddress,
    wanted: list[Parameter],
    limit: int | None,
    progress: Callable[[int], None],
) -> tuple[ListedMesh, ...]:
    meshes: list[ListedMesh] = []
    after: str | None = None
    while True:
        answer = _page(client, server, _query(wanted, after, None if limit is None else limit - len(meshes)))
        page = _meshes(server, answer.value)
        meshes += page if limit is None else page[: limit - len(meshes)]
        progress(len(meshes))
        if answer.next is None or (limit is not None and len(meshes) >= limit):
            return tuple(meshes)
        if not page or (after is not None and answer.next <= after):
            raise ProtocolError(f"{server} lists the same meshes again and again; check the address")
        after = answer.next


def _query(wanted: list[Parameter], after: str | None, left: int | None) -> list[Parameter]:
    """The parameters of the next page's request."""
    query = [(name, value) for name, value in wanted if name != "after" or after is None]
    if after is not None:
        query.append(("after", after))
    return [*query, ("limit", str(_PAGE if left is None else min(max(left, 1), _PAGE)))]


def _page(client: WebClient, server: ServerAddress, query: list[Parameter]) -> _Page:
    """One page of a server's list; the whole list of a static copy."""
    try:
        answer = _get(client, server.listing_url, query)
        if answer.value is None:
            raise ProtocolError(
                f"{without_secrets(server.listing_url)} does not list meshes (no JSON); check the address"
            )
    except PeerError:
        raise
    except ProtocolError as error:
        try:  # a static copy has the list in a file
            answer = _get(client, f"{server.listing_url}/{STATIC_INDEX}", [])
        except (ProtocolError, TransferError):
            raise error from None
        if any(name != "limit" for name, _ in query):
            raise OptionError(f"{server} is a static copy, which cannot be searched; list it without filters") from None
    return answer


def _meshes(server: ServerAddress, value: Any) -> list[ListedMesh]:  # noqa: ANN401 - anything may come
    try:
        if isinstance(value, dict):
            value = value.get("meshes")
        return [hosted_mesh(row) for row in plain_values.array(value, "the list of meshes")]
    except (plain_values.BadValueError, LookupError, TypeError, AttributeError) as error:
        place = without_secrets(server.listing_url)
        raise ProtocolError(
            f"{place} does not list meshes ({plain_values.fault_of(error)}); check the address"
        ) from error


def _get(client: WebClient, url: str, query: list[Parameter]) -> _Page:
    answer = client.ask("GET", url, params=urlencode(query) or None)
    if answer.status != httpx.codes.OK:
        raise refusal(answer, without_secrets(url))
    try:
        value = answer.value()
    except ValueError:
        value = None
    return _Page(value, _next_id(answer))


def _next_id(answer: Answer) -> str | None:
    """After which id the next page begins; only that is taken of its address, which may be another behind a proxy."""
    try:
        query = urlsplit(answer.links.get("next", {}).get("url", "")).query
        found = parse_qs(query, max_num_fields=_MOST_PARAMETERS).get("after", [None])[-1]
    except ValueError:
        return None
    return None if found is None else found[:_LONGEST_TEXT]


def hosted_mesh(row: Mapping[str, Any]) -> ListedMesh:
    """A mesh as a server describes it in its list.

    Raises:
        BadValueError, LookupError, TypeError: it is no such description.
    """

    def text(name: str) -> str:
        return plain_values.text(row[name], name, _LONGEST_TEXT)

    def count(name: str) -> int | None:
        return None if row.get(name) is None else plain_values.integer(row[name], name)

    def optional(name: str, longest: int = _LONGEST_TEXT) -> str | None:
        return None if row.get(name) is None else plain_values.text(row[name], name, longest)

    def corner(name: str) -> tuple[float, ...]:
        return tuple(plain_values.number(value, name) for value in plain_values.array(row["box"][name], name, 3))

    return ListedMesh(
        id=text("id"),
        name=text("name"),
        status=text("status"),
        stage=optional("stage"),
        progress=plain_values.number(row["progress"], "progress", 0.0, 1.0),
        reason=optional("reason"),
        vertices=count("vertices"),
        faces=count("faces"),
        levels=count("levels"),
        bytes=count("bytes"),
        tags=tuple(plain_values.text(tag, "tag", _LONGEST_TEXT) for tag in _list(row, "tags")[:_MOST_TAGS]),
        licence=optional("licence", _LONGEST_LICENCE),
        created=optional("created"),
        updated=optional("updated"),
        box=None if row.get("box") is None else BoundingBox(corner("minimum"), corner("maximum")),
        source=optional("source"),
    )


def _list(row: Mapping[str, Any], name: str) -> Sequence[Any]:
    value = row.get(name)
    return () if value is None else plain_values.array(value, name)
