"""An encoder's process in which some jobs go wrong, as the names of their files say; all others are encoded.

Run like `meshtide_server.encoding.worker`, with the same arguments.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from meshtide_codec.errors import MeshFileError
from meshtide_server.encoding import worker as encoding

STREAM = Path(__file__).parents[1] / "golden" / "compact-scattered-1.tide"
BURNT_SECONDS = 0.6
"""Processor time that a job takes whose file's name begins with "burn"."""

_encode = encoding._encode


def faulty_encode(
    job: dict[str, Any], reporter: encoding.Reporter, notes: list[str]
) -> tuple[bytes, list[list[float]]]:
    file = Path(job["file"])
    fault = FAULTS.get(file.stem.split("-")[0]) if file.suffix != ".tide" else None
    return (fault(reporter), [[0.0] * 3] * 2) if fault is not None else _encode(job, reporter, notes)


def spin(_: encoding.Reporter) -> bytes:
    while True:
        pass


def sleep(reporter: encoding.Reporter) -> bytes:
    reporter.progress("sleep", 0.5)
    while True:
        time.sleep(3600.0)


def die(_: encoding.Reporter) -> bytes:
    os._exit(3)


def crash(_: encoding.Reporter) -> bytes:
    signal.raise_signal(signal.SIGSEGV)
    return b""


def parent(reporter: encoding.Reporter) -> bytes:
    _have_child(reporter)
    return sleep(reporter)


def orphan(reporter: encoding.Reporter) -> bytes:
    _have_child(reporter)
    os._exit(0)


def garbage(reporter: encoding.Reporter) -> bytes:
    reporter._output.write(b"what is this?\n")
    reporter._output.flush()
    return b""


def wordy(_: encoding.Reporter) -> bytes:
    raise MeshFileError("no " * 100_000)


def burn(_: encoding.Reporter) -> bytes:
    until = time.process_time() + BURNT_SECONDS
    while time.process_time() < until:
        pass
    return STREAM.read_bytes()


def quick(_: encoding.Reporter) -> bytes:
    return b"quick"


def _have_child(reporter: encoding.Reporter) -> None:
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"], stdin=subprocess.DEVNULL)
    reporter.progress(f"child {child.pid}", 0.0)


FAULTS = {fault.__name__: fault for fault in (spin, sleep, die, crash, parent, orphan, garbage, wordy, burn, quick)}

if __name__ == "__main__":
    encoding._encode = faulty_encode
    encoding.main()
