"""A server in a process of its own, of which memory, descriptors and log are watched."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import httpx
import psutil

from meshtide_codec.encoder import encode
from meshtide_codec.samples import load_sample

if TYPE_CHECKING:
    from collections.abc import Iterator

MESH = "spot"
WRITE_TOKEN = "token-of-the-load-test"  # noqa: S105 - it opens a server that lives for minutes, on this machine only
ALLOWED_GROWTH = 48 << 20
"""Bytes of memory: an allocator does not give all back; a leak of 5 KiB a request is found in 10 000 of them."""
ALLOWED_DESCRIPTORS = 24
"""More than at first: five connections to a SQLite catalogue take three each, an encoder's process three."""
_QUIET_SECONDS = 20.0
_JOBS_SECONDS = 120.0
_JOB_METRICS = ("meshtide_jobs_waiting ", "meshtide_jobs_running ")
_FAULTS = ("Traceback", "a fault of the server", "ERROR", "CRITICAL")
_LINES_OF_A_FAULT = 40


@dataclass
class WatchedServer:
    """The process, and what was wrong with it."""

    url: str
    process: subprocess.Popen[bytes]
    log: Path
    to_be_empty: tuple[Path, ...]
    """Folders in which nothing may be left when no request and no job is worked on."""
    problems: list[str] = field(default_factory=list)
    _memory: int = 0
    _descriptors: int = 0

    @property
    def watched(self) -> psutil.Process:
        """The process, for its figures."""
        return psutil.Process(self.process.pid)

    def wait_for_jobs(self) -> None:
        """Wait until no job waits or runs; too long is a problem."""
        deadline = time.monotonic() + _JOBS_SECONDS
        while True:
            lines = httpx.get(f"{self.url}/metrics", timeout=30.0).text.splitlines()
            counts = [float(line.split()[1]) for line in lines if line.startswith(_JOB_METRICS)]
            if len(counts) == len(_JOB_METRICS) and not any(counts):
                return
            if time.monotonic() > deadline:
                self.problems.append(f"{counts} jobs wait and run after {_JOBS_SECONDS:g} s")
                return
            time.sleep(0.1)

    def note(self) -> None:
        """Remember memory and descriptors, once the server has got warm."""
        self._settle(0)
        self._memory = self.watched.memory_info().rss
        self._descriptors = self.watched.num_fds()

    def growth(self) -> dict[str, int]:
        """How much of both there is more than was noted; too much is a problem, and so are faults in the log."""
        if self.process.poll() is not None:
            self.problems.append(f"the server ended with exit code {self.process.returncode}: {self._last_words()}")
            return {}
        self._settle(self._descriptors + ALLOWED_DESCRIPTORS)
        if httpx.get(f"{self.url}/healthz", timeout=30.0).status_code != httpx.codes.OK:
            self.problems.append("/healthz does not answer")
        memory = self.watched.memory_info().rss - self._memory
        descriptors = self.watched.num_fds() - self._descriptors
        if memory > ALLOWED_GROWTH:
            self.problems.append(f"memory has grown by {memory} bytes")
        if descriptors > ALLOWED_DESCRIPTORS:
            self.problems.append(f"there are {descriptors} descriptors more")
        left = [path for folder in self.to_be_empty for path in folder.glob("*")]
        if left:
            self.problems.append(f"{len(left)} files are left behind, such as {left[0]}")
        lines = self.log.read_text(errors="replace").splitlines()
        faults = [place for place, line in enumerate(lines) if any(fault in line for fault in _FAULTS)]
        self.problems += ["\n".join(lines[place : place + _LINES_OF_A_FAULT]) for place in faults[:10]]
        return {"memory_growth": memory, "descriptor_growth": descriptors}

    def _settle(self, descriptors: int) -> None:
        """Wait until connections that were left behind have ended: until there are no more than so many, or no news."""
        deadline = time.monotonic() + _QUIET_SECONDS
        before = -1
        while time.monotonic() < deadline:
            now = self.watched.num_fds()
            if now <= descriptors or (not descriptors and now == before):
                return
            before = now
            time.sleep(0.5)

    def _last_words(self) -> str:
        return " | ".join(self.log.read_text(errors="replace").splitlines()[-5:])


@contextmanager
def watched_server(*arguments: str, environment: dict[str, str] | None = None) -> Iterator[WatchedServer]:
    """Start a server of one mesh on loopback, which takes uploads; it is stopped at the end of the block.

    Args:
        arguments: of its command line.
        environment: more settings.
    """
    with TemporaryDirectory() as scratch:
        folder = Path(scratch) / "meshes"
        folder.mkdir()
        stream = encode(load_sample(MESH)).to_bytes()
        for place in (folder, folder / "sub" / "deep"):
            place.mkdir(parents=True, exist_ok=True)
            (place / f"{MESH}.tide").write_bytes(stream)
        log = Path(scratch) / "log"
        command = [
            sys.executable,
            "-m",
            "meshtide_server",
            str(folder),
            "--recursive",
            "--port",
            "0",
            "--announce",
            *arguments,
        ]
        data, temporary = Path(scratch) / "data", Path(scratch) / "temporary"
        temporary.mkdir()
        settings = {
            "MESHTIDE_WRITE_TOKENS": WRITE_TOKEN,
            "MESHTIDE_WRITES_PER_MINUTE": "0",
            "MESHTIDE_DATA": str(data),
            "TMPDIR": str(temporary),
            **(environment or {}),
        }
        with (
            log.open("wb") as errors,
            subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, env={**os.environ, **settings}) as process,
        ):
            try:
                assert process.stdout is not None
                url = json.loads(process.stdout.readline())["url"]
                _wait_until_ready(url)
                yield WatchedServer(
                    url, process, log, (data / "store" / "sources", data / "store" / ".parts", temporary)
                )
            finally:
                process.terminate()


def _wait_until_ready(url: str) -> None:
    deadline = time.monotonic() + 120.0
    while httpx.get(f"{url}/meshes/{MESH}").status_code != httpx.codes.OK and time.monotonic() < deadline:
        time.sleep(0.1)
