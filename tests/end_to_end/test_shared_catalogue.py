"""Two servers of one PostgreSQL and one S3 store behind nginx, one of them killed while both serve and take uploads."""

from __future__ import annotations

import asyncio
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import httpx
import numpy as np
import pytest

import meshtide_client
from meshtide_client.connection.link import Link
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.encoder import encode
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid
from nginx_proxy import behind_nginx, wait_for
from postgresql_server import running_postgresql
from s3_server import BUCKET, running_s3_server
from upload_server import TOKEN, taking_uploads

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Iterator
    from pathlib import Path

    from meshtide_codec.mesh import Mesh

Hosted = tuple[str, "subprocess.Popen[bytes]"]
CLIENTS = 4
UPLOADS = 12
BITS = 8


@pytest.fixture(name="two")
def _two(tmp_path: Path) -> Iterator[list[Hosted]]:
    pytest.importorskip("obstore", reason="the extra s3 is not installed")
    with ExitStack() as running:
        (tmp_path / "s3").mkdir()
        common = {
            "MESHTIDE_DATABASE": running.enter_context(running_postgresql()),
            "MESHTIDE_STORE": f"s3://{BUCKET}",
            "AWS_ENDPOINT_URL": running.enter_context(running_s3_server(tmp_path / "s3")),
            "AWS_REGION": "us-east-1",
            "AWS_ACCESS_KEY_ID": "any",
            "AWS_SECRET_ACCESS_KEY": "any",
        }
        servers = []
        for turn in range(2):
            caches = {"MESHTIDE_CACHE": str(tmp_path / f"cache-{turn}")}
            servers.append(running.enter_context(taking_uploads(**common, **caches)))
            wait_for(f"{servers[-1][0]}/readyz")
        yield servers


def test_one_of_two_servers_is_killed_and_nothing_is_lost(two: list[Hosted], tmp_path: Path) -> None:
    (tmp_path / "nginx").mkdir()
    with behind_nginx([url for url, _ in two], tmp_path / "nginx") as proxy:
        first = upload(proxy, 40, tmp_path)
        until_ready(proxy, {first})
        acknowledged, levels = asyncio.run(serve_and_take(two, proxy, first, tmp_path))
        for mesh in levels:
            assert_same(mesh, expected(40))
        until_ready(proxy, set(acknowledged.values()) | {first})
        for size, mesh_id in acknowledged.items():
            assert_same(decode(httpx.get(f"{proxy}/meshes/{mesh_id}.tide").content), expected(size))
    assert len(acknowledged) == UPLOADS
    assert two[0][1].wait() != 0


async def serve_and_take(two: list[Hosted], proxy: str, mesh: str, folder: Path) -> tuple[dict[int, str], list[Any]]:
    """Slow clients and uploads at once, a server killed in the middle: uploads' ids by size, the clients' meshes."""
    size = len((await asyncio.to_thread(httpx.get, f"{proxy}/meshes/{mesh}.tide")).content)

    async def fetch() -> Any:
        link = Link(rate=size / 3, window=1024, delay=0.1)
        stream = meshtide_client.stream(f"{proxy}/meshes/{mesh}", link=link, transport="websocket")
        return [level async for level in stream][-1].mesh

    async def take() -> dict[int, str]:
        acknowledged = {}
        for turn in range(UPLOADS):
            if turn == UPLOADS // 2:
                two[0][1].kill()
            acknowledged[5 + turn] = await asyncio.to_thread(upload, proxy, 5 + turn, folder)
        return acknowledged

    clients = asyncio.gather(*(fetch() for _ in range(CLIENTS)))
    await asyncio.sleep(0.7)
    acknowledged = await take()
    return acknowledged, await clients


def upload(proxy: str, size: int, folder: Path) -> str:
    """The id of an uploaded mesh; what was not acknowledged is sent again, as a client would."""
    path = folder / f"patch-{size}.ply"
    save_mesh(grid(size), path)
    params: dict[str, Any] = {"filename": path.name, "bits": BITS}
    deadline = time.monotonic() + 30
    while True:
        try:
            answer = httpx.put(
                f"{proxy}/meshes/{path.stem}",
                params=params,
                content=path.read_bytes(),
                headers={"Authorization": f"Bearer {TOKEN}"},
            )
        except httpx.TransportError:
            answer = None
        if answer is not None and answer.status_code == 202:
            return str(answer.json()["mesh"])
        assert answer is None or answer.status_code in {502, 503, 504}, answer.text
        assert time.monotonic() < deadline
        time.sleep(0.1)


def until_ready(proxy: str, wanted: set[str]) -> None:
    deadline = time.monotonic() + 90
    while True:
        states = {row["id"]: row["status"] for row in httpx.get(f"{proxy}/meshes").json()}
        if all(states.get(mesh) == "ready" for mesh in wanted):
            return
        assert time.monotonic() < deadline, states
        time.sleep(0.2)


def expected(size: int) -> Mesh:
    return encode(grid(size), CompactOptions(bits=BITS)).quantized.mesh()


def assert_same(found: Any, wanted: Mesh) -> None:
    np.testing.assert_array_equal(found.vertices, wanted.vertices)
    np.testing.assert_array_equal(found.faces, wanted.faces)
