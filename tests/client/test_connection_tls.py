from __future__ import annotations

import json
import shutil
import ssl
import subprocess
from typing import TYPE_CHECKING, Any

import pytest

from certificates import Authority, private_authority
from meshtide_client.connection.link import Link
from meshtide_client.connection.tls import distrust, named_authorities, tls_context
from meshtide_client.download.stream import stream
from meshtide_client.remote.edit import change_mesh, delete_mesh, list_tags
from meshtide_client.remote.ingest import ingest
from meshtide_client.remote.listing import list_meshes
from meshtide_codec.errors import MeshtideError, OptionError, ProtocolError, TransferError
from scripted_server import Reply, scripted_server
from streams import encoded_grid
from web_server import WebServer, web_server

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

ENCODED = encoded_grid()
WHOLE = ENCODED.to_bytes()
LEVELS = [row.level for row in ENCODED.header.levels]
UNTRUSTED = r"its certificate is not trusted \(.*name the file of its authority with --ca-file or SSL_CERT_FILE"
MESH = {"id": "vase", "name": "vase.ply", "status": "ready", "progress": 1.0}


class Source:
    """A real stream as a server has it."""

    header = ENCODED.header
    header_bytes = ENCODED.header.to_bytes()

    def packet_part(self, index: int, start: int, end: int) -> bytes:
        return bytes(ENCODED.packet_bytes[index][start:end])


@pytest.fixture(name="authority", scope="module")
def _authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return private_authority(tmp_path_factory.mktemp("authority"))


@pytest.fixture(autouse=True)
def _no_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SSL_CERT_FILE", "SSL_CERT_DIR", "AWS_ACCESS_KEY_ID", "AWS_ENDPOINT"):
        monkeypatch.delenv(name, raising=False)


async def levels(url: str, ca_file: Path | None, transport: str = "auto") -> list[int]:
    link = Link(retries=0, timeout=5.0, ca_file=ca_file)
    return [level.level async for level in stream(url, link=link, transport=transport)]


