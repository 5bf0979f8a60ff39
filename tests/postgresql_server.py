"""A PostgreSQL server for the tests, from the system's packages: a cluster in a folder, thrown away afterwards."""

from __future__ import annotations

import os
import pwd
import shutil
import socket
import subprocess
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

START_SECONDS = 60
USER = "meshtide"


def program(name: str) -> str:
    """The path of a program of PostgreSQL; skips the test where it is not installed."""
    versions = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    found = str(versions[-1]) if versions else shutil.which(name)
    if found is None:
        pytest.skip("PostgreSQL is not installed; on Debian: apt-get install postgresql")
    return found


def unprivileged_user() -> str | None:
    """The user to run the server as, for root may not; None for the present one."""
    if os.geteuid() != 0:
        return None
    for name in ("postgres", "nobody"):
        try:
            return pwd.getpwnam(name).pw_name
        except KeyError:
            continue
    pytest.skip("PostgreSQL does not run as root, and there is no user postgres or nobody")


@contextmanager
def running_postgresql(
    password: str = "", arguments: Sequence[str] = ("-A", "trust", "--locale=C.UTF-8")
) -> Iterator[str]:
    """The URL of an empty database, in the manner of SQLAlchemy without a driver.

    Args:
        password: of the user; "" for a server that asks for none.
        arguments: how the cluster is made.
    """
    initdb, postgres = program("initdb"), program("postgres")
    user = unprivileged_user()
    folder = Path(tempfile.mkdtemp(prefix="meshtide-postgresql-"))  # pytest's folders are closed to other users
    try:
        if user is not None:
            shutil.chown(folder, user)
        data = folder / "data"
        create = [initdb, "-D", str(data), "-U", USER, "-E", "UTF8", "--no-sync", *arguments]
        if password:
            (folder / "password").write_text(password)
            (folder / "password").chmod(0o644)
            create += [f"--pwfile={folder / 'password'}"]
        subprocess.run(create, user=user, cwd=folder, check=True, capture_output=True)
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = int(probe.getsockname()[1])
        options = ["-D", str(data), "-k", "", "-p", str(port), "-c", "listen_addresses=127.0.0.1", "-c", "fsync=off"]
        with (folder / "log").open("wb") as log:
            process = subprocess.Popen([postgres, *options], user=user, cwd=folder, stdout=log, stderr=log)
        try:
            wait_until_it_listens(port, process, folder / "log")
            yield f"postgresql://{USER}{password and ':'}{password}@127.0.0.1:{port}/postgres"
        finally:
            process.terminate()
            process.wait(30)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def wait_until_it_listens(port: int, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + START_SECONDS
    while "ready to accept connections" not in log.read_text():
        if process.poll() is not None or time.monotonic() > deadline:
            raise AssertionError(f"PostgreSQL does not start on port {port}:\n{log.read_text()[-3000:]}")
        time.sleep(0.05)
