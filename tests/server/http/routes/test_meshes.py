from pathlib import Path
from zlib import crc32

import httpx
import pytest
from fastapi import FastAPI

from meshtide_codec.stream.container import read_container
from meshtide_server.hosting.mesh import MeshSource

from ...made_streams import make_stream

WHOLE = make_stream()


async def test_health_counts_meshes(client: httpx.AsyncClient) -> None:
    answer = await client.get("/healthz")
    assert answer.status_code == 200
    assert answer.json()["status"] == "ok"
    assert answer.json()["meshes"] == {"ready": 1, "encoding": 0, "failed": 0}


async def test_index_leads_on(client: httpx.AsyncClient) -> None:
    answer = (await client.get("/")).json()
    assert (await client.get(answer["meshes"])).status_code == 200
    assert (await client.get(answer["documentation"])).status_code == 200


async def test_list_of_meshes(client: httpx.AsyncClient) -> None:
    assert (await client.get("/meshes")).json() == [
        {
            "id": "small",
            "name": "small.tide",
            "status": "ready",
            "stage": None,
            "progress": 1.0,
            "reason": None,
            "vertices": 1600,
            "faces": 3196,
            "levels": 3,
            "bytes": len(WHOLE),
            "box": {"minimum": [0.0, -1.0, 0.5], "maximum": [2.0, 1.0, 2.5]},
            "tags": [],
            "licence": None,
            "created": None,
            "updated": None,
            "source": None,
        }
    ]


async def test_detail_locates_levels_and_packets_in_the_file(client: httpx.AsyncClient) -> None:
    detail = (await client.get("/meshes/small")).json()
    assert (detail["profile"], detail["effort"]) == ("classic", None)
    assert detail["options"] == read_container(WHOLE)[0].options.plain()
    assert (detail["bits"], detail["origin"], detail["extent"]) == (12, [0.0, -1.0, 0.5], 2.0)
    assert [row["level"] for row in detail["levels"]] == [2, 1, 0]
    assert detail["levels"][-1]["bytes"] == detail["bytes"] == len(WHOLE)
    assert detail["levels"][0]["bytes"] == detail["packets"][1]["offset"]
    assert [row["kind"] for row in detail["packets"]] == ["Base", "Map&Conn", "Diff", "Map&Conn", "Param", "Diff"]
    for row in detail["packets"]:
        last = row["offset"] + row["length"] - 1
        part = await client.get("/meshes/small.tide", headers={"Range": f"bytes={row['offset']}-{last}"})
        assert part.status_code == 206
        assert f"{crc32(part.content):08x}" == row["checksum"]


async def test_whole_file(client: httpx.AsyncClient) -> None:
    answer = await client.get("/meshes/small.tide", headers={"Accept-Encoding": "gzip, deflate, br"})
    assert answer.status_code == 200
    assert answer.content == WHOLE
    assert answer.headers["content-type"] == "application/x-tide"
    assert answer.headers["content-length"] == str(len(WHOLE))
    assert answer.headers["accept-ranges"] == "bytes"
    assert "content-encoding" not in answer.headers
    assert "no-transform" in answer.headers["cache-control"]
    fingerprint = (await client.get("/meshes/small")).json()["fingerprint"]
    assert answer.headers["etag"] == f'"{fingerprint}"'


async def test_head_tells_the_size_and_sends_nothing(client: httpx.AsyncClient) -> None:
    answer = await client.head("/meshes/small.tide", headers={"Range": "bytes=0-9"})
    assert answer.status_code == 200
    assert answer.content == b""
    assert answer.headers["content-length"] == str(len(WHOLE))


@pytest.mark.parametrize(
    ("text", "start", "end"),
    [("bytes=0-0", 0, 1), ("bytes=-7", -7, None), ("bytes=100-", 100, None), ("bytes=10-19", 10, 20)],
)
async def test_ranges(client: httpx.AsyncClient, text: str, start: int, end: int | None) -> None:
    answer = await client.get("/meshes/small.tide", headers={"Range": text})
    expected = WHOLE[start:end]
    first = start % len(WHOLE)
    assert answer.status_code == 206
    assert answer.content == expected
    assert answer.headers["content-range"] == f"bytes {first}-{first + len(expected) - 1}/{len(WHOLE)}"
    assert answer.headers["content-length"] == str(len(expected))


async def test_unsatisfiable_range_tells_the_size(client: httpx.AsyncClient) -> None:
    answer = await client.get("/meshes/small.tide", headers={"Range": f"bytes={len(WHOLE)}-"})
    assert answer.status_code == 416
    assert answer.headers["content-range"] == f"bytes */{len(WHOLE)}"
    assert answer.json()["error"] == "range-not-satisfiable"


async def test_several_or_malformed_ranges_get_the_whole(client: httpx.AsyncClient) -> None:
    for text in ("bytes=0-1,4-5", "bytes=x"):
        answer = await client.get("/meshes/small.tide", headers={"Range": text})
        assert (answer.status_code, answer.content) == (200, WHOLE)


