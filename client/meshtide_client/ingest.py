"""Uploading meshes to a server: several at a time, each one watched until the server has encoded it.

What the server has already, by its content, is left alone unless it is to be replaced; so an upload of many files that
was interrupted goes on when it is repeated. One that fails is told at the end and stops no other.
"""

from __future__ import annotations

import re
import time
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, as_completed, wait
from contextlib import contextmanager
from threading import Event
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import httpx

from meshtide_client.address import ServerAddress
from meshtide_client.credentials import authorization, find_token
from meshtide_client.ingest_plan import Ingested, IngestPlan
from meshtide_client.listing import list_meshes
from meshtide_client.problem import read_problem
from meshtide_codec.errors import MeshtideError, ProtocolError, TransferError
from meshtide_codec.printable import listed_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from concurrent.futures import Future
    from pathlib import Path

    from meshtide_client.ingest_plan import Sending

POLL_SECONDS = 0.5
CHUNK = 1 << 18
WAITING_SECONDS = 60.0
"""How long a server may ask for patience, all in all, before an upload is given up."""
LONGEST_PAUSE = 10.0
READ_AHEAD = 2
"""Files that are read for their digests and wait for a free thread, for each thread."""
_JOB = re.compile(r"[A-Za-z0-9-]{1,100}")


def ingest(
    files: Sequence[Path],
    url: str,
    *,
    token: str | None = None,
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
        parallel: how many are uploaded at a time.
        timeout: seconds without any news until the connection counts as lost.
        replace: whether to upload what the server has already; see `IngestPlan`.
        options: query parameters of each upload, such as bits, profile, effort, tag and licence.
        progress: is told of each file that is through.

    Raises:
        OptionError, ProtocolError, TransferError: the server cannot be reached, or is none.

    Returns:
        What became of each file, in their order.
    """
    server = ServerAddress.parse(url)
    token = token or find_token()
    results: dict[Path, Ingested] = {}

    def tell(result: Ingested) -> None:
        results[result.file] = result
        progress(result)

    plan = IngestPlan(files, list_meshes(url, timeout=timeout, token=token), replace=replace, tell=tell)
    headers = authorization(token)
    with httpx.Client(timeout=timeout, trust_env=not server.is_loopback, headers=headers) as client:
        upload = _Upload(client, server, dict(options or {}))
        with _pool(parallel, upload) as pool:
            running: set[Future[Ingested]] = set()
            for sending in plan.to_send():
                running.add(pool.submit(upload, sending))
                if len(running) >= READ_AHEAD * parallel:
                    done, running = wait(running, return_when=FIRST_COMPLETED)
                    for future in done:
                        tell(future.result())
            for future in as_completed(running):
                tell(future.result())
    plan.tell_twins(results)
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


class _Upload:
    """Uploads files, called from several threads."""

    def __init__(self, client: httpx.Client, server: ServerAddress, options: dict[str, Any]) -> None:
        self._client = client
        self._server = server
        self._options = options
        self.stop = Event()

    def __call__(self, sending: Sending) -> Ingested:
        """Send a file and wait until the server has encoded it."""
        file = sending.file
        try:
            job = self._send(sending)
            while job["state"] not in {"done", "failed"}:
                if self.stop.wait(POLL_SECONDS):
                    return Ingested(file, job["mesh"], "failed", "interrupted; the server goes on with it")
                job = _answer(self._client.get(f"{self._server}/jobs/{job['id']}"))
        except httpx.HTTPError as error:
            return Ingested(file, None, "failed", f"the connection was lost: {error}")
        except (MeshtideError, OSError) as error:
            return Ingested(file, None, "failed", str(error))
        return Ingested(file, job["mesh"], job["state"], job.get("error") if job["state"] == "failed" else None)

    def _send(self, sending: Sending) -> dict[str, Any]:
        """Upload; what the server asks to wait with is sent again after a while."""
        end = time.monotonic() + WAITING_SECONDS
        method, url = "POST", self._server.listing_url
        if sending.mesh is not None:
            method, url = "PUT", f"{self._server.listing_url}/{quote(sending.mesh, safe='')}"
        params = {"filename": listed_name(sending.file), **self._options}
        while True:
            response = self._client.request(method, url, params=params, content=_pieces(sending.file))
            pause = response.headers.get("Retry-After", "")
            if response.status_code != httpx.codes.TOO_MANY_REQUESTS or time.monotonic() > end or not pause.isdigit():
                return _answer(response)
            if self.stop.wait(min(float(pause), LONGEST_PAUSE)):
                raise TransferError("interrupted")


def _answer(response: httpx.Response) -> dict[str, Any]:
    if response.status_code not in {httpx.codes.OK, httpx.codes.ACCEPTED}:
        if (problem := read_problem(response.content)) is not None:
            raise problem
        raise ProtocolError(f"{response.url.path} answered with HTTP status {response.status_code}")
    try:
        job: Any = response.json()
        if not _JOB.fullmatch(job["id"]) or not isinstance(job["state"], str):
            raise ValueError(job["id"])
    except (ValueError, LookupError, TypeError) as error:
        raise ProtocolError(f"{response.url.path} does not describe a job; is this a meshtide server?") from error
    return dict(job)


def _pieces(file: Path) -> Iterator[bytes]:
    try:
        with file.open("rb") as opened:
            while piece := opened.read(CHUNK):
                yield piece
    except OSError as error:
        raise TransferError(f"{file} cannot be read: {error.strerror or error}") from error