@pytest.mark.parametrize("named", ["option", "environment"])
async def test_websockets_of_a_private_authority(
    named: str, serving: Callable[..., Any], authority: Authority, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with serving(Source(), authority.server) as server:
        assert server.url.startswith("https://127.0.0.1:")
        with pytest.raises(TransferError, match=UNTRUSTED):
            await levels(server.url, None, "websocket")
        assert server.connections == 0
        if named == "environment":
            monkeypatch.setenv("SSL_CERT_FILE", str(authority.file))
        assert await levels(server.url, authority.file if named == "option" else None, "websocket") == LEVELS


@pytest.mark.parametrize("transport", ["http", "download"])
@pytest.mark.parametrize("named", ["option", "environment"])
async def test_files_of_a_private_authority(
    named: str, transport: str, authority: Authority, monkeypatch: pytest.MonkeyPatch
) -> None:
    with web_server(WebServer(WHOLE), authority.server) as server:
        with pytest.raises(TransferError, match=UNTRUSTED):
            await levels(f"{server.url}/vase.tide", None, transport)
        assert server.requests == []
        if named == "environment":
            monkeypatch.setenv("SSL_CERT_FILE", str(authority.file))
        assert (
            await levels(f"{server.url}/vase.tide", authority.file if named == "option" else None, transport) == LEVELS
        )


@pytest.mark.parametrize("named", ["option", "environment"])
async def test_buckets_of_a_private_authority(
    named: str, authority: Authority, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("obstore")
    monkeypatch.setenv("AWS_REGION", "us-east-1")
    with web_server(WebServer(WHOLE), authority.server) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        with pytest.raises(TransferError, match="cannot read s3://museum/vase.tide"):
            await levels("s3://museum/vase.tide", None)
        if named == "environment":
            monkeypatch.setenv("SSL_CERT_FILE", str(authority.file))
        assert await levels("s3://museum/vase.tide", authority.file if named == "option" else None) == LEVELS


REQUESTS: dict[str, Callable[[str, Any, Path], Any]] = {
    "meshes": lambda url, ca, _: list_meshes(url, ca_file=ca),
    "tags": lambda url, ca, _: list_tags(url, ca_file=ca),
    "edit": lambda url, ca, _: change_mesh(f"{url}/meshes/vase", name="vase", ca_file=ca),
    "delete": lambda url, ca, _: delete_mesh(f"{url}/meshes/vase", ca_file=ca),
    "ingest": lambda url, ca, folder: ingest([folder / "vase.ply"], url, ca_file=ca),
}


@pytest.mark.parametrize("name", REQUESTS)
def test_requests_to_a_private_authority(
    name: str, authority: Authority, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "vase.ply").write_bytes(b"ply\n")
    asked: list[str] = []

    def answer(method: str, path: str) -> Reply:
        asked.append(f"{method} {path}")
        if method == "POST":
            return Reply(202, b'{"id": "abc", "mesh": "vase", "state": "done"}')
        return (
            Reply(200, json.dumps(MESH).encode())
            if method == "PATCH"
            else Reply(200, b"[]" if method == "GET" else b"")
        )

    ask = REQUESTS[name]
    with scripted_server(answer, authority.server) as url:
        with pytest.raises(TransferError, match=UNTRUSTED):
            ask(url, None, tmp_path)
        assert asked == []
        ask(url, authority.file, tmp_path)
        done = len(asked)
        monkeypatch.setenv("SSL_CERT_FILE", str(authority.file))
        ask(url, None, tmp_path)
    assert len(asked) == 2 * done > 0


async def test_redirects_to_addresses_without_tls_are_not_followed(authority: Authority) -> None:
    """Nor is what they lead to believed, wherever it lies."""
    with web_server(WebServer(WHOLE)) as plain:
        reply = Reply(302, headers={"Location": f"{plain.url}/meshes"})
        with scripted_server(lambda *_: reply, authority.server) as url:
            for transport in ("websocket", "http", "download"):
                with pytest.raises(
                    ProtocolError,
                    match="is redirected to an address without TLS|is redirected to what is not an address",
                ):
                    await levels(f"{url}/meshes/vase", authority.file, transport)
            with pytest.raises(ProtocolError, match="redirects to an address without TLS"):
                list_meshes(url, ca_file=authority.file)


def test_a_folder_of_authorities(authority: Authority, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if (openssl := shutil.which("openssl")) is None:
        pytest.skip("openssl, which names the files of such a folder, is not installed")
    command = [openssl, "x509", "-noout", "-hash", "-in", str(authority.file)]
    name = subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
    shutil.copy(authority.file, tmp_path / f"{name}.0")
    monkeypatch.setenv("SSL_CERT_DIR", str(tmp_path))
    with scripted_server(lambda *_: Reply(200, b"[]"), authority.server) as url:
        assert list_meshes(url) == ()


def test_what_is_named_stands_in_place_of_the_machines_own(
    authority: Authority, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = private_authority(tmp_path)
    monkeypatch.setenv("SSL_CERT_FILE", str(authority.file))
    assert len(tls_context().get_ca_certs()) == 1
    failing = pytest.raises(TransferError, match=UNTRUSTED)
    with scripted_server(lambda *_: Reply(200, b"[]"), authority.server) as url, failing:
        list_meshes(url, ca_file=other.file)


@pytest.mark.parametrize("content", [None, b"", b"no certificate", b"\xff" * 99])
def test_files_that_are_of_no_use_are_told(
    content: bytes | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "authority.pem"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(OptionError, match=r"authority\.pem, named by --ca-file, "):
        tls_context(file, needed=False)
    with pytest.raises(OptionError, match="--ca-file"):
        named_authorities(file)
    monkeypatch.setenv("SSL_CERT_FILE", str(file))
    with pytest.raises(OptionError, match=r"authority\.pem, named by SSL_CERT_FILE, "):
        tls_context()
    assert tls_context(needed=False).verify_mode == ssl.CERT_REQUIRED
    monkeypatch.delenv("SSL_CERT_FILE")
    monkeypatch.setenv("SSL_CERT_DIR", str(file))
    with pytest.raises(OptionError, match=r"authority\.pem, named by SSL_CERT_DIR, "):
        tls_context()


def test_an_environment_that_makes_no_sense_does_not_matter_without_tls(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SSL_CERT_FILE", str(tmp_path / "missing.pem"))
    with scripted_server(lambda *_: Reply(200, b"[]")) as url:
        assert list_meshes(url) == ()
        with pytest.raises(OptionError, match="SSL_CERT_FILE"):
            list_meshes(url.replace("http:", "https:"))


def test_every_context_verifies_names() -> None:
    context = tls_context()
    assert (context.verify_mode, context.check_hostname) == (ssl.CERT_REQUIRED, True)
    assert len(context.get_ca_certs()) > 20
    assert distrust(MeshtideError("something else")) is None
    assert named_authorities() is None
