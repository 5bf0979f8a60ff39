"""Uploads, jobs and deletions, over a real socket, with meshes that are really encoded."""

from __future__ import annotations

import gzip
import json
import socket
import sqlite3
import time
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import httpx
import numpy as np
import pytest
from pydantic import SecretStr

from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.mesh_files import load_mesh, save_mesh
from meshtide_codec.stream.container import read_container, write_container
from meshtide_codec.testing import grid
from meshtide_server.settings import Settings

from ...conftest import TETRAHEDRON, LiveServer, running
from ...made_streams import make_stream, real_stream

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

TOKEN = "a-token-for-writing-000"  # noqa: S105 - of this test's server
WRITER = {"Authorization": f"Bearer {TOKEN}"}
BITS = 8


def settings_for(folder: Path, data: Path, **more: Any) -> Settings:
    return Settings(
        directory=folder,
        data=data,
        port=0,
        write_tokens=(SecretStr(TOKEN),),
        catalogue_seconds=0.2,
        writes_per_minute=0,
        **more,
    )


@pytest.fixture
def server(folder: Path, tmp_path: Path) -> Iterator[LiveServer]:
    with running(settings_for(folder, tmp_path / "data", max_upload=200_000)) as live:
        yield live


@pytest.fixture
def effort_streams(tmp_path: Path) -> dict[str, bytes]:
    """patch.ply in `tmp_path`, as it is encoded at each effort."""
    save_mesh(grid(9), tmp_path / "patch.ply")
    mesh = load_mesh(tmp_path / "patch.ply")
    return {effort: encode(mesh, CompactOptions(bits=BITS, effort=effort)).to_bytes() for effort in Effort}


