"""The server's side of an encoder's process: starts it when there is a job, listens to it, ends it.

One process does one job after the other, so that the encoder is loaded once. If it dies (out of memory, say) that
job has failed, and the next one starts another process. It leads a process group of its own, and is ended with all of
that group: whatever a reader of mesh files may have started goes with it.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import signal
import sys
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshtide_codec.errors import MeshError
from meshtide_server.catalogue import Box

if TYPE_CHECKING:
    from asyncio.subprocess import Process
    from collections.abc import Callable

    from meshtide_codec.limits import FileLimits, Limits
    from meshtide_server.encoding_options import EncodingOptions

logger = logging.getLogger("meshtide.server")

END_SECONDS = 1.0
"""How long the process may take to end when it is asked to, before it is killed."""
PROGRAM = (sys.executable, "-m", "meshtide_server.encoding.worker")
"""The encoder's command line, without its limits."""
_OUT_OF_TIME = getattr(signal, "SIGXCPU", None)
"""The signal that ends a process that has used up its processor time; Windows has none."""


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
class ProcessLimits:
    """What the encoder's process may take of the machine; not held on Windows.

    Args:
        memory: bytes of data; 0: as much as there is.
        processor_seconds: processor time of one job, that of all its threads together; 0: no limit.
    """

    memory: int = 0
    processor_seconds: int = 0


@dataclass(frozen=True, slots=True)
class EncoderTask:
    """A mesh to be encoded, or a stream to be checked.

    Args:
        file: the mesh file, or None for a sample.
        sample: name of the sample, or None for a file.
        digest: of the file's content, as the cache knows it.
        options: how to encode.
        targets: where to store the stream; the first that takes it.
        limits: what the file may claim if a stranger sent it; None for one of the server's own.
        stream_limits: the same of a file that is a stream already, which is only decoded; None for the usual ones.
    """

    file: Path | None
    sample: str | None
    digest: str
    options: EncodingOptions
    targets: tuple[Path, ...]
    limits: FileLimits | None = None
    stream_limits: Limits | None = None

    def line(self) -> bytes:
        """The job as the process reads it."""
        fields = {
            "file": str(self.file) if self.file else None,
            "sample": self.sample,
            "digest": self.digest,
            "options": self.options.plain(),
            "targets": [str(target) for target in self.targets],
            "limits": asdict(self.limits) if self.limits else None,
            "stream_limits": asdict(self.stream_limits) if self.stream_limits else None,
        }
        return json.dumps(fields).encode() + b"\n"


@dataclass(frozen=True, slots=True)
class Encoded:
    """A finished job.

    Args:
        path: the stream's file, or None if no target took it.
        data: the stream in that case.
        problems: why targets did not take it.
        box: that holds its finest level.
        notes: what of the file is not in it, or was read differently.
    """

    path: Path | None
    data: bytes
    problems: tuple[str, ...]
    box: Box | None = None
    notes: tuple[str, ...] = ()


class EncoderProcess:
    """Encodes meshes in a process of its own, one at a time.

    Args:
        limits: what the process may take.
    """

    def __init__(self, limits: ProcessLimits | None = None) -> None:
        self._limits = limits or ProcessLimits()
        self._process: Process | None = None

    @property
    def running(self) -> bool:
        """Whether there is a process."""
        return self._process is not None and self._process.returncode is None

    async def encode(self, job: EncoderTask, progress: Callable[[str, float], None]) -> Encoded:
        """Do `job`; `progress` is called with stages and fractions.

        Raises:
            EncodingFailedError: the mesh cannot be encoded.
        """
        process = await self._started()
        try:
            return await self._exchange(process, job, progress)
        except EncodingFailedError:
            raise  # of this mesh only; the process takes the next one
        except (OSError, EOFError, ValueError, LookupError) as error:  # it has ended, or says what it must not
            try:
                with suppress(TimeoutError):
                    await asyncio.wait_for(process.wait(), END_SECONDS)
            finally:
                await self.close()
            raise self._early_end(process) from error
        except BaseException:
            await self.close()
            raise

    async def close(self) -> None:
        """End the process, and with it the job that it works on, and all that it has started."""
        process, self._process = self._process, None
        if process is None:
            return
        try:
            if process.returncode is None:
                _signal_group(process, signal.SIGTERM)
                with suppress(TimeoutError):
                    await asyncio.wait_for(process.wait(), END_SECONDS)
        finally:
            # The number of a group is not given to another one as long as any process is in it; with nobody left in
            # it, the system would have to go round all of its numbers in the moment since the process was waited for.
            _signal_group(process, getattr(signal, "SIGKILL", signal.SIGTERM))
        await process.wait()

    async def _started(self) -> Process:
        if self._process is None or self._process.returncode is not None:
            await self.close()  # what a process that ended between two jobs may have left behind
            self._process = await asyncio.create_subprocess_exec(
                *PROGRAM,
                str(self._limits.memory),
                str(self._limits.processor_seconds),
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                # Its own group, to be ended with; and Ctrl-C in a terminal is for the server, which then ends this one.
                start_new_session=True,
            )
            logger.debug("started the encoder's process, %d", self._process.pid)
        return self._process

    async def _exchange(self, process: Process, job: EncoderTask, progress: Callable[[str, float], None]) -> Encoded:
        assert process.stdin is not None  # noqa: S101 - it was started with pipes
        assert process.stdout is not None  # noqa: S101 - the same
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
                path = Path(event["path"]) if event["path"] else None
                (x0, y0, z0), (x1, y1, z1) = event["box"]
                box = Box((x0, y0, z0), (x1, y1, z1))
                return Encoded(path, data, tuple(event["problems"]), box, tuple(event["notes"]))

    @staticmethod
    async def _next_event(output: asyncio.StreamReader) -> dict[str, Any]:
        line = await output.readline()
        if not line.endswith(b"\n"):
            raise EOFError
        event: dict[str, Any] = json.loads(line)
        return event

    def _early_end(self, process: Process) -> EncodingFailedError:
        """The failure of a process that ended by itself; only one that ran out of time would do so again."""
        if _OUT_OF_TIME is not None and process.returncode == -_OUT_OF_TIME:
            return EncodingFailedError(f"it took more than {self._limits.processor_seconds} s of processor time")
        return EncodingFailedError(f"the encoder's process ended early, {_how_it_ended(process)}", by_process=True)


def _signal_group(process: Process, number: signal.Signals) -> None:
    """Send a signal to a process and to all that it has started."""
    with suppress(ProcessLookupError, PermissionError):  # macOS: nobody but a process that has ended is left
        if sys.platform == "win32":
            process.send_signal(number)
        else:
            os.killpg(process.pid, number)


def _how_it_ended(process: Process) -> str:
    code = process.returncode
    if code is None or code >= 0:
        return f"with exit code {code}"
    with suppress(ValueError):
        name = signal.Signals(-code).name
        return f"killed by {name}" + ("; there may be too little memory" if name == "SIGKILL" else "")
    return f"killed by signal {-code}"
