from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_client.connection.address import MeshAddress, ServerAddress
from meshtide_client.connection.link import Link
from meshtide_client.connection.secrecy import shown_address, without_secrets
from meshtide_client.connection.tide_address import parse_address
from meshtide_client.download.fetch import fetch
from meshtide_client.export.site import export_static
from meshtide_codec.errors import MeshtideError, OptionError
from scripted_server import Reply, scripted_server
from streams import encoded_grid
from web_server import WebServer, web_server

WHOLE = encoded_grid().to_bytes()
SECRET = "5ec2e7"  # noqa: S105 - that no message may tell
QUERY = f"X-Amz-Signature={SECRET}&X-Amz-Credential=a%2Fb/{SECRET}&name=c.tide"
LINK = Link(retries=1, delay=0.001, timeout=5.0)


@given(st.text(alphabet="ab:/@?#[]%. ", max_size=30))
def test_any_text_can_be_shown(text: str) -> None:
    for shown in (without_secrets(text), shown_address(text)):
        assert isinstance(shown, str)


@pytest.mark.parametrize(
    "url",
    [
        f"http://h/meshes/vase?{QUERY}",
        f"http://me:{SECRET}@h/vase",
        f"http://me:{SECRET}@h/meshes/vase#{SECRET}",
        f"ftp://me:{SECRET}@h/meshes/vase",
        f"http://me:{SECRET}@:99999/meshes/vase",
        f"http://me:{SECRET}@[::1/meshes/vase?{QUERY}",
        f"s3://bucket/vase.tide?{QUERY}",
        f"s3://me:{SECRET}@bucket/vase.tide",
        f"file://me:{SECRET}@h/vase.tide",
        f"https://h/vase.tide?{QUERY}#{SECRET}",
    ],
)
def test_addresses_that_are_refused_tell_no_secret(url: str) -> None:
    for parse in (parse_address, MeshAddress.parse, ServerAddress.parse):
        try:
            parse(url)
        except OptionError as error:
            assert SECRET not in str(error)


def test_a_signed_url_keeps_its_query_and_shows_it_to_nobody() -> None:
    url = f"https://example.org/bucket/old%20vase.tide?{QUERY}"
    address: Any = parse_address(url)
    assert address.location == url
    assert (address.mesh, address.file_stem) == ("old vase", "old_vase")
    for shown in (str(address), repr(address), address.shown):
        assert SECRET not in shown


@pytest.mark.parametrize("transport", ["http", "download"])
def test_a_signed_url_is_fetched_and_resumed(transport: str, tmp_path: Path) -> None:
    told: list[str] = []
    output = tmp_path / "vase.ply"
    partial = tmp_path / "vase.ply.partial.tide"

    def attempt(server: WebServer) -> Any:
        url = f"{server.url}/bucket/vase.tide?{QUERY}"
        return fetch(url, output, link=LINK, transport=transport, notify=told.append)

    with web_server(WebServer(WHOLE, cuts=[len(WHOLE) - 9, 50])) as server:
        with pytest.raises(MeshtideError) as caught:
            attempt(server)
        told.append(str(caught.value))
        assert partial.exists()
        kept = partial.read_bytes()
        result = attempt(server)
    assert {path for path, _ in server.requests} == {f"/bucket/vase.tide?{QUERY}"}
    assert WHOLE.startswith(kept)
    assert str(result.address) == f"{server.url}/bucket/vase.tide"
    assert told
    assert not any(SECRET in sentence for sentence in told)
    assert SECRET.encode() not in kept
    assert {path.name for path in tmp_path.iterdir()} == {"vase.ply"}


@pytest.mark.parametrize(
    "reply",
    [
        Reply(404),
        Reply(403),
        Reply(503),
        Reply(302, headers={"Location": f"ftp://me:{SECRET}@elsewhere/vase.tide?{QUERY}"}),
        Reply(302, headers={"Location": f"http://me:{SECRET}@[bad/vase.tide?{QUERY}"}),
        Reply(302, headers={"Location": f"/vase.tide?{QUERY}"}),
        Reply(206, b"abc", {"Content-Range": "bytes 7-9/10"}),
        Reply(200, b"abc", {"Content-Encoding": "br"}),
        Reply(200, b"abc", {"Content-Encoding": "gzip"}),
        Reply(200, b"abc", {"Content-Length": "9", "Connection": "close"}),
    ],
    ids=lambda reply: f"{reply.status} {' '.join(reply.headers)}",
)
def test_no_trouble_with_a_signed_url_tells_its_query(reply: Reply, tmp_path: Path) -> None:
    told: list[str] = []
    with scripted_server(lambda *_: reply) as url:
        for place in (f"{url}/vase.tide?{QUERY}", f"{url.replace('//', f'//me:{SECRET}@')}/meshes/vase"):
            with pytest.raises(MeshtideError) as caught:
                fetch(place, tmp_path / "vase.ply", link=LINK, notify=told.append)
            assert SECRET not in "".join([str(caught.value), *told])


def test_an_export_tells_no_query(tmp_path: Path) -> None:
    told: list[str] = []
    with web_server(WebServer(WHOLE)) as server:
        asyncio.run(
            export_static([f"{server.url}/vase.tide?{QUERY}"], tmp_path / "site", link=LINK, notify=told.append)
        )
        server.status = 500
        failed = asyncio.run(export_static([f"{server.url}/cup.tide?{QUERY}"], tmp_path / "site", link=LINK)).failed
    assert (tmp_path / "site/meshes/vase.tide").read_bytes() == WHOLE
    written = b"".join(path.read_bytes() for path in (tmp_path / "site").rglob("*") if path.is_file())
    assert SECRET not in "".join([*told, str(failed)])
    assert len(failed) == 1
    assert SECRET.encode() not in written
