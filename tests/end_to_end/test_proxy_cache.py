"""The proxy of docker/ keeps packets: what it has once, no server is asked for again."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import httpx

from nginx_proxy import behind_nginx

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


def asked(url: str) -> dict[str, float]:
    """How often a server was asked for packets, by status."""
    lines = httpx.get(f"{url}/metrics").text.splitlines()
    counted = [line for line in lines if line.startswith("meshtide_http_requests_total") and "/packets/" in line]
    return {re.findall(r'status="(\w+)"', line)[0]: float(line.rsplit(" ", 1)[1]) for line in counted}


def test_packets_are_asked_of_a_server_once(start_server: Callable[[], Any], tmp_path: Path) -> None:
    with start_server() as server, behind_nginx([server.url], tmp_path) as proxy:
        packet = httpx.get(f"{proxy}/meshes/patch").json()["packets"][-1]
        path = f"/packets/{packet['sha256']}"
        direct = httpx.get(server.url + path)
        before = asked(server.url)
        answers = [httpx.get(proxy + path) for _ in range(4)]
        part = httpx.get(proxy + path, headers={"Range": "bytes=3-6"})
        assert sum(asked(server.url).values()) == sum(before.values()) + 1
        for answer in answers:
            assert (answer.status_code, answer.content) == (200, direct.content)
            assert answer.headers["etag"] == direct.headers["etag"]
            assert answer.headers["cache-control"] == direct.headers["cache-control"]
        assert len({answer.headers["x-request-id"] for answer in answers}) == 4
        assert (part.status_code, part.content) == (206, direct.content[3:7])
        httpx.get(proxy + path, headers={"Origin": "https://a.example"})
        assert sum(asked(server.url).values()) == sum(before.values()) + 2
        assert httpx.get(f"{proxy}/packets/{'0' * 64}").status_code == 404
