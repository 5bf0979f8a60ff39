"""Two servers of one folder behind nginx, with the very configuration of docker/: one is killed, nothing is lost."""

from __future__ import annotations

import asyncio
import json
from typing import TYPE_CHECKING, Any

import httpx
import numpy as np
import pytest

import meshtide_client
from meshtide_client.connection.link import Link
from nginx_proxy import behind_nginx, wait_for

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

MESH = "patch"
CLIENTS = 6


@pytest.fixture(name="two")
def _two(start_server: Callable[[], Any]) -> Iterator[tuple[Any, Any]]:
    with start_server() as first, start_server() as second:
        for server in (first, second):
            wait_for(f"{server.url}/readyz")
        yield first, second


@pytest.fixture(name="proxy")
def _proxy(two: tuple[Any, Any], tmp_path: Path) -> Iterator[str]:
    """nginx in front of both; yields its URL."""
    with behind_nginx([server.url for server in two], tmp_path) as url:
        yield url


def running(server: Any) -> float:
    text = httpx.get(f"{server.url}/metrics").text
    return float(next(line for line in text.splitlines() if line.startswith("meshtide_streams_running ")).split()[1])


def test_one_of_two_servers_is_killed_and_every_client_gets_its_mesh(two: tuple[Any, Any], proxy: str) -> None:
    encoded = two[0].encoded
    expected = encoded.quantized.mesh()
    size = len(two[0].whole)
    said: list[str] = []

    async def fetch() -> Any:
        link = Link(rate=size / 3, window=4096, delay=0.1)  # slow enough to be in the middle when the server dies
        stream = meshtide_client.stream(f"{proxy}/meshes/{MESH}", link=link, notify=said.append, transport="websocket")
        return [level async for level in stream][-1].mesh

    async def kill_one() -> None:
        while not all(running(server) for server in two):  # noqa: ASYNC110 - another process's state
            await asyncio.sleep(0.05)
        await asyncio.sleep(0.5)
        two[0].process.kill()

    async def everything() -> list[Any]:
        meshes = asyncio.gather(*(fetch() for _ in range(CLIENTS)))
        await kill_one()
        return await meshes

    for mesh in asyncio.run(everything()):
        np.testing.assert_array_equal(mesh.vertices, expected.vertices)
        np.testing.assert_array_equal(mesh.faces, expected.faces)
    assert said  # some were on the server that was killed
    assert two[0].process.wait() != 0
    assert running(two[1]) == 0
    for _ in range(4):  # whoever comes now is not bothered by the server that is gone
        assert httpx.get(f"{proxy}/meshes/{MESH}.tide").content == two[0].whole


def test_the_proxy_passes_ids_on_and_hides_what_is_not_for_everybody(two: tuple[Any, Any], proxy: str) -> None:
    assert httpx.get(f"{two[0].url}/metrics").status_code == 200
    for path in ("/metrics", "/readyz"):
        assert httpx.get(proxy + path).status_code == 404
    assert len(httpx.get(f"{proxy}/healthz").headers["x-request-id"]) == 32  # nginx's


def test_a_server_that_drains_sends_new_clients_to_the_other(two: tuple[Any, Any], proxy: str, meshtide: Any) -> None:
    two[0].process.terminate()
    done = [meshtide.start("fetch", f"{proxy}/meshes/{MESH}", "-o", f"{turn}.ply", "--json") for turn in range(2)]
    for process in done:
        output, errors = process.communicate(timeout=60)
        assert process.returncode == 0, errors
        assert json.loads(output)["complete"]
    assert two[0].process.wait(10) == 0