def finished(url: str, job_id: str, seconds: float = 120.0) -> dict[str, Any]:
    """The job once it is done or has failed."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        job: dict[str, Any] = httpx.get(f"{url}/jobs/{job_id}").json()
        if job["state"] in {"done", "failed"}:
            return job
        time.sleep(0.05)
    raise TimeoutError(job_id)


def post(url: str, filename: str, data: bytes, **params: Any) -> httpx.Response:
    return httpx.post(f"{url}/meshes", params={"filename": filename, **params}, content=data, headers=WRITER)


def test_an_upload_is_encoded_and_can_be_fetched(server: LiveServer, tmp_path: Path) -> None:
    mesh = grid(9)
    save_mesh(mesh, tmp_path / "patch.ply")
    data = (tmp_path / "patch.ply").read_bytes()
    answer = post(server.url, "Patch.ply", data, tag=["flat", "small"], licence="CC0", bits=10)
    assert answer.status_code == 202
    job = answer.json()
    assert answer.headers["Location"] == f"/jobs/{job['id']}"
    assert job["mesh"] == "patch"
    with httpx.stream("GET", f"{server.url}/jobs/{job['id']}/events", timeout=120) as events:
        states = [json.loads(line[6:])["state"] for line in events.iter_lines() if line.startswith("data: ")]
    assert states[-1] == "done"
    whole = httpx.get(f"{server.url}/meshes/patch.tide")
    assert whole.status_code == 200
    expected = encode(mesh, CompactOptions(bits=10)).quantized.mesh()
    decoded = decode(whole.content)
    assert np.array_equal(decoded.vertices, expected.vertices)
    assert np.array_equal(decoded.faces, expected.faces)
    listed = {row["id"]: row for row in httpx.get(f"{server.url}/meshes").json()}
    assert listed["patch"]["tags"] == ["flat", "small"]
    box = {"minimum": decoded.vertices.min(axis=0).tolist(), "maximum": decoded.vertices.max(axis=0).tolist()}
    assert listed["patch"]["box"] == box  # of the mesh, not of the cube of its quantization grid

    again = post(server.url, "Patch.ply", data, bits=10).json()
    assert again["mesh"] == "patch-ply"
    assert finished(server.url, again["id"])["state"] == "done"
    assert httpx.get(f"{server.url}/meshes/patch-ply.tide").content == whole.content
    assert httpx.get(f"{server.url}/meshes/patch-ply").json()["box"] == box


def test_the_effort_of_an_upload_goes_before_that_of_the_server(
    folder: Path, tmp_path: Path, effort_streams: dict[str, bytes]
) -> None:
    data = (tmp_path / "patch.ply").read_bytes()
    with running(settings_for(folder, tmp_path / "data", bits=BITS, effort="high")) as live:
        for said, effort in (({}, "high"), ({"effort": "default"}, "default"), ({"effort": "high"}, "high")):
            job = post(live.url, "patch.ply", data, **said).json()
            assert finished(live.url, job["id"])["state"] == "done"
            assert httpx.get(f"{live.url}/meshes/{job['mesh']}.tide").content == effort_streams[effort]
            detail = httpx.get(f"{live.url}/meshes/{job['mesh']}").json()
            assert detail["effort"] == detail["options"]["effort"] == effort
        classic = post(live.url, "patch.ply", data, profile="classic").json()
        assert finished(live.url, classic["id"])["state"] == "done"
        assert httpx.get(f"{live.url}/meshes/{classic['mesh']}").json()["profile"] == "classic"


def test_a_job_of_before_there_was_a_choice_of_effort_is_done(
    folder: Path, tmp_path: Path, effort_streams: dict[str, bytes]
) -> None:
    data = (tmp_path / "patch.ply").read_bytes()
    settings = settings_for(folder, tmp_path / "data", bits=BITS, effort="high")
    with running(settings) as live:
        live.loop.call_soon_threadsafe(live.app.parts.draining.set)  # jobs are not begun any more
        time.sleep(0.1)
        job = post(live.url, "patch.ply", data).json()
    with closing(sqlite3.connect(tmp_path / "data" / "catalogue.db")) as connection, connection:
        options = json.dumps({"bits": BITS, "profile": "compact"})
        assert connection.execute("UPDATE job SET options = ?", (options,)).rowcount == 1
    with running(settings) as live:
        assert finished(live.url, job["id"])["state"] == "done"
        assert httpx.get(f"{live.url}/meshes/patch.tide").content == effort_streams["default"]
        again = post(live.url, "patch.ply", data, effort="default").json()  # has the stream that is there
        assert finished(live.url, again["id"])["state"] == "done"
        assert httpx.get(f"{live.url}/meshes/{again['mesh']}.tide").content == effort_streams["default"]


def test_a_stream_is_published_as_it_is_replaced_and_deleted(server: LiveServer) -> None:
    for seed in (3, 4):
        params = {"filename": "some.tide"}
        answer = httpx.put(f"{server.url}/meshes/mine", params=params, content=real_stream(seed), headers=WRITER)
        assert answer.status_code == 202
        assert finished(server.url, answer.json()["id"])["state"] == "done"
        assert httpx.get(f"{server.url}/meshes/mine.tide").content == real_stream(seed)
        row = httpx.get(f"{server.url}/meshes/mine").json()["packets"][-1]
        packet = httpx.get(f"{server.url}/packets/{row['sha256']}")
        assert packet.content == real_stream(seed)[row["offset"] : row["offset"] + row["length"]]
    assert httpx.delete(f"{server.url}/meshes/mine", headers=WRITER).status_code == 204
    assert httpx.get(f"{server.url}/meshes/mine.tide").status_code == 404
    assert httpx.get(f"{server.url}/packets/{row['sha256']}").status_code == 404
    assert httpx.get(f"{server.url}/jobs/{answer.json()['id']}").status_code == 404
    assert httpx.delete(f"{server.url}/meshes/mine", headers=WRITER).json()["error"] == "unknown-mesh"


@pytest.mark.parametrize("damage", ["packets", "effort", "claim"])
def test_a_stream_that_is_not_what_it_says_replaces_nothing(server: LiveServer, damage: str) -> None:
    def put(data: bytes) -> dict[str, Any]:
        query = {"filename": "a.tide"}
        answer = httpx.put(f"{server.url}/meshes/mine", params=query, content=data, headers=WRITER).raise_for_status()
        return finished(server.url, answer.json()["id"])

    assert put(real_stream(3))["state"] == "done"
    header, packets = read_container(real_stream(4))
    false = {
        "packets": (header, packets),
        "effort": (replace(header, options=replace(header.options, effort=Effort.HIGH)), packets),
        "claim": (
            replace(header, levels=(*header.levels[:-1], replace(header.levels[-1], rms=0.5, maximum=1.0))),
            packets,
        ),
    }
    changed, parts = false[damage]
    data = make_stream(1) if damage == "packets" else write_container(changed, [part.payload for part in parts])
    job = put(data)
    assert (job["state"], job["attempts"]) == ("failed", 1)
    assert "/" not in job["error"]
    assert httpx.get(f"{server.url}/meshes/mine.tide").content == real_stream(3)
    assert put(real_stream(4))["state"] == "done"
    assert httpx.get(f"{server.url}/meshes/mine.tide").content == real_stream(4)
    box = httpx.get(f"{server.url}/meshes/mine").json()["box"]
    assert np.array_equal(box["minimum"], decode(real_stream(4)).vertices.min(axis=0))


def test_what_is_not_kept_of_a_file_is_told_by_its_job_and_by_one_of_the_same_file(server: LiveServer) -> None:
    data = f"vt 0 0\nvt 1 0\nvt 0 1\n{TETRAHEDRON.replace('f 1 3 2', 'f 1/1 3/2 2/3')}".encode()
    for name in ("cube", "twin"):
        job = finished(server.url, post(server.url, f"{name}.obj", data).json()["id"])
        assert (job["mesh"], job["state"]) == (name, "done")
        (note,) = job["notes"]
        assert note.startswith("texture coordinates (")
        assert note.endswith("not kept")
    with httpx.stream("GET", f"{server.url}/jobs/{job['id']}/events", timeout=120) as events:
        told = [json.loads(line[6:])["notes"] for line in events.iter_lines() if line.startswith("data: ")]
    assert told == [[note]]
    plain = finished(server.url, post(server.url, "plain.obj", TETRAHEDRON.encode()).json()["id"])
    assert (plain["state"], plain["notes"]) == ("done", [])


def test_a_packed_file_is_unpacked_and_named_without_both_suffixes(server: LiveServer) -> None:
    job = post(server.url, "Scan.obj.gz", gzip.compress(TETRAHEDRON.encode())).json()
    assert job["mesh"] == "scan"
    assert finished(server.url, job["id"])["state"] == "done"
    mesh = httpx.get(f"{server.url}/meshes/scan").json()
    assert (mesh["name"], mesh["vertices"], mesh["faces"]) == ("Scan.obj.gz", 4, 4)
    assert post(server.url, "scan.tide.gz", gzip.compress(make_stream())).status_code == 415


def test_a_file_that_is_no_mesh_fails_and_stops_nobody(server: LiveServer) -> None:
    bad = post(server.url, "bad.ply", b"ply\nformat ascii 1.0\nelement vertex 999999999999\nend_header\n").json()
    cut = post(server.url, "cut.tide", make_stream(1)[:-100]).json()
    good = post(server.url, "good.obj", TETRAHEDRON.encode()).json()
    assert finished(server.url, good["id"])["state"] == "done"
    for job in (bad, cut):
        ended = finished(server.url, job["id"])
        assert ended["state"] == "failed"
        assert ended["error"]
        assert httpx.get(f"{server.url}/meshes/{job['mesh']}.tide").json()["error"] == "mesh-failed"


@pytest.mark.parametrize(
    ("filename", "data", "status", "error"),
    [
        ("a.txt", b"x", 415, "unknown-format"),
        ("a", b"x", 415, "unknown-format"),
        ("a.gltf", b"{}", 415, "unknown-format"),
        ("a.obj", b"", 400, "empty"),
        ("a.obj", bytes(200_001), 413, "too-large"),
    ],
)
def test_uploads_that_cannot_be_taken(server: LiveServer, filename: str, data: bytes, status: int, error: str) -> None:
    answer = post(server.url, filename, data)
    assert (answer.status_code, answer.json()["error"]) == (status, error)


def sources(data: Path) -> list[str]:
    """The uploaded files that are in the store."""
    return sorted(path.name for path in (data / "store" / "sources").glob("*"))


def until_no_sources(data: Path, seconds: float = 20.0) -> None:
    deadline = time.monotonic() + seconds
    while sources(data):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_uploaded_files_leave_the_store_when_no_job_needs_them(folder: Path, tmp_path: Path) -> None:
    data = tmp_path / "data"
    with running(settings_for(folder, data)) as live:
        live.loop.call_soon_threadsafe(live.app.parts.draining.set)  # jobs are not begun any more
        time.sleep(0.1)
        jobs = [post(live.url, f"part-{i}.tide", real_stream(1)).json() for i in range(2)]
        gone = post(live.url, "gone.obj", b"no mesh").json()
        assert len(sources(data)) == 2
        assert httpx.delete(f"{live.url}/meshes/{gone['mesh']}", headers=WRITER).status_code == 204
        assert len(sources(data)) == 1
        assert httpx.delete(f"{live.url}/meshes/{jobs[0]['mesh']}", headers=WRITER).status_code == 204
        assert len(sources(data)) == 1  # the other job needs it
        post(live.url, "bad.obj", b"no mesh either")
        for content in (b"first", b"second", b"first"):
            params = {"filename": "a.obj"}
            httpx.put(f"{live.url}/meshes/mine", params=params, content=content, headers=WRITER).raise_for_status()
            assert len(sources(data)) == 3  # what was replaced is gone
        assert httpx.delete(f"{live.url}/meshes/mine", headers=WRITER).status_code == 204
        (data / "store" / "sources" / f"{'0' * 64}.obj").write_bytes(b"a killed server has left this")
        assert len(sources(data)) == 3
    with running(settings_for(folder, data)) as live:
        assert finished(live.url, jobs[1]["id"])["state"] == "done"
        until_no_sources(data)
        again = post(live.url, "again.tide", real_stream(1)).json()
        assert finished(live.url, again["id"])["state"] == "done"
        until_no_sources(data)


def test_an_upload_that_stands_still_is_refused_and_leaves_nothing(folder: Path, tmp_path: Path) -> None:
    with running(settings_for(folder, tmp_path / "data", upload_stall_timeout=0.3)) as live:
        parts = urlsplit(live.url)
        head = f"POST /meshes?filename=a.obj HTTP/1.1\r\nHost: h\r\nAuthorization: Bearer {TOKEN}\r\n"
        with socket.create_connection((parts.hostname, parts.port), timeout=20) as connection:
            connection.sendall(f"{head}Content-Length: 1000\r\n\r\nv 0 0 0\n".encode())
            answer = b"".join(iter(lambda: connection.recv(4096), b""))  # the server closes
        first, _, rest = answer.partition(b"\r\n")
        assert first == b"HTTP/1.1 408 Request Timeout"
        assert json.loads(rest.partition(b"\r\n\r\n")[2])["error"] == "stalled"
        assert sources(tmp_path / "data") == []
        assert not list((tmp_path / "data" / "store" / ".parts").iterdir())
        assert [row["id"] for row in httpx.get(f"{live.url}/meshes").json()] == ["small"]


def test_an_upload_that_says_that_it_is_too_large_is_refused_before_it_is_read(server: LiveServer) -> None:
    parts = urlsplit(server.url)
    head = f"POST /meshes?filename=a.obj HTTP/1.1\r\nHost: h\r\nAuthorization: Bearer {TOKEN}\r\n"
    with socket.create_connection((parts.hostname, parts.port), timeout=20) as connection:
        connection.sendall(f"{head}Content-Length: 200001\r\n\r\n".encode())
        assert connection.recv(4096).startswith(b"HTTP/1.1 413 ")


def test_a_client_that_leaves_in_the_middle_of_an_upload_is_no_fault_of_the_server(
    server: LiveServer, caplog: pytest.LogCaptureFixture
) -> None:
    parts = urlsplit(server.url)
    head = f"POST /meshes?filename=a.obj HTTP/1.1\r\nHost: h\r\nAuthorization: Bearer {TOKEN}\r\n"
    with caplog.at_level("INFO", "meshtide.access"):
        with socket.create_connection((parts.hostname, parts.port), timeout=20) as connection:
            connection.sendall(f"{head}Content-Length: 1000\r\n\r\nv 0 0 0\n".encode())
            time.sleep(0.2)
        assert post(server.url, "a.obj", TETRAHEDRON.encode()).status_code == 202
        time.sleep(0.2)
    assert not [record for record in caplog.records if record.levelname == "ERROR"]
    assert [row["id"] for row in httpx.get(f"{server.url}/meshes").json()] == ["a", "small"]


def test_reasons_name_no_places_of_the_server(server: LiveServer) -> None:
    job = post(server.url, "odd.obj", TETRAHEDRON.replace("0 0 0", "nan 0 0").encode()).json()
    error = finished(server.url, job["id"])["error"]
    assert error.startswith("odd.obj: vertex 0 is not finite")


@pytest.mark.parametrize(
    "params",
    [
        {"filename": "a\0.obj"},
        {"filename": "a\n.obj"},
        {"filename": "a" * 200 + ".obj"},
        {"filename": "a.obj", "tag": "x" * 101},
        {"filename": "a.obj", "tag": ["fine", "\0"]},
        {"filename": "a.obj", "tag": [str(number) for number in range(51)]},
        {"filename": "a.obj", "licence": "\0"},
        {"filename": "a.obj", "bits": 99},
        {"filename": "a.obj", "profile": "other"},
        {"filename": "a.obj", "effort": "most"},
        {"filename": "a.obj", "effort": ""},
        {"filename": "a.obj", "profile": "classic", "effort": "high"},
        {},
    ],
)
def test_what_no_catalogue_can_keep_is_refused(server: LiveServer, params: dict[str, Any]) -> None:
    for method, path in (("POST", "/meshes"), ("PUT", "/meshes/mine")):
        answer = httpx.request(method, f"{server.url}{path}", params=params, content=b"x", headers=WRITER)
        assert (answer.status_code, answer.json()["error"]) == (422, "invalid")


def test_writing_takes_a_token_and_spares_the_folder(server: LiveServer) -> None:
    params = {"filename": "a.obj"}
    for method, path in (("POST", "/meshes"), ("PUT", "/meshes/x"), ("DELETE", "/meshes/x")):
        assert httpx.request(method, f"{server.url}{path}", params=params).status_code == 401
    for method in ("PUT", "DELETE"):
        answer = httpx.request(method, f"{server.url}/meshes/small", params=params, headers=WRITER)
        assert (answer.status_code, answer.json()["error"]) == (409, "folder-mesh")
    assert httpx.put(f"{server.url}/meshes/No..Id", params=params, headers=WRITER).status_code == 422
    assert httpx.get(f"{server.url}/jobs/none").json()["error"] == "unknown-job"
    assert httpx.get(f"{server.url}/jobs/none/events").status_code == 404


def test_a_server_without_a_place_for_meshes_takes_none(folder: Path) -> None:
    with running(Settings(directory=folder, port=0, write_tokens=(SecretStr(TOKEN),))) as live:
        answer = post(live.url, "a.obj", TETRAHEDRON.encode())
        assert (answer.status_code, answer.json()["error"]) == (403, "read-only")


def test_what_was_queued_is_done_after_a_restart(folder: Path, tmp_path: Path) -> None:
    settings = settings_for(folder, tmp_path / "data")
    with running(settings) as live:
        live.loop.call_soon_threadsafe(live.app.parts.draining.set)  # jobs are not begun any more
        time.sleep(0.1)
        jobs = [post(live.url, f"part-{i}.tide", real_stream(i + 1)).json() for i in range(3)]
        assert {httpx.get(f"{live.url}/jobs/{job['id']}").json()["state"] for job in jobs} == {"queued"}
    with running(settings) as live:
        for i, job in enumerate(jobs):
            assert finished(live.url, job["id"])["state"] == "done"
            assert httpx.get(f"{live.url}/meshes/part-{i}.tide").content == real_stream(i + 1)
