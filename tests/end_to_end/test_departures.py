"""Clients that leave in the middle of something: nothing of it is a fault of the server, nor fills its log."""

from __future__ import annotations

import json
import socket
import struct
import subprocess
import sys
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit
from urllib.request import urlopen

import pytest

from meshtide_codec.stream.session import ClientSession

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MESH = "patch"
CLIENTS = 25
RESET = struct.pack("ii", 1, 0)
"""Of SO_LINGER: closing sends a reset at once."""


def request(line: str, *headers: str) -> bytes:
    return "\r\n".join([f"{line} HTTP/1.1", "Host: 127.0.0.1", *headers, "", ""]).encode()


def frame(opcode: int, payload: bytes) -> bytes:
    return struct.pack(">BBH", 0x80 | opcode, 0x80 | 126, len(payload)) + bytes(4) + payload


HANDSHAKE = request(
    f"GET /meshes/{MESH}/stream",
    "Upgrade: websocket",
    "Connection: Upgrade",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
)
HELLO = frame(2, ClientSession(MESH).hello())
STAGES: dict[str, tuple[bytes, int]] = {
    "nothing": (b"", 0),
    "half a head": (b"GET /meshes HTTP/1.1\r\nHost", 0),
    "a request": (request("GET /meshes"), 0),
    "a request and its answer's start": (request("GET /meshes"), 1),
    "a wrong request": (b"GET /\x01 HTTP/9\r\n\r\n", 0),
    "a head too long": (b"GET /meshes HTTP/1.1\r\nA: " + b"a" * 200_000, 0),
    "many requests": (request("GET /meshes?tag=a") * 2000, 0),
    "many requests of no route": (request("OPTIONS /x") * 3000, 1),
    "many requests that are ready": (request("GET /healthz") * 3000, 1),
    "downloads": (request(f"GET /meshes/{MESH}.tide") * 50, 1),
    "half a body": (request("POST /meshes/x", "Content-Length: 100") + b"half", 0),
    "half a chunk": (request("PUT /meshes/x", "Transfer-Encoding: chunked") + b"40\r\nhalf", 0),
    "a patch": (request(f"PATCH /meshes/{MESH}", "Content-Length: 100", "Content-Type: application/json") + b"{", 0),
    "a handshake": (HANDSHAKE, 0),
    "a handshake and its answer": (HANDSHAKE, 1),
    "a handshake for nothing": (HANDSHAKE.replace(b"patch", b"other"), 0),
    "a hello": (HANDSHAKE + HELLO, 0),
    "a hello and a header": (HANDSHAKE + HELLO, 1000),
    "a second hello": (HANDSHAKE + HELLO + HELLO, 0),
    "pings": (HANDSHAKE + frame(9, b"x") * 3000, 0),
    "a farewell": (HANDSHAKE + HELLO + frame(8, b"\x03\xe8"), 0),
}


@pytest.fixture(scope="module", name="logged")
def _logged(encoded: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path]]:
    """A server's URL and its log."""
    folder = tmp_path_factory.mktemp("departures")
    (folder / f"{MESH}.tide").write_bytes(encoded.to_bytes())
    log = tmp_path_factory.mktemp("log") / "log"
    command = [sys.executable, "-m", "meshtide_server", str(folder), "--port", "0", "--announce"]
    with log.open("wb") as file, subprocess.Popen(command, stdout=subprocess.PIPE, stderr=file) as process:
        try:
            assert process.stdout is not None
            yield json.loads(process.stdout.readline())["url"], log
        finally:
            process.terminate()


def faults(url: str) -> list[str]:
    with urlopen(f"{url}/metrics", timeout=20) as answer:  # noqa: S310 - this machine's
        return [line for line in answer.read().decode().splitlines() if line.startswith("meshtide_errors_total")]


@pytest.mark.parametrize("stage", STAGES)
def test_who_leaves_is_no_fault(stage: str, logged: tuple[str, Path]) -> None:
    url, log = logged
    said, heard = STAGES[stage]
    host, port = urlsplit(url).hostname, urlsplit(url).port
    for number in range(CLIENTS):
        with socket.create_connection((host, port), timeout=10) as client, suppress(OSError):
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
            client.sendall(said)
            if heard:
                client.recv(heard)
            time.sleep(0.0004 * (number % 8))
    assert all(line.endswith(" 0.0") for line in faults(url))
    text = log.read_text()
    assert "Traceback" not in text
    assert "Exception" not in text
    assert " ERROR " not in text


@pytest.mark.parametrize(
    "said", [request("OPTIONS /x"), request("GET /meshes?tag=a"), request(f"GET /meshes/{MESH}.tide")]
)
def test_who_asks_without_end_and_reads_nothing_may_leave(said: bytes, logged: tuple[str, Path]) -> None:
    """An answer waits until it can be written, with other requests behind it, and then nobody is there."""
    url, log = logged
    host, port = urlsplit(url).hostname, urlsplit(url).port
    before = len(log.read_text())
    for _ in range(3):
        with socket.create_connection((host, port), timeout=10) as client:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
            client.settimeout(0.5)
            with suppress(TimeoutError):
                for _ in range(300):
                    client.sendall(said * 1000)
        time.sleep(0.05)
    assert all(line.endswith(" 0.0") for line in faults(url))
    assert "Traceback" not in log.read_text()[before:]