async def test_conditional_requests(client: httpx.AsyncClient) -> None:
    etag = (await client.head("/meshes/small.tide")).headers["etag"]
    unchanged = await client.get("/meshes/small.tide", headers={"If-None-Match": etag})
    assert (unchanged.status_code, unchanged.content, unchanged.headers["etag"]) == (304, b"", etag)
    changed = await client.get("/meshes/small.tide", headers={"If-Match": '"old"'})
    assert (changed.status_code, changed.json()["error"]) == (412, "changed")
    resumed = await client.get("/meshes/small.tide", headers={"If-Range": '"old"', "Range": "bytes=5-"})
    assert (resumed.status_code, resumed.content) == (200, WHOLE)


@pytest.mark.parametrize("path", ["/meshes/teapot", "/meshes/teapot.tide", "/meshes/SMALL", "/meshes/.tide"])
async def test_unknown_mesh(client: httpx.AsyncClient, path: str) -> None:
    answer = await client.get(path)
    assert answer.status_code == 404
    assert answer.json()["error"] == "unknown-mesh"
    assert "GET /meshes lists them all" in answer.json()["message"]


@pytest.mark.parametrize(
    "path",
    [
        "/meshes/../secret.tide",
        "/meshes/..%2fsecret.tide",
        "/meshes/%2e%2e%2fsecret",
        "/meshes/..%5csecret.tide",
        "/meshes/%00.tide",
        "/meshes/%2fetc%2fpasswd",
        "/meshes/small.tide%2f..%2f..%2fsecret.tide",
        "/%2e%2e/secret.tide",
    ],
)
async def test_no_path_leads_out_of_the_library(client: httpx.AsyncClient, folder: Path, path: str) -> None:
    (folder.parent / "secret.tide").write_bytes(make_stream(7))
    answer = await client.get(path)
    assert answer.status_code == 404
    assert set(answer.json()) == {"error", "message"}


async def test_other_refusals_are_json_too(client: httpx.AsyncClient) -> None:
    nothing = await client.get("/nothing")
    assert (nothing.status_code, nothing.json()["error"]) == (404, "not-found")
    written = await client.post("/healthz")
    assert (written.status_code, written.json()["error"]) == (405, "method-not-allowed")
    assert written.headers["allow"] == "GET, HEAD, OPTIONS"


async def test_a_mesh_that_is_not_ready_says_how_far_it_is(app: FastAPI, client: httpx.AsyncClient) -> None:
    library = app.parts.library
    library.folder.add(MeshSource("later.obj"), "later")
    library.known("later").advance("levels", 0.42)
    for path in ("/meshes/later", "/meshes/later.tide"):
        answer = await client.get(path)
        assert answer.status_code == 503
        assert answer.headers["retry-after"] == "1"
        assert answer.json()["error"] == "not-ready"
        assert "levels, 42%" in answer.json()["message"]


async def test_a_failed_mesh_says_why(app: FastAPI, client: httpx.AsyncClient) -> None:
    app.parts.library.known("small").fail("it is made of cheese")
    answer = await client.get("/meshes/small.tide")
    assert answer.status_code == 409
    assert answer.json() == {"error": "mesh-failed", "message": "mesh 'small' cannot be served: it is made of cheese"}


async def test_a_file_replaced_meanwhile_is_not_served(client: httpx.AsyncClient, folder: Path) -> None:
    (folder / "small.tide").write_bytes(make_stream(8))
    answer = await client.get("/meshes/small.tide")
    assert answer.status_code == 503
    assert "has changed since it was checked" in answer.json()["message"]
    (folder / "small.tide").unlink()
    assert (await client.get("/meshes/small.tide")).status_code == 503


async def test_openapi_describes_everything_with_examples(client: httpx.AsyncClient) -> None:
    described = (await client.get("/openapi.json")).json()
    assert set(described["paths"]) == {
        "/",
        "/healthz",
        "/meshes",
        "/meshes/{mesh_id}",
        "/meshes/{mesh_id}.tide",
        "/meshes/{mesh_id}/header",
        "/packets/{digest}",
        "/jobs/{job_id}",
        "/jobs/{job_id}/events",
        "/metrics",
        "/readyz",
        "/tags",
        "/tickets",
    }
    for model in (
        "Problem",
        "Health",
        "MeshSummary",
        "MeshDetail",
        "LevelRow",
        "PacketRow",
        "JobStatus",
        "MeshChange",
        "TagCount",
    ):
        assert described["components"]["schemas"][model]["examples"]
    for path, methods in described["paths"].items():
        for method, operation in methods.items():
            assert operation["summary"], (path, method)
            assert operation["description"], (path, method)
            for status in ("422", "429"):
                schema = operation["responses"][status]["content"]["application/json"]["schema"]
                assert schema == {"$ref": "#/components/schemas/Problem"}, (path, method)
    responses = described["paths"]["/meshes/{mesh_id}.tide"]["get"]["responses"]
    assert {"200", "206", "304", "404", "416", "503"} <= set(responses)
    assert "application/x-tide" in responses["206"]["content"]
