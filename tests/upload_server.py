"""Servers that take uploads, each in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

TOKEN = "only-for-these-tests-0000"  # noqa: S105 - of servers that the tests start


@contextmanager
def taking_uploads(*program: str, **settings: str) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """URL and process of a server with TOKEN for writing, and with more environment variables.

    Args:
        program: what Python runs, instead of the server as it is.
        settings: environment variables.
    """
    environment = {
        **os.environ,
        "MESHTIDE_WRITE_TOKENS": TOKEN,
        "MESHTIDE_JOB_LOST_SECONDS": "1",
        "MESHTIDE_CATALOGUE_SECONDS": "0.2",
        "MESHTIDE_WRITES_PER_MINUTE": "0",
        **settings,
    }
    command = [sys.executable, *(program or ("-m", "meshtide_server")), "--port", "0", "--announce"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment) as process:
        try:
            assert process.stdout is not None
            yield json.loads(process.stdout.readline())["url"], process
        finally:
            process.terminate()
