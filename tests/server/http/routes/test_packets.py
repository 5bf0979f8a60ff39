from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import pytest

from meshtide_codec.stream.container import PREAMBLE_BYTES, fingerprint, read_container
from meshtide_codec.stream.header import StreamHeader
from meshtide_server.app import create_app
from meshtide_server.hosting.scan import Scan
from meshtide_server.settings import Settings

from ...made_streams import make_stream

if TYPE_CHECKING:
    from fastapi import FastAPI

WHOLE = make_stream()
HEADER, PACKETS = read_container(WHOLE)
DIGESTS = [hashlib.sha256(packet.payload).hexdigest() for packet in PACKETS]
READ = "token-for-reading-0"


async def test_the_detail_names_each_packet(client: httpx.AsyncClient) -> None:
    detail = (await client.get("/meshes/small")).json()
    assert [row["sha256"] for row in detail["packets"]] == DIGESTS
    for row, packet in zip(detail["packets"], PACKETS, strict=True):
        answer = await client.get(f"/packets/{row['sha256']}")
        assert answer.content == packet.payload


async def test_a_packet_may_be_kept_for_ever(client: httpx.AsyncClient) -> None:
    answer = await client.get(f"/packets/{DIGESTS[3]}")
    assert answer.status_code == 200
    assert answer.headers["cache-control"] == "public, max-age=31536000, immutable, no-transform"
    assert answer.headers["etag"] == f'"{DIGESTS[3]}"'
    assert answer.headers["content-length"] == "2000"
    assert answer.headers["accept-ranges"] == "bytes"
    assert "content-encoding" not in answer.headers


async def test_head_tells_all_but_the_bytes(client: httpx.AsyncClient) -> None:
    for path in (f"/packets/{DIGESTS[3]}", "/meshes/small/header", "/meshes/small.tide"):
        whole, head = await client.get(path), await client.head(path)
        assert head.content == b""
        for name in ("content-length", "etag", "cache-control", "accept-ranges", "content-type"):
            assert head.headers[name] == whole.headers[name]


@pytest.mark.parametrize("position", [0, 3, 5])
async def test_ranges_stay_inside_of_the_packet(client: httpx.AsyncClient, position: int) -> None:
    path, payload = f"/packets/{DIGESTS[position]}", PACKETS[position].payload
    for asked, expected in (("10-19", payload[10:20]), ("-7", payload[-7:]), ("25-", payload[25:])):
        answer = await client.get(path, headers={"Range": f"bytes={asked}", "If-Range": f'"{DIGESTS[position]}"'})
        assert answer.status_code == 206
        assert answer.content == expected
        assert answer.headers["content-range"].endswith(f"/{len(payload)}")
    beyond = await client.get(path, headers={"Range": f"bytes={len(payload)}-"})
    assert beyond.status_code == 416
    assert beyond.headers["content-range"] == f"bytes */{len(payload)}"
    other = await client.get(path, headers={"Range": "bytes=0-1", "If-Range": '"another"'})
    assert (other.status_code, other.content) == (200, payload)


async def test_a_packet_that_is_held_is_not_sent(client: httpx.AsyncClient) -> None:
    answer = await client.get(f"/packets/{DIGESTS[0]}", headers={"If-None-Match": f'"x", "{DIGESTS[0]}"'})
    assert (answer.status_code, answer.content) == (304, b"")
    assert "immutable" in answer.headers["cache-control"]
    failed = await client.get(f"/packets/{DIGESTS[0]}", headers={"If-Match": '"x"'})
    assert failed.status_code == 412


@pytest.mark.parametrize(
    "digest", ["0" * 64, DIGESTS[0].upper(), DIGESTS[0][:-1], "x" * 64, "%D9%A0" * 32, "..%2f" + "0" * 59]
)
async def test_unknown_packets(client: httpx.AsyncClient, digest: str) -> None:
    answer = await client.get(f"/packets/{digest}")
    assert answer.status_code == 404
    assert answer.json()["error"] in {"unknown-packet", "not-found"}


async def test_the_header_is_that_of_the_file(client: httpx.AsyncClient) -> None:
    answer = await client.get("/meshes/small/header")
    assert answer.status_code == 200
    assert StreamHeader.from_bytes(answer.content) == HEADER
    assert answer.content == WHOLE[PREAMBLE_BYTES : PREAMBLE_BYTES + len(answer.content)]
    assert answer.headers["etag"] == f'"{fingerprint(answer.content).hex()}"'
    part = await client.get("/meshes/small/header", headers={"Range": "bytes=2-5"})
    assert part.content == answer.content[2:6]
    assert (await client.get("/meshes/unknown/header")).status_code == 404


async def test_a_file_replaced_meanwhile_gives_no_packet(client: httpx.AsyncClient, folder: Path) -> None:
    (folder / "small.tide").write_bytes(make_stream(8))
    answer = await client.get(f"/packets/{DIGESTS[0]}")
    assert (answer.status_code, answer.json()["error"]) == (503, "not-ready")


async def test_a_mesh_takes_its_packets_along(app: FastAPI, client: httpx.AsyncClient, folder: Path) -> None:
    (folder / "small.tide").unlink()
    await Scan(app.parts.library.folder, folder, recursive=False, seconds=0).look(settle=False)
    assert (await client.get(f"/packets/{DIGESTS[0]}")).status_code == 404


async def test_shared_caches_do_not_keep_what_takes_a_token(folder: Path) -> None:
    app = create_app(Settings(directory=folder, rescan_seconds=0, read_tokens=READ))
    async with app.router.lifespan_context(app):
        await app.parts.library.folder.settled()
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test") as client:
            for path in (f"/packets/{DIGESTS[0]}", "/meshes/small/header"):
                assert (await client.get(path)).status_code == 401
            answer = await client.get(f"/packets/{DIGESTS[0]}", headers={"Authorization": f"Bearer {READ}"})
            assert answer.headers["cache-control"].startswith("private, ")


@pytest.mark.parametrize(("methods", "expected"), [("", 200), ("GET", 400)])
async def test_pages_may_do_what_the_settings_say(folder: Path, methods: str, expected: int) -> None:
    chosen: dict[str, Any] = {"allowed_methods": methods} if methods else {}
    app = create_app(Settings(directory=folder, allowed_origins="https://museum.example", **chosen))
    asked = {
        "Origin": "https://museum.example",
        "Access-Control-Request-Method": "POST",
        "Access-Control-Request-Headers": "Authorization",
    }
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test") as client:
        answer = await client.options("/tickets", headers=asked)
        assert answer.status_code == expected
        foreign = await client.options("/tickets", headers=asked | {"Access-Control-Request-Headers": "X-Strange"})
        assert foreign.status_code == 400


async def test_methods_and_headers_have_names() -> None:
    with pytest.raises(ValueError, match="is not a name of a method or header"):
        Settings(samples=True, allowed_methods="GET, P\r\nUT")
