"""Real processes for end-to-end tests: a server, the command, and a link between them that can be held and cut."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.testing import grid

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

MESH = "patch"


@dataclass
class Hosted:
    """A server process and what it hosts."""

    url: str
    process: subprocess.Popen[bytes]
    encoded: EncodedMesh

    @property
    def mesh_url(self) -> str:
        return f"{self.url}/meshes/{MESH}"

    @property
    def whole(self) -> bytes:
        return self.encoded.to_bytes()


@pytest.fixture(scope="session", name="encoded")
def _encoded() -> EncodedMesh:
    return encode(grid(60), ClassicOptions(bits=12, coarsest_vertices=20))


@pytest.fixture(scope="session", name="start_server")
def _start_server(encoded: EncodedMesh, tmp_path_factory: pytest.TempPathFactory) -> Callable[[], Any]:
    """Starts a server of one mesh, which is stopped at the end of the block."""
    folder = tmp_path_factory.mktemp("hosted")
    (folder / f"{MESH}.tide").write_bytes(encoded.to_bytes())
    command = [sys.executable, "-m", "meshtide_server", str(folder), "--port", "0", "--announce"]

    @contextmanager
    def start() -> Iterator[Hosted]:
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
            try:
                assert process.stdout is not None
                yield Hosted(json.loads(process.stdout.readline())["url"], process, encoded)
            finally:
                process.terminate()

    return start


@pytest.fixture(scope="module", name="server")
def _server(start_server: Callable[[], Any]) -> Iterator[Hosted]:
    with start_server() as hosted:
        yield hosted


@dataclass
class Relay:
    """Passes bytes between a client and a server; the first connection stops after `limit` bytes from the server."""

    target: str
    limit: int
    url: str = ""
    full: threading.Event = field(default_factory=threading.Event)
    """Set when the limit is reached and the client has everything before it."""
    cut: threading.Event = field(default_factory=threading.Event)
    """To be set: ends the connection."""

    def serve(self, listener: socket.socket) -> None:
        left = self.limit
        with suppress(OSError):
            while True:
                client, _ = listener.accept()
                threading.Thread(target=self._connection, args=(client, left), daemon=True).start()
                left = 1 << 40

    def _connection(self, client: socket.socket, left: int) -> None:
        parts = urlsplit(self.target)
        with client, suppress(ConnectionRefusedError):
            self._pass(client, socket.create_connection((parts.hostname, parts.port)), left)

    def _pass(self, client: socket.socket, upstream: socket.socket, left: int) -> None:
        with upstream:
            threading.Thread(target=self._upload, args=(client, upstream), daemon=True).start()
            with suppress(OSError):
                while left and (data := upstream.recv(min(left, 65536))):
                    client.sendall(data)
                    left -= len(data)
                if not left:
                    self.full.set()
                    self.cut.wait()
            for end in (client, upstream):
                with suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)

    @staticmethod
    def _upload(client: socket.socket, upstream: socket.socket) -> None:
        with suppress(OSError):
            while data := client.recv(65536):
                upstream.sendall(data)


@pytest.fixture(name="relay")
def _relay() -> Iterator[Callable[[str, int], Relay]]:
    """Starts a relay to a server's URL that stops after so many bytes."""
    listeners: list[socket.socket] = []
    relays: list[Relay] = []

    def start(target: str, limit: int) -> Relay:
        listener = socket.create_server(("127.0.0.1", 0))
        listeners.append(listener)
        relay = Relay(target, limit, f"http://127.0.0.1:{listener.getsockname()[1]}")
        relays.append(relay)
        threading.Thread(target=relay.serve, args=(listener,), daemon=True).start()
        return relay

    yield start
    for relay in relays:
        relay.cut.set()
    for listener in listeners:
        with suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)
        listener.close()


@dataclass
class Command:
    """Runs `meshtide` in a process of its own, in a folder of its own."""

    folder: Path

    def start(self, *arguments: str | Path, **settings: Any) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "meshtide_client.main", *map(str, arguments)],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "MESHTIDE_CACHE": str(self.folder / ".cache"), "COLUMNS": "120"},
            **settings,
        )

    def __call__(self, *arguments: str | Path, **settings: Any) -> subprocess.CompletedProcess[str]:
        process = self.start(*arguments, **settings)
        output, errors = process.communicate(timeout=120)
        assert "Traceback" not in errors, errors
        return subprocess.CompletedProcess(process.args, process.returncode, output, errors)

    @property
    def files(self) -> set[str]:
        return {path.name for path in self.folder.iterdir() if path.name != ".cache"}


@pytest.fixture(name="meshtide")
def _meshtide(tmp_path: Path) -> Command:
    return Command(tmp_path)
