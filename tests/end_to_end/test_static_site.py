"""A static copy on `python -m http.server`, and meshes behind a proxy that lets no websocket through."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler
from typing import TYPE_CHECKING, Any

import httpx
import numpy as np
import pytest

from meshtide_codec.command_line import ExitCode
from meshtide_codec.mesh_files import load_mesh
from web_server import WebServer, web_server

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MESH = "patch"


@contextmanager
def plain_web_server(folder: Path) -> Iterator[str]:
    """`python -m http.server`, which knows no ranges."""
    command = [sys.executable, "-u", "-m", "http.server", "0", "--bind", "127.0.0.1", "--directory", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            assert process.stdout is not None
            found = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
            assert found is not None
            yield found[0]
        finally:
            process.terminate()


def test_a_static_copy_of_a_server_works_with_fetch_and_meshes(server: Any, meshtide: Any) -> None:
    done = meshtide("export", server.url, "--static", "site", "--json")
    assert done.returncode == ExitCode.OK, done.stderr
    assert [mesh["id"] for mesh in json.loads(done.stdout)["meshes"]] == [MESH]
    assert (meshtide.folder / "site" / "meshes" / f"{MESH}.tide").read_bytes() == server.whole
    with plain_web_server(meshtide.folder / "site") as url:
        listed = meshtide("meshes", url, "--json")
        assert listed.returncode == ExitCode.OK, listed.stderr
        assert [(row["id"], row["bytes"]) for row in json.loads(listed.stdout)["meshes"]] == [(MESH, len(server.whole))]
        assert MESH in meshtide("meshes", url).stdout
        fetched = meshtide("fetch", f"{url}/meshes/{MESH}", "--json", "--keep-levels", "levels")
        assert fetched.returncode == ExitCode.OK, fetched.stderr
        answer = json.loads(fetched.stdout)
        assert (answer["transport"], answer["complete"], answer["size"]) == ("download", True, len(server.whole))
        assert [level["level"] for level in answer["levels"]] == [row.level for row in server.encoded.header.levels]
        coarse = meshtide("fetch", f"{url}/meshes/{MESH}.tide", "-o", "coarse.ply", "--until-level", "2", "--json")
        assert json.loads(coarse.stdout)["level"] == 2
        unknown = meshtide("fetch", f"{url}/meshes/teapot")
        assert unknown.returncode == ExitCode.NETWORK
        assert "HTTP status 404" in unknown.stderr
    loaded = load_mesh(meshtide.folder / f"{MESH}.ply")
    np.testing.assert_array_equal(loaded.faces, server.encoded.quantized.mesh().faces)


class Proxy(WebServer):
    """Passes requests on, but refuses upgrades, as some proxies of offices do."""

    def __init__(self, target: str) -> None:
        super().__init__(b"")
        self.target = target

    def answer(self, request: BaseHTTPRequestHandler) -> None:
        self.requests.append((request.path, request.headers.get("Range")))
        if "upgrade" in request.headers.get("Connection", "").lower():
            self._send(request, 403, b"<html>WebSockets are blocked</html>", {})
            return
        passed = {name: value for name, value in request.headers.items() if name.lower() not in {"host", "connection"}}
        answer = httpx.get(self.target + request.path, headers=passed, trust_env=False)
        kept = {name: answer.headers[name] for name in ("ETag", "Content-Range") if name in answer.headers}
        self._send(request, answer.status_code, answer.content, kept)


def test_a_proxy_without_websockets_costs_no_level(server: Any, meshtide: Any) -> None:
    with web_server(Proxy(server.url)) as proxy:
        first = meshtide(
            "fetch", f"{proxy.url}/meshes/{MESH}", "--stream-file", "s.tide", "--until-level", "2", "--json"
        )
        assert first.returncode == ExitCode.OK, first.stderr
        assert "HTTP status 403" in first.stderr
        assert "reading by http instead" in first.stderr
        answer = json.loads(first.stdout)
        assert (answer["transport"], answer["level"]) == ("http", 2)
        held = (meshtide.folder / "s.tide").stat().st_size
        assert held == answer["size"] < len(server.whole)
        rest = meshtide(
            "fetch",
            f"{proxy.url}/meshes/{MESH}",
            "--stream-file",
            "s.tide",
            "--transport",
            "http",
            "--overwrite",
            "--json",
        )
        assert json.loads(rest.stdout)["transport"] == "http"
        assert ("/meshes/patch.tide", f"bytes={held}-{len(server.whole) - 1}") in proxy.requests
        refused = meshtide("fetch", f"{proxy.url}/meshes/{MESH}", "-o", "n.ply", "--transport", "websocket")
        assert refused.returncode == ExitCode.NETWORK
        assert "HTTP status 403" in refused.stderr
    assert (meshtide.folder / "s.tide").read_bytes() == server.whole


@pytest.mark.parametrize("transport", ["websocket", "http", "download"])
def test_each_transport_brings_the_same_mesh(server: Any, meshtide: Any, transport: str) -> None:
    done = meshtide("fetch", server.mesh_url, "--transport", transport, "--stream-file", f"{transport}.tide", "--json")
    assert done.returncode == ExitCode.OK, done.stderr
    assert json.loads(done.stdout)["transport"] == transport
    assert (meshtide.folder / f"{transport}.tide").read_bytes() == server.whole


@pytest.mark.parametrize("transport", ["http", "download"])
def test_a_connection_that_dies_in_the_middle_is_opened_again(
    server: Any, relay: Any, meshtide: Any, transport: str
) -> None:
    link = relay(server.url, len(server.whole) * 2 // 3)
    link.cut.set()
    done = meshtide("fetch", f"{link.url}/meshes/{MESH}", "--transport", transport, "--stream-file", "s.tide", "--json")
    assert done.returncode == ExitCode.OK, done.stderr
    assert json.loads(done.stdout)["transport"] == transport
    assert (meshtide.folder / "s.tide").read_bytes() == server.whole


def test_a_server_that_is_killed_leaves_a_file_that_another_goes_on_with(
    start_server: Any, relay: Any, meshtide: Any
) -> None:
    with start_server() as first:
        link = relay(first.url, len(first.whole) * 2 // 3)
        process = meshtide.start(
            "fetch", f"{link.url}/meshes/{MESH}", "--transport", "http", "--stream-file", "s.tide", "--retries", "1"
        )
        full = link.full.wait(60.0)
        first.process.kill()
        first.process.wait()
        link.cut.set()
        _, errors = process.communicate(timeout=60)
    assert "Traceback" not in errors
    held = (meshtide.folder / "s.tide").stat().st_size
    assert not full or process.returncode == ExitCode.NETWORK
    with start_server() as second:
        done = meshtide("fetch", second.mesh_url, "--transport", "http", "--stream-file", "s.tide", "--json")
        assert done.returncode == ExitCode.OK, done.stderr
        assert json.loads(done.stdout)["received_bytes"] < len(second.whole) - held + 4096
    assert (meshtide.folder / "s.tide").read_bytes() == second.whole


def test_a_file_on_the_disk_is_fetched(server: Any, meshtide: Any) -> None:
    (meshtide.folder / "copy.tide").write_bytes(server.whole)
    done = meshtide("fetch", "copy.tide", "--json")
    assert done.returncode == ExitCode.OK, done.stderr
    assert json.loads(done.stdout)["transport"] == "local"
    assert (meshtide.folder / "copy.ply").exists()
    missing = meshtide("fetch", "missing.tide")
    assert missing.returncode == ExitCode.DISK
    assert "missing.tide" in missing.stderr
