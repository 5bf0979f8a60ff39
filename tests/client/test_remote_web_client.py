from __future__ import annotations

import gzip
import json
import zlib
from typing import TYPE_CHECKING, Any

import pytest

from meshtide_client.connection.address import ServerAddress
from meshtide_client.remote.edit import list_tags
from meshtide_client.remote.listing import list_meshes
from meshtide_client.remote.web_client import WebClient, refusal
from meshtide_codec.errors import PeerError, ProtocolError, TransferError
from scripted_server import Reply, scripted_server

if TYPE_CHECKING:
    from collections.abc import Callable

MESHES = json.dumps([{"id": f"vase-{i}", "name": "vase.ply", "status": "ready", "progress": 1.0} for i in range(50)])
PACKERS: dict[str, Callable[[bytes], bytes]] = {"gzip": gzip.compress, "deflate": zlib.compress, "": bytes}


def ask(reply: Reply, **settings: Any) -> Any:
    with scripted_server(lambda *_: reply) as url:
        server = ServerAddress.parse(url)
        with WebClient(server, timeout=5.0, token=None) as client:
            return client.ask("GET", server.listing_url, **settings)


@pytest.mark.parametrize("coding", PACKERS)
def test_lists_that_a_proxy_compresses_are_understood(coding: str) -> None:
    reply = Reply(200, PACKERS[coding](MESHES.encode()), {"Content-Encoding": coding} if coding else {})
    with scripted_server(lambda *_: reply) as url:
        assert len(list_meshes(url)) == 50
    tags = Reply(
        200, PACKERS[coding](b'[{"tag": "clay", "meshes": 3}]'), {"Content-Encoding": coding} if coding else {}
    )
    with scripted_server(lambda *_: tags) as url:
        assert list_tags(url) == {"clay": 3}


@pytest.mark.parametrize("coding", PACKERS)
def test_refusals_that_a_proxy_compresses_are_understood(coding: str) -> None:
    body = PACKERS[coding](b'{"error": "busy", "message": "later"}')
    reply = Reply(503, body, {"Content-Encoding": coding} if coding else {})
    with scripted_server(lambda *_: reply) as url, pytest.raises(PeerError, match="later"):
        list_tags(url)


def test_answers_are_bounded_after_their_expansion() -> None:
    bomb = Reply(200, gzip.compress(bytes(1 << 22)), {"Content-Encoding": "gzip"})
    assert len(ask(bomb, largest=1 << 22).body) == 1 << 22
    with pytest.raises(ProtocolError, match="answers with more than 4194303 bytes"):
        ask(bomb, largest=(1 << 22) - 1)
    with pytest.raises(ProtocolError, match="more than 100 bytes"):
        ask(Reply(200, bytes(101)), largest=100)


@pytest.mark.parametrize(
    ("reply", "error", "message"),
    [
        (Reply(200, b"abc", {"Content-Encoding": "br"}), ProtocolError, "compressed on the way"),
        (Reply(200, gzip.compress(b"abc")[:-3], {"Content-Encoding": "gzip"}), TransferError, "inside of its compress"),
        (Reply(200, b"abc", {"Content-Length": "5", "Connection": "close"}), ProtocolError, "is not a meshtide server"),
        (Reply(302, headers={"Location": "/meshes"}), TransferError, "redirects"),
    ],
)
def test_what_is_wrong_is_told(reply: Reply, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        ask(reply)


def test_json_that_is_none_is_told() -> None:
    for body in (b"", b"<html>", b"[" * 99_999, b"\xff"):
        answer = ask(Reply(200, body))
        with pytest.raises(ValueError, match=r"Expecting value|nested too deep|codec can't decode"):
            answer.value()


def test_what_a_refusal_means() -> None:
    answer = ask(Reply(410))
    assert str(refusal(answer, "the place")) == "the place answered with HTTP status 410; check the address"
    told = refusal(ask(Reply(400, b'{"error": "x", "message": "y"}')), "the place")
    assert isinstance(told, PeerError)
