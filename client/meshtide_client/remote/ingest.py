"""Uploading meshes to a server: several at a time, each one watched until the server has encoded it.

What the server has already, by its content, is left alone unless it is to be replaced; so an upload of many files that
was interrupted goes on when it is repeated. One that fails is reported at the end and stops no other.
"""

from __future__ import annotations

import re
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, as_completed, wait
from contextlib import contextmanager
from threading import Event
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote

import httpx

from meshtide_client.connection.address import ServerAddress
from meshtide_client.connection.credentials import VARIABLE, find_token
from meshtide_client.remote.ingest_plan import Ingested, IngestPlan
from meshtide_client.remote.listing import list_meshes
from meshtide_client.remote.web_client import WebClient, refusal
from meshtide_codec.errors import MeshtideError, PeerError, ProtocolError, TransferError
from meshtide_codec.printable import listed_name
from meshtide_codec.stream import plain_values

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from concurrent.futures import Future
    from pathlib import Path

    from meshtide_client.remote.ingest_plan import Sending
    from meshtide_client.remote.web_client import Answer

POLL_SECONDS = 0.5
CHUNK = 1 << 18
WAITING_SECONDS = 60.0
"""How long a server may ask for patience, all in all, before an upload is given up."""
LONGEST_PAUSE = 10.0
READ_AHEAD = 2
"""Files that are read for their digests and wait for a free thread, for each thread."""
UNCHANGED_POLLS = 7200
"""How often a job is asked for whose answer stays the same, before it is given up: an hour in a queue is long."""
MOST_POLLS = 172_800
"""How often it is asked for at all: for a day."""
LARGEST_JOB = 1 << 20
_LONGEST_TEXT = 10_000
_MOST_NOTES = 100
_WAITING = frozenset({"queued", "running"})
_ENDED = frozenset({"done", "failed"})
_JOB = re.compile(r"[A-Za-z0-9-]{1,100}")


def ingest(
    files: Sequence[Path],
    url: str,
    *,
    token: str | None = None,
    ca_file: Path | str | None = None,
    parallel: int = 4,
    timeout: float = 30.0,
    replace: bool = False,
    options: dict[str, Any] | None = None,
    progress: Callable[[Ingested], None] = lambda _: None,
) -> list[Ingested]:
    """Upload files to the server at `url` and wait until each is encoded.

    Args:
        files: to be uploaded.
        url: the server's address.
        token: for writing, or None for that of the environment.
        ca_file: of the authorities that vouch for the server, or None for those of the environment or the machine.
        parallel: how many are uploaded at a time.
        timeout: seconds without any news until the connection counts as lost.
        replace: whether to upload what the server has already; see `IngestPlan`.
        options: query parameters of each upload, such as bits, profile, effort, tag and licence.
        progress: called for each file that is done.

    Raises:
        OptionError, ProtocolError, TransferError: the server cannot be reached, or is none.
        PeerError: it takes nothing without another token; the files that are left are not sent.

    Returns:
        What became of each file, in their order.
    """
    server = ServerAddress.parse(url)
    token = token or find_token()
    results: dict[Path, Ingested] = {}

    def report(result: Ingested) -> None:
        results[result.file] = result
        progress(result)

    plan = IngestPlan(
        files, list_meshes(url, timeout=timeout, token=token, ca_file=ca_file), replace=replace, report=report
    )
    with WebClient(server, timeout=timeout, token=token, ca_file=ca_file) as client:
        upload = _Upload(client, server, dict(options or {}))
        with _pool(parallel, upload) as pool:
            running: set[Future[Ingested]] = set()
            for sending in plan.to_send():
                running.add(pool.submit(upload, sending))
                if len(running) >= READ_AHEAD * parallel:
                    done, running = wait(running, return_when=FIRST_COMPLETED)
                    for future in done:
                        report(future.result())
            for future in as_completed(running):
                report(future.result())
    plan.report_twins(results)
    return [results[file] for file in files]


@contextmanager
def _pool(parallel: int, upload: _Upload) -> Iterator[ThreadPoolExecutor]:
    """Threads that upload; whoever interrupts them waits for no more than the requests that are under way."""
    with ThreadPoolExecutor(parallel, thread_name_prefix="upload") as pool:
        try:
            yield pool
        except BaseException:
            upload.stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


class _UnauthorizedError(PeerError):
    """The server takes another token, for this file and for all others."""


