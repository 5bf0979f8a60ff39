"""What the load benches share: the bunny's stream, processes that host it, and how a result is printed."""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.error import URLError
from urllib.request import urlopen

import numpy as np
import psutil
from websockets.sync.client import connect

from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.samples import load_sample
from meshtide_codec.stream.container import preamble
from meshtide_codec.stream.messages import LARGEST_MESSAGE
from meshtide_codec.stream.session import ClientSession, HeaderEvent, PacketEvent

if TYPE_CHECKING:
    from collections.abc import Iterator

MESH = "bunny"
START_SECONDS = 60.0
STOP_SECONDS = 20.0
_NGINX = """
worker_processes 1;
daemon off;
pid {folder}/nginx.pid;
error_log stderr error;
events {{ worker_connections 4096; }}
http {{
    access_log off;
    sendfile on;
    tcp_nopush on;
    keepalive_requests 1000000000;
    default_type application/octet-stream;
    client_body_temp_path {folder}/body;
    proxy_temp_path {folder}/proxy;
    fastcgi_temp_path {folder}/fastcgi;
    uwsgi_temp_path {folder}/uwsgi;
    scgi_temp_path {folder}/scgi;
{directives}
}}
"""


class UnavailableError(Exception):
    """What a bench needs is not installed here."""


@dataclass(frozen=True)
class Row:
    """One row of the table of figures.

    Args:
        what: was measured.
        value: the figure.
        unit: of it.
        must: the bound that has to hold, as text.
        met: whether it does.
        details: everything else, for programs.
    """

    what: str
    value: float
    unit: str
    must: str
    met: bool
    details: dict[str, Any]

    def show(self) -> int:
        """Print it as a JSON line and as a row of a Markdown table; returns the exit code."""
        print(json.dumps(asdict(self)))
        told = ", ".join(f"{name} {_told(value)}" for name, value in self.details.items())
        print(
            f"| {self.what} | {_told(self.value)} {self.unit} | {self.must} | {'yes' if self.met else 'NO'} | {told} |"
        )
        return 0 if self.met else 1


