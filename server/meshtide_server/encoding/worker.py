"""The encoder's process: takes jobs from standard input, encodes, and reports on standard output.

A file that is a stream already is decoded to its end instead, and given back as it is.

It is a process of its own because encoding keeps a processor busy for seconds, while the server has to answer; because
it can be ended at any time; and because a mesh that brings it down brings nothing else down. Run by `process` as
`python -m meshtide_server.encoding.worker BYTES SECONDS`: BYTES of data are all that it may have, SECONDS of processor
time all that a job may take, 0 standing for no limit. The system holds it to both, also when the server that could end
it is gone. Both directions are lines of JSON; the line of a stream that could be stored nowhere is followed by its
bytes.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import sys
import time
import traceback
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any, BinaryIO

if TYPE_CHECKING:
    from meshtide_codec.mesh import Mesh

REPORT_SECONDS = 0.1
"""Progress is reported at most this often, unless a stage begins."""
NICENESS = 10
"""How far encoding steps back behind serving where processors are scarce."""
STREAM_SUFFIX = ".tide"
LONGEST_REASON = 2000
"""Characters of a reason for a failure; a package's message may quote all of a file."""


class Reporter:
    """Writes the lines that the server reads."""

    def __init__(self, output: BinaryIO) -> None:
        self._output = output
        self._stage = ""
        self._reported = 0.0

    def progress(self, stage: str, fraction: float) -> None:
        """Report how far the job is; called by the encoder as often as it likes."""
        now = time.monotonic()
        if stage != self._stage or now - self._reported >= REPORT_SECONDS:
            self._stage, self._reported = stage, now
            self.send({"event": "progress", "stage": stage, "fraction": fraction})

    def send(self, event: dict[str, Any], data: bytes = b"") -> None:
        """Write one line, and what follows it."""
        self._output.write(json.dumps(event).encode() + b"\n" + data)
        self._output.flush()


def main() -> None:
    """Do jobs until standard input ends, and with it, whatever is being done."""
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a package prints must not end up among the reports
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    memory, processor_seconds = (int(word) for word in sys.argv[1:])
    limit_memory(memory)
    reporter = Reporter(output)
    jobs: SimpleQueue[bytes] = SimpleQueue()
    Thread(target=_take_jobs, args=(jobs,), daemon=True).start()
    try:
        while True:
            job = json.loads(jobs.get())
            limit_processor_time(processor_seconds)
            _work(job, reporter)
    except BrokenPipeError:
        os._exit(0)  # see _take_jobs


def _take_jobs(jobs: SimpleQueue[bytes]) -> None:
    """Read jobs ahead, to see at once when the server is gone, and nobody is left to answer."""
    for line in sys.stdin.buffer:
        jobs.put(line)
    os._exit(0)


def limit_memory(size: int) -> None:
    """Have allocations fail beyond `size` bytes of data, so that a hostile file cannot take the machine's memory."""
    if sys.platform != "win32":
        import resource  # noqa: PLC0415 - not on every platform

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a copy of that memory on the disk would help nobody
        if size:
            resource.setrlimit(resource.RLIMIT_DATA, (size, size))


def limit_processor_time(seconds: int) -> None:
    """Have this process killed by SIGXCPU when it has used so much more processor time than it has now."""
    if seconds and sys.platform != "win32":
        import resource  # noqa: PLC0415 - not on every platform

        used = resource.getrusage(resource.RUSAGE_SELF)
        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        limit = math.ceil(used.ru_utime + used.ru_stime) + seconds
        resource.setrlimit(resource.RLIMIT_CPU, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))


def _work(job: dict[str, Any], reporter: Reporter) -> None:
    try:
        notes: list[str] = []
        data, box = _encode(job, reporter, notes)
        path, problems = _store(data, [Path(target) for target in job["targets"]])
    except BrokenPipeError:
        raise
    except Exception as error:  # noqa: BLE001 - one bad mesh must not stop the others
        reporter.send({"event": "failed", "reason": _reason(error)[:LONGEST_REASON]})
        return
    rest = b"" if path else data
    place = str(path) if path else None
    done = {"event": "done", "path": place, "problems": problems, "box": box, "notes": notes, "bytes": len(rest)}
    reporter.send(done, rest)


