"""A server in a process of its own, for as long as a block lasts: started on a free port, always stopped."""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import threading
from contextlib import contextmanager
from tempfile import TemporaryFile
from typing import IO, TYPE_CHECKING

from meshtide_codec.errors import TransferError
from meshtide_codec.termination import terminable

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_COMMAND = (sys.executable, "-m", "meshtide_server", "--host", "127.0.0.1", "--port", "0", "--announce")
_STOP_SECONDS = 10.0
_LOG_LINES = 5


@contextmanager
def running_server(arguments: Sequence[str] = ("--samples",), *, wait: float = 60.0) -> Iterator[str]:
    """Start a server and yield its URL once it listens; it is stopped at the end of the block, however that is left.

    Args:
        arguments: what it hosts.
        wait: seconds it has to start in.

    Raises:
        TransferError: it did not start; the message ends with what it said.
    """
    with TemporaryFile() as log, terminable():
        process = subprocess.Popen(  # noqa: S603 - this interpreter, a module of this project
            [*_COMMAND, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=log,
            start_new_session=True,  # Ctrl-C is for this process, which then stops the server itself
        )
        try:
            yield _announced_url(process, log, wait)
        finally:
            _stop(process)


def _announced_url(process: subprocess.Popen[bytes], log: IO[bytes], wait: float) -> str:
    lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    assert process.stdout is not None  # noqa: S101 - it is a pipe
    output = process.stdout
    threading.Thread(target=lambda: lines.put(output.readline()), daemon=True).start()
    try:
        line = lines.get(timeout=wait)
    except queue.Empty:
        raise TransferError(f"the server did not start within {wait:g} seconds; {_last_words(log)}") from None
    try:
        return str(json.loads(line)["url"])
    except (ValueError, LookupError, TypeError) as error:
        raise TransferError(f"the server did not start; {_last_words(log)}") from error


def _last_words(log: IO[bytes]) -> str:
    log.seek(0)
    lines = [line for line in log.read().decode(errors="replace").splitlines() if line.strip()]
    return f"it said: {' | '.join(lines[-_LOG_LINES:])}" if lines else "it said nothing"


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(_STOP_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()