def _told(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Process:
    """A server in a process of its own."""

    url: str
    popen: subprocess.Popen[bytes]

    @property
    def host(self) -> str:
        """Where it listens."""
        return self.url.split("//")[1].rsplit(":", 1)[0]

    @property
    def port(self) -> int:
        """The port."""
        return int(self.url.rsplit(":", 1)[1])

    @property
    def resident_bytes(self) -> int:
        """Memory that it and its children hold."""
        process = psutil.Process(self.popen.pid)
        return sum(each.memory_info().rss for each in (process, *process.children(recursive=True)))

    @property
    def processor_seconds(self) -> float:
        """Processor time that it and its children have used; children that have ended do not count."""
        process = psutil.Process(self.popen.pid)
        return sum(sum(each.cpu_times()[:2]) for each in (process, *process.children(recursive=True)))


def encode_bunny(folder: Path) -> EncodedMesh:
    """Encode the Stanford bunny as it is by default and put it into `folder`."""
    encoded = encode(load_sample("stanford-bunny"))
    (folder / f"{MESH}.tide").write_bytes(encoded.to_bytes())
    return encoded


@contextmanager
def folder_with_bunny() -> Iterator[tuple[Path, EncodedMesh]]:
    """A temporary folder that holds the bunny's stream."""
    with tempfile.TemporaryDirectory(prefix="meshtide-load-") as name:
        yield Path(name), encode_bunny(Path(name))


@contextmanager
def meshtide_server(
    *arguments: object, environment: dict[str, str] | None = None, python: str = sys.executable
) -> Iterator[Process]:
    """`python -m meshtide_server` on a free port, ready."""
    command = [python, "-m", "meshtide_server", *map(str, arguments), "--announce", "--log-level", "error"]
    if "--port" not in arguments:
        command += ["--port", "0"]
    with process_of(command, environment) as popen:
        assert popen.stdout is not None
        url = json.loads(popen.stdout.readline())["url"]
        wait_for(f"{url}/readyz")
        yield Process(url, popen)


@contextmanager
def process_of(command: list[str], environment: dict[str, str] | None = None) -> Iterator[subprocess.Popen[bytes]]:
    """A process that is ended with the block."""
    settings = {name: value for name, value in os.environ.items() if not name.startswith("MESHTIDE_")}
    popen = subprocess.Popen(command, stdout=subprocess.PIPE, env={**settings, **(environment or {})})
    try:
        yield popen
    finally:
        popen.send_signal(signal.SIGTERM)
        try:
            popen.wait(STOP_SECONDS)
        except subprocess.TimeoutExpired:
            popen.kill()
            popen.wait()
        if popen.stdout is not None:
            popen.stdout.close()


def wait_for(url: str, seconds: float = START_SECONDS) -> None:
    """Wait until `url` answers with 200."""
    deadline = time.monotonic() + seconds
    while True:
        try:
            with urlopen(url, timeout=5) as answer:  # noqa: S310 - an address of this machine
                if answer.status == 200:
                    return
        except (URLError, ConnectionError, TimeoutError):
            pass
        if time.monotonic() > deadline:
            raise TimeoutError(f"{url} was not ready within {seconds:g} s")
        time.sleep(0.02)


@contextmanager
def nginx(directives: str, port: int, probe: str) -> Iterator[Process]:
    """nginx with `directives` in its http block, which listens on `port` of the loopback address.

    Args:
        directives: what stands in the http block.
        port: that these make it listen on.
        probe: a path that it answers with 200 once it works.
    """
    program = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin:/usr/local/sbin")
    if program is None:
        raise UnavailableError("nginx is not installed; apt-get install nginx-light")
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="meshtide-nginx-")))
        folder.chmod(0o755)  # its workers may run as another user
        (folder / "nginx.conf").write_text(_NGINX.format(folder=folder, directives=directives))
        command = [program, "-p", str(folder), "-c", str(folder / "nginx.conf")]
        popen = stack.enter_context(process_of(command))
        wait_for(f"http://127.0.0.1:{port}{probe}")
        yield Process(f"http://127.0.0.1:{port}", popen)


def fetch_exactly(url: str, encoded: EncodedMesh, mesh: str = MESH) -> bytes:
    """Stream `mesh` and hold its finest level against the quantized input.

    Returns:
        SHA-256 of the payload of all frames, by which the light clients tell that they were sent the same.
    """
    session = ClientSession(mesh)
    digest = sha256()
    decoder: Decoder | None = None
    whole = b""
    with connect(
        f"{url.replace('http', 'ws', 1)}/meshes/{mesh}/stream", compression=None, max_size=LARGEST_MESSAGE
    ) as connection:
        connection.send(session.hello())
        for frame in connection:
            assert isinstance(frame, bytes)
            digest.update(frame)
            for event in session.receive(frame):
                if isinstance(event, HeaderEvent):
                    decoder = Decoder(event.header)
                    whole = preamble(event.header_bytes)
                elif isinstance(event, PacketEvent):
                    assert decoder is not None
                    decoder.push(event.packet)
                    whole += event.data
    assert session.finished
    assert decoder is not None
    assert whole == encoded.to_bytes()
    mesh_sent, expected = decoder.mesh(0), encoded.quantized.mesh()
    assert np.array_equal(mesh_sent.vertices, expected.vertices)
    assert np.array_equal(mesh_sent.faces, expected.faces)
    return digest.digest()


def allow_descriptors(count: int) -> None:
    """Let this process and those that it starts have so many files and sockets open.

    Raises:
        UnavailableError: the system does not allow it.
    """
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < count:
        raise UnavailableError(f"{count} open files are needed and {hard} allowed; raise the limit (ulimit -Hn)")
    resource.setrlimit(resource.RLIMIT_NOFILE, (count, hard))