def _encode(job: dict[str, Any], reporter: Reporter, notes: list[str]) -> tuple[bytes, list[list[float]]]:
    """The stream, and the smallest and largest coordinates of its finest level; notes say what was left out."""
    reporter.progress("load the encoder", 0.0)
    from meshtide_codec.command_options import profile_options  # noqa: PLC0415 - heavy, only of use in this process
    from meshtide_codec.encoder import encode  # noqa: PLC0415 - the same
    from meshtide_server.encoding_options import PROFILE_OF_EFFORTS, EncodingOptions  # noqa: PLC0415 - the same

    if job["file"] is not None and Path(job["file"]).suffix.lower() == STREAM_SUFFIX:
        return _check(job, reporter)
    reporter.progress("read the mesh", 0.0)
    mesh = _load(job, notes)
    chosen = EncodingOptions.from_plain(job["options"])
    effort = chosen.effort if chosen.profile == PROFILE_OF_EFFORTS else None
    options = profile_options(chosen.profile, chosen.bits, {"effort": effort}, {})
    encoded = encode(mesh, options, threads=1, progress=reporter.progress)
    return encoded.to_bytes(), _box_of(encoded.quantized.mesh())


def _check(job: dict[str, Any], reporter: Reporter) -> tuple[bytes, list[list[float]]]:
    """The same of a file that is a stream already, once it is known to be a right one."""
    from meshtide_codec.errors import MeshFileError  # noqa: PLC0415 - with the rest of the codec
    from meshtide_codec.limits import Limits  # noqa: PLC0415 - the same
    from meshtide_server.encoding.stream_check import STAGE, check_stream  # noqa: PLC0415 - the same

    reporter.progress(STAGE, 0.0)
    path = Path(job["file"])
    data = path.read_bytes()
    if hashlib.sha256(data).hexdigest() != job["digest"]:
        raise MeshFileError(f"{path.name} was changed while it was read")
    limits = Limits(**job["stream_limits"]) if job["stream_limits"] is not None else None
    return data, _box_of(check_stream(data, limits or Limits(), reporter.progress))


def _box_of(mesh: Mesh) -> list[list[float]]:
    return [mesh.vertices.min(axis=0).tolist(), mesh.vertices.max(axis=0).tolist()]


def _load(job: dict[str, Any], notes: list[str]) -> Mesh:
    from meshtide_codec.errors import MeshError, MeshFileError  # noqa: PLC0415 - with the rest of the codec
    from meshtide_codec.limits import FileLimits  # noqa: PLC0415 - the same
    from meshtide_codec.mesh_files.not_kept import notes_of_encoding  # noqa: PLC0415 - the same
    from meshtide_codec.mesh_files.read import mesh_of, read_source  # noqa: PLC0415 - the same
    from meshtide_codec.mesh_files.source import open_source  # noqa: PLC0415 - the same
    from meshtide_codec.samples import load_sample  # noqa: PLC0415 - the same
    from meshtide_server.hosting.stream_cache import file_digest  # noqa: PLC0415 - the same

    if job["sample"] is not None:
        return load_sample(job["sample"])
    path = Path(job["file"])
    stranger = job["limits"] is not None
    limits = FileLimits(**job["limits"]) if stranger else FileLimits()
    try:
        scene = read_source(open_source(path, limits, alone=stranger), limits)
    except MeshError as error:
        raise type(error)(f"{path.name} cannot be read as a mesh: {error}") from error
    loaded = mesh_of(scene, path.name)
    notes += notes_of_encoding(scene, loaded)
    if file_digest(path) != job["digest"]:
        raise MeshFileError(f"{path.name} was changed while it was read")
    return loaded.mesh


def _store(data: bytes, targets: list[Path]) -> tuple[Path | None, list[str]]:
    """Write `data` to the first target that takes it; returns it, and why the others did not."""
    from meshtide_codec.output_files import write_atomically  # noqa: PLC0415 - loads trimesh's module late

    problems: list[str] = []
    for target in targets:
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(target, data)
        except OSError as error:
            problems.append(f"{target.parent}: {error.strerror or error}")
        else:
            return target, problems
    return None, problems


def _reason(error: Exception) -> str:
    from meshtide_codec.errors import MeshtideError  # noqa: PLC0415 - with the rest of the codec
    from meshtide_server.operations.logs import indented  # noqa: PLC0415 - the same

    if isinstance(error, MeshtideError):
        return str(error)
    if isinstance(error, MemoryError):
        return "the mesh does not fit into memory"
    if isinstance(error, OSError):
        return f"{error.filename or 'the mesh'}: {error.strerror or error}"
    trace = "".join(traceback.format_exception(error))
    print(indented(trace.rstrip()), file=sys.stderr, flush=True)  # noqa: T201 - a fault of the encoder, for the log
    return f"the encoder failed: {type(error).__name__}: {error}"


if __name__ == "__main__":
    main()