class _Upload:
    """Uploads files, called from several threads."""

    def __init__(self, client: WebClient, server: ServerAddress, options: dict[str, Any]) -> None:
        self._client = client
        self._server = server
        self._jobs = f"{server.listing_url.rpartition('/')[0]}/jobs"
        self._options = options
        self._refusal: _UnauthorizedError | None = None
        self.stop = Event()

    def __call__(self, sending: Sending) -> Ingested:
        """Send a file and wait until the server has encoded it.

        Raises:
            PeerError: the server takes nothing without another token; no further file is sent.
        """
        if self._refusal is not None:
            raise self._refusal
        file = sending.file
        try:
            job = self._send(sending)
            polls = unchanged = 0
            while job.state in _WAITING:
                if self.stop.wait(POLL_SECONDS):
                    return Ingested(file, job.mesh, "failed", "interrupted; the server goes on with it")
                if unchanged == UNCHANGED_POLLS or polls == MOST_POLLS:
                    waited = f"{(unchanged if polls < MOST_POLLS else polls) * POLL_SECONDS / 60:g} minutes"
                    message = f"job {job.id} has not come further for {waited}; the server may go on with it"
                    return Ingested(file, job.mesh, "failed", message)
                before, job = job, _job(self._ask("GET", f"{self._jobs}/{job.id}"), job)
                polls, unchanged = polls + 1, (unchanged + 1 if job == before else 0)
        except _UnauthorizedError:
            raise
        except (MeshtideError, OSError) as error:
            return Ingested(file, None, "failed", str(error))
        return Ingested(file, job.mesh, job.state, job.error if job.state == "failed" else None, job.notes)

    def _send(self, sending: Sending) -> _ServerJob:
        """Upload; what the server asks to wait with is sent again after a while."""
        left = WAITING_SECONDS
        method, url = "POST", self._server.listing_url
        if sending.mesh is not None:
            method, url = "PUT", f"{self._server.listing_url}/{quote(sending.mesh, safe='')}"
        params = {"filename": listed_name(sending.file), **self._options}
        while True:
            content = _pieces(sending.file)
            answer = self._ask(method, url, params=params, content=content)
            pause = _pause(answer.headers.get("Retry-After", ""))
            if answer.status != httpx.codes.TOO_MANY_REQUESTS or left <= 0 or pause is None:
                return _job(answer)
            left -= pause
            if self.stop.wait(pause):
                raise TransferError("interrupted")

    def _ask(self, method: str, url: str, **more: Any) -> Answer:  # noqa: ANN401 - httpx's
        answer = self._client.ask(method, url, largest=LARGEST_JOB, **more)
        if answer.status == httpx.codes.UNAUTHORIZED:
            words = f"{self._server} does not know the token, or was sent none; set {VARIABLE} or --token-file"
            self._refusal = _UnauthorizedError("unauthorized", words)
            raise self._refusal
        return answer


class _ServerJob(NamedTuple):
    """What a server says of a job."""

    id: str
    mesh: str | None
    state: str
    error: str | None
    stage: str
    progress: str
    notes: tuple[str, ...]


def _job(answer: Answer, before: _ServerJob | None = None) -> _ServerJob:
    """The job that an answer is about, which has to be the same as `before`."""
    place = "the upload" if before is None else f"job {before.id}"
    if answer.status not in {httpx.codes.OK, httpx.codes.ACCEPTED}:
        raise refusal(answer, place)
    try:
        value = answer.value()
        job = _ServerJob(
            id=plain_values.text(value["id"], "id", _LONGEST_TEXT),
            mesh=_optional_text(value, "mesh"),
            state=plain_values.text(value["state"], "state", _LONGEST_TEXT),
            error=_optional_text(value, "error"),
            stage=str(value.get("stage"))[:_LONGEST_TEXT],
            progress=str(value.get("progress"))[:_LONGEST_TEXT],
            notes=_notes(value.get("notes")),
        )
        if not _JOB.fullmatch(job.id) or (before is not None and job.id != before.id):
            raise ValueError(job.id)
        if job.state not in _WAITING | _ENDED:
            raise ValueError(job.state)
    except (ValueError, LookupError, TypeError, AttributeError, plain_values.BadValueError) as error:
        raise ProtocolError(f"what answers for {place} does not describe a job; is this a meshtide server?") from error
    return job


def _optional_text(value: Any, name: str) -> str | None:  # noqa: ANN401 - anything may come
    return None if value.get(name) is None else plain_values.text(value[name], name, _LONGEST_TEXT)


def _notes(value: Any) -> tuple[str, ...]:  # noqa: ANN401 - anything may come
    """What a job notes of its file."""
    lines = [] if value is None else plain_values.array(value, "notes")[:_MOST_NOTES]
    return tuple(plain_values.text(line, "notes", _LONGEST_TEXT) for line in lines)


def _pause(header: str) -> float | None:
    """Seconds to wait by a header Retry-After, within reason; None if it gives none.

    >>> _pause("3"), _pause("0"), _pause("9" * 400), _pause("soon")
    (3.0, 0.5, 10.0, None)
    """
    if not header.isascii() or not header.isdigit():
        return None
    return min(max(float(header), POLL_SECONDS), LONGEST_PAUSE)


def _pieces(file: Path) -> Iterator[bytes]:
    try:
        with file.open("rb") as opened:
            while piece := opened.read(CHUNK):
                yield piece
    except OSError as error:
        raise TransferError(f"{file} cannot be read: {error.strerror or error}") from error
