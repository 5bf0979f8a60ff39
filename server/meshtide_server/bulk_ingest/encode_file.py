"""Encoding one file of a bulk ingest: the one function that is run here and on the machines of a Dask cluster.

It reads nothing but the file and writes nothing at all: the stream is what it returns. So a worker may die at any
moment and its file be given to another one, workers need no access to store and database, and all that is published
is published by one process. What a stream takes on its way is small beside the work of making it: a few bytes a
vertex. The file is checked, read and encoded in a process of its own with limits of memory and time.
"""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshtideError
from meshtide_server.bulk_ingest.idle_encoders import encoder_taken
from meshtide_server.encoding.process import EncoderTask, EncodingFailedError
from meshtide_server.hosting.stream_cache import codec_digest, file_digest

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from meshtide_codec.limits import FileLimits, Limits
    from meshtide_server.catalogue import Box
    from meshtide_server.encoding.process import ProcessLimits
    from meshtide_server.encoding_options import EncodingOptions

ATTEMPTS = 2
"""How often a file is begun whose encoder's process dies."""


@dataclass(frozen=True, slots=True)
class FileTask:
    """A file to be encoded.

    Args:
        path: where it lies for whoever ingests it, and perhaps for whoever encodes it.
        digest: SHA-256 of its content, in hexadecimal.
        options: how to encode it.
        limits: what it may claim.
        stream_limits: the same of a file that is a stream already, which is only decoded.
        process: what its encoder's process may take.
        seconds: how long it may take.
        codec: digest of the codec that is to encode it; see `codec_digest`.
    """

    path: Path
    digest: str
    options: EncodingOptions
    limits: FileLimits
    stream_limits: Limits
    process: ProcessLimits
    seconds: float
    codec: str


@dataclass(frozen=True, slots=True)
class FileOutcome:
    """What became of a `FileTask`: a stream and its box, or one of the other two.

    Args:
        stream: the `.tide` file.
        box: that holds its finest level.
        error: why there is none.
        elsewhere: there is no such file here; send its content along.
        notes: what of the file is not in the stream, or was read differently.
    """

    stream: bytes | None = None
    box: Box | None = None
    error: str | None = None
    elsewhere: bool = False
    notes: tuple[str, ...] = ()


Progress = Callable[[str, float], None]


async def encode_file(
    task: FileTask, content: bytes | None = None, progress: Progress = lambda _stage, _fraction: None
) -> FileOutcome:
    """Check a mesh file, read it, encode it; a stream is decoded, and returned as it is.

    Failures are returned, for what is raised on a cluster is lost in logs.

    Args:
        task: what to do.
        content: of the file, for a machine that does not see it.
        progress: called with the stage and the fraction done.
    """
    if task.codec != codec_digest():
        return FileOutcome(error="the worker has another version of meshtide; install the same one everywhere")
    try:
        async with _local_file(task, content) as path:
            return FileOutcome(elsewhere=True) if path is None else await _encode(task, path, progress)
    except (MeshtideError, OSError) as error:
        return FileOutcome(error=str(error))


async def _encode(task: FileTask, path: Path, progress: Progress) -> FileOutcome:
    job = EncoderTask(path, None, task.digest, task.options, (), task.limits, task.stream_limits)
    reason = ""
    for _ in range(ATTEMPTS):
        try:
            async with asyncio.timeout(task.seconds), encoder_taken(task.process) as encoder:
                encoded = await encoder.encode(job, progress)
                return FileOutcome(encoded.data, encoded.box, notes=encoded.notes)
        except TimeoutError:
            return FileOutcome(error=f"it took longer than {task.seconds:g} s (MESHTIDE_JOB_SECONDS)")
        except EncodingFailedError as error:
            reason = str(error)
            if not error.by_process:
                break
    return FileOutcome(error=reason)


@asynccontextmanager
async def _local_file(task: FileTask, content: bytes | None) -> AsyncIterator[Path | None]:
    """The file on this machine; None if it is not here, or another one of that name."""
    if content is None:
        try:
            same = await asyncio.to_thread(file_digest, task.path) == task.digest
        except OSError:
            same = False
        yield task.path if same else None
        return
    with tempfile.TemporaryDirectory(prefix="meshtide-ingest-") as folder:
        path = Path(folder) / task.path.name
        await asyncio.to_thread(path.write_bytes, content)
        yield path
