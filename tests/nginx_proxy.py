"""nginx in front of servers, with the very configuration of docker/."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import httpx
import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

CONFIGURATION = Path(__file__).parents[1] / "docker" / "nginx.conf"


@contextmanager
def behind_nginx(urls: Sequence[str], folder: Path) -> Iterator[str]:
    """The URL of a proxy in front of the servers at `urls`, which keeps its files in `folder`."""
    program = shutil.which("nginx", path="/usr/sbin:/usr/local/sbin:/usr/bin")
    if program is None:
        pytest.skip("nginx is not installed")
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    servers = "".join(f"server {url.removeprefix('http://')} max_fails=1 fail_timeout=2s; " for url in urls)
    text = CONFIGURATION.read_text().replace("/tmp", str(folder))  # noqa: S108 - what stands in the file
    text = text.replace("server meshtide:8000 max_fails=1 fail_timeout=2s;", servers)
    text = text.replace("listen 8080;", f"listen 127.0.0.1:{port};")
    user = "user root;\n" if os.geteuid() == 0 else ""  # or its workers could not reach a folder of the tests
    (folder / "nginx.conf").write_text(f"daemon off;\n{user}{text}")
    folder.chmod(0o755)
    command = [program, "-p", str(folder), "-c", str(folder / "nginx.conf")]
    with subprocess.Popen(command, stderr=subprocess.PIPE) as process:
        try:
            wait_for(f"http://127.0.0.1:{port}/healthz", process)
            yield f"http://127.0.0.1:{port}"
        finally:
            process.terminate()


def wait_for(url: str, process: subprocess.Popen[bytes] | None = None) -> None:
    """Wait until `url` is answered with 200."""
    deadline = time.monotonic() + 30
    while True:
        try:
            if httpx.get(url).status_code == 200:
                return
        except httpx.TransportError:
            pass
        assert process is None or process.poll() is None
        assert time.monotonic() < deadline, url
        time.sleep(0.05)
