"""`meshtide edit`, `tags` and `delete` against a real server."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import httpx
import pytest
from typer.testing import CliRunner

from meshtide_client.commands.application import build
from meshtide_client.remote.edit import change_mesh, delete_mesh, list_tags
from meshtide_client.remote.listing import list_meshes
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.encoder import encode
from meshtide_codec.errors import OptionError, PeerError, ProtocolError, TransferError
from meshtide_codec.testing import grid
from nginx_proxy import wait_for
from upload_server import TOKEN, taking_uploads
from web_server import WebServer, web_server

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from click.testing import Result


@pytest.fixture(name="url")
def _url(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setenv("MESHTIDE_TOKEN", TOKEN)
    stream = encode(grid(4), CompactOptions(bits=8)).to_bytes()
    with taking_uploads(MESHTIDE_DATA=str(tmp_path / "data")) as (url, _):
        for mesh in ("vase", "cup"):
            answer = httpx.put(
                f"{url}/meshes/{mesh}",
                params={"filename": f"{mesh}.tide", "tag": "clay"},
                content=stream,
                headers={"Authorization": f"Bearer {TOKEN}"},
            )
            assert answer.status_code == 202, answer.text
        for mesh in ("vase", "cup"):
            wait_for(f"{url}/meshes/{mesh}")
        yield url


def meshtide(*arguments: str) -> Result:
    return CliRunner().invoke(build(), list(arguments))


def test_a_catalogue_is_looked_after(url: str) -> None:
    done = meshtide("edit", f"{url}/meshes/vase", "--tag", "greek", "--tag", "clay", "--licence", "CC0", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["tags"] == ["clay", "greek"]
    assert meshtide("tags", url).stdout == "2\tclay\n1\tgreek\n"
    assert json.loads(meshtide("tags", url, "--limit", "1", "--json").stdout) == {"tags": {"clay": 2}}
    assert "vase: vase.tide; tags: none; terms: CC0" in meshtide("edit", f"{url}/meshes/vase", "--no-tags").output
    refused = CliRunner().invoke(build(), ["delete", f"{url}/meshes/vase"], input="n\n")
    assert refused.exit_code != 0
    assert len(list_meshes(url)) == 2
    assert "is deleted" in CliRunner().invoke(build(), ["delete", f"{url}/meshes/vase"], input="y\n").output
    both = meshtide("delete", f"{url}/meshes/cup", "--yes", "--json")
    assert json.loads(both.stdout) == {"deleted": [f"{url}/meshes/cup"]}
    assert list_meshes(url) == ()


def test_what_cannot_be_done_is_told(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(OptionError, match="nothing is to be changed"):
        change_mesh(f"{url}/meshes/vase")
    with pytest.raises(OptionError, match="names no mesh"):
        delete_mesh(url)
    assert isinstance(meshtide("edit", f"{url}/meshes/a", "--tag", "a", "--no-tags").exception, OptionError)
    with pytest.raises(PeerError, match="no mesh 'jug' is published"):
        delete_mesh(f"{url}/meshes/jug")
    monkeypatch.delenv("MESHTIDE_TOKEN")
    with pytest.raises(PeerError, match="token"):
        change_mesh(f"{url}/meshes/vase", name="x")
    with pytest.raises(TransferError, match="cannot reach"):
        list_tags("http://127.0.0.1:9")


@pytest.mark.parametrize("content", [b"<html>", b"[3]", b'{"a": 1}', b'[{"tag": 1, "meshes": 2}]', b"null"])
def test_what_is_no_server_is_told(content: bytes) -> None:
    with web_server(WebServer(content)) as web, pytest.raises(ProtocolError, match="check the address"):
        list_tags(web.url)
