"""The server's side of the encoder's process: starts it when there is a job, listens to it, ends it.

One process does one job after the other, so that the encoder is loaded once. If it dies (out of memory, say) that
job has failed, and the next one starts another process.
"""

from __future__ import annotations

import asyncio
import json
import logging
import signal
import sys
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshtide_codec.errors import MeshError

if TYPE_CHECKING:
    from asyncio.subprocess import Process
    from collections.abc import Callable

    from meshtide_server.stream_cache import EncodingOptions
    from meshtide_server.upload_checks import UploadLimits

logger = logging.getLogger("meshtide.server")

END_SECONDS = 1.0
"""How long the process may take to end when it is told to, before it is killed."""


class EncodingFailedError(MeshError):
    """A mesh could not be encoded; the message says why.

    Args:
        message: why.
        by_process: whether the process died of it, so that another attempt may go better.
    """

    def __init__(self, message: str, *, by_process: bool = False) -> None:
        super().__init__(message)
        self.by_process = by_process


@dataclass(frozen=True, slots=True)
class Job:
    """A mesh to be encoded.

    Args:
        file: the mesh file, or None for a sample.
        sample: name of the sample, or None for a file.
        digest: of the file's content, as the cache knows it.
        options: how to encode.
        targets: where to store the stream; the first that takes it.
        limits: what the file may claim if a stranger sent it; None for one of the server's own.
    """

    file: Path | None
    sample: str | None
    digest: str
    options: EncodingOptions
    targets: tuple[Path, ...]
    limits: UploadLimits | None = None

    def line(self) -> bytes:
        """The job as the process reads it."""
        fields = {
            "file": str(self.file) if self.file else None,
            "sample": self.sample,
            "digest": self.digest,
            "bits": self.options.bits,
            "profile": self.options.profile,
            "targets": [str(target) for target in self.targets],
            "limits": asdict(self.limits) if self.limits else None,
        }
        return json.dumps(fields).encode() + b"\n"


@dataclass(frozen=True, slots=True)
class Encoded:
    """A finished job.

    Args:
        path: the stream's file, or None if no target took it.
        data: the stream in that case.
        problems: why targets did not take it.
    """

    path: Path | None
    data: bytes
    problems: tuple[str, ...]


class EncoderProcess:
    """Encodes meshes in a process of its own, one at a time.

    Args:
        memory: bytes of data that the process may have at most; 0: as much as there is.
    """

    def __init__(self, memory: int = 0) -> None:
        self._memory = memory
        self._process: Process | None = None

    @property
    def running(self) -> bool:
        """Whether there is a process."""
        return self._process is not None and self._process.returncode is None

    async def encode(self, job: Job, progress: Callable[[str, float], None]) -> Encoded:
        """Do `job`; `progress` is called with stages and fractions.

        Raises:
            EncodingFailedError: the mesh cannot be encoded.
        """
        process = await self._started()
        assert process.stdin is not None  # noqa: S101 - it was started with pipes
        assert process.stdout is not None  # noqa: S101 - the same
        try:
            process.stdin.write(job.line())
            await process.stdin.drain()
            while True:
                event = await self._next_event(process.stdout)
                if event["event"] == "progress":
                    progress(event["stage"], event["fraction"])
                elif event["event"] == "failed":
                    raise EncodingFailedError(event["reason"])
                else:
                    data = await process.stdout.readexactly(event["bytes"])
                    return Encoded(Path(event["path"]) if event["path"] else None, data, tuple(event["problems"]))
        except (OSError, EOFError) as error:
            with suppress(TimeoutError):
                await asyncio.wait_for(process.wait(), END_SECONDS)
            await self.close()
            message = f"the encoder's process ended early, {_how_it_ended(process)}"
            raise EncodingFailedError(message, by_process=True) from error
        except asyncio.CancelledError:
            await self.close()
            raise

    async def close(self) -> None:
        """End the process, and with it the job that it works on."""
        process, self._process = self._process, None
        if process is None:
            return
        with suppress(ProcessLookupError):
            process.terminate()
        try:
            await asyncio.wait_for(process.wait(), END_SECONDS)
        except TimeoutError:
            with suppress(ProcessLookupError):
                process.kill()
            await process.wait()

    async def _started(self) -> Process:
        if self._process is None or self._process.returncode is not None:
            self._process = await asyncio.create_subprocess_exec(
                sys.executable,
                "-m",
                "meshtide_server.encoding",
                str(self._memory),
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                start_new_session=True,  # Ctrl-C in a terminal is for the server, which then ends this process
            )
            logger.debug("started the encoder's process, %d", self._process.pid)
        return self._process

    @staticmethod
    async def _next_event(output: asyncio.StreamReader) -> dict[str, Any]:
        line = await output.readline()
        if not line.endswith(b"\n"):
            raise EOFError
        event: dict[str, Any] = json.loads(line)
        return event


def _how_it_ended(process: Process) -> str:
    code = process.returncode
    if code is None or code >= 0:
        return f"with exit code {code}"
    with suppress(ValueError):
        name = signal.Signals(-code).name
        return f"killed by {name}" + ("; there may be too little memory" if name == "SIGKILL" else "")
    return f"killed by signal {-code}"
