"""Random and mutated HTTP requests against a real server: `python tests/bench/load/fuzz_http.py --requests 10000`.

Five kinds take turns: requests that fit the OpenAPI document and requests that break it (both made by schemathesis),
requests for addresses that exist with headers and methods that were made up, uploads with the token that they need, of
meshes of every format and of streams that lie, whole and damaged, which are then read, replaced and deleted, bytes that
are hardly HTTP, written to the socket, and floods: heads, lines, chunks and trailers that do not end. Any answer of 500
and above (but 503 with the code `not-ready`), an end of the server, a line about a fault in its log, growing memory or
descriptors, a job that ends in a fault or does not end, a good mesh that is refused, or an uploaded file that is left
in the store is a failure: the exit code is 1 then.

Settings of the server that the environment names hold here too: with MESHTIDE_DATABASE and MESHTIDE_STORE, it is tried
on another database and another store than those in a folder.
"""

from __future__ import annotations

import json
import socket
import sys
import warnings
from collections import Counter
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, urlsplit

import httpx
import requests
import schemathesis
from fuzz_uploads import IDS, Upload, Uploads
from fuzzing import Budget, run_command
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import seed as hypothesis_seed
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from schemathesis.core.result import Ok
from watched_server import MESH, WRITE_TOKEN, watched_server

if TYPE_CHECKING:
    from collections.abc import Iterator

BATCH = 40
"""Requests to one operation before it is another one's turn."""
MOST_FLOODED = 8 << 20
"""Bytes of a flood, if the server takes them all."""
WAITING = 40
"""Uploads that may wait to be encoded before the next ones are sent."""
_WRITER = {"Authorization": f"Bearer {WRITE_TOKEN}"}
_VIEWS = ("", ".tide", "/header", "/nothing")
_CHANGES: dict[str, tuple[Any, ...]] = {
    "name": ("a name", "", "\x00", "\ud800", "x" * 1000, None, 5),
    "tags": (["a", "b"], [], ["\x00"], ["x" * 1000], ["a"] * 100, None, {}, "a"),
    "licence": ("CC0", "", "\x00", "x" * 30_000, None),
    "other": (1,),
}
_FAULTS = ("a fault of the server", "internal error", "the encoder failed", "ended early")
"""What the reason of no failure may be: these are the server's mistakes, not the upload's."""
_SETTINGS = {
    "MESHTIDE_MAX_UPLOAD": "100000",
    "MESHTIDE_MAX_VERTICES": "20000",
    "MESHTIDE_MAX_FACES": "40000",
    "MESHTIDE_JOB_MEMORY": str(2 << 30),
    "MESHTIDE_JOB_SECONDS": "60",
    "MESHTIDE_JOB_PROCESSOR_SECONDS": "60",
    "MESHTIDE_JOB_PROCESSES": "2",
    "MESHTIDE_UPLOAD_STALL_TIMEOUT": "1",
}
_PLACES = (
    "/sub/deep/spot",
    "/sub%2Fdeep%2Fspot",
    "/sub/deep",
    "/sub/../spot",
    "/sub/%2e%2e/spot",
    "//spot",
    "/a" * 500,
)
_CHUNKS = b" HTTP/1.1\r\nHost: h\r\nTransfer-Encoding: chunked\r\n\r\n"
_FLOODS = (
    (b"", b"a"),
    (b" HTTP/1.1\r\nHost: h\r\nX: ", b"b"),
    (b" HTTP/1.1\r\nHost: h\r\n", b"X: 1\r\n"),
    (b" HTTP/1.1\r\nHost: h\r\n\r\n", b"\r\n"),
    (_CHUNKS, b"1"),
    (_CHUNKS, b"1\r\nx\r\n"),
    (_CHUNKS + b"0\r\n", b"X: 1\r\n"),
    (b" HTTP/1.1\r\nHost: h\r\nContent-Length: 10\r\n\r\n0123456789", b"GET /healthz HTTP/1.1\r\nHost: h\r\n\r\n"),
)
"""How a request goes on behind its address, and what is repeated then."""
_METHODS = (*["GET"] * 9, "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "BREW")
_RANGES = ("bytes=0-", "bytes=-1", "bytes=5-9", "bytes=5-2", "bytes=0-0,2-3", "bytes=99999999999999999999-", "bytes=-0")
_TAGS = ("*", '"x"', 'W/"x"', '"', "\x7f")
_HEADERS = {
    "Range": _RANGES,
    "If-Range": _TAGS,
    "If-Match": _TAGS,
    "If-None-Match": _TAGS,
    "Authorization": ("Bearer", f"Bearer {WRITE_TOKEN}", "Basic Og==", "Bearer \x7f"),
    "Accept-Encoding": ("gzip", "identity;q=0", "*"),
    "Origin": ("null", "https://elsewhere.example", "://"),
    "Host": ("", "elsewhere", "[::1"),
    "Content-Type": ("application/json", "multipart/form-data; boundary=x", "model/ply"),
    "Content-Encoding": ("gzip", "br"),
    "X-Request-ID": ("checkout-17", "x" * 1000, "\x00"),
    "X-Forwarded-For": ("203.0.113.7", "[", ","),
    "Expect": ("100-continue",),
    "Access-Control-Request-Method": ("PUT", "BREW"),
}


class Fuzzer:
    """Sends requests and looks at the answers.

    Args:
        budget: how many requests, and for how long.
    """

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._server = budget.server
        self._random = budget.random
        self._session = requests.Session()
        self._session.trust_env = False
        self._uploads = Uploads(budget.random)
        self.jobs: dict[str, bool] = {}
        """The jobs of uploads that were taken, and whether each is to go well."""
        self.statuses: Counter[int] = Counter()
        self.unsent: Counter[str] = Counter()
        """Requests that got no answer, by the client's error: such as headers that it does not write."""

    @property
    def done(self) -> bool:
        """Whether there was enough of requests, of time, or of problems."""
        return self._budget.done

    def run(self) -> None:
        """Send all requests."""
        schema = schemathesis.openapi.from_url(f"{self._server.url}/openapi.json")
        operations = [result.ok() for result in schema.get_all_operations() if isinstance(result, Ok)]
        digest = httpx.get(f"{self._server.url}/meshes/{MESH}").json()["packets"][0]["sha256"]
        paths = [path.replace("{mesh_id}", MESH).replace("{digest}", digest) for path in schema.raw_schema["paths"]]
        warm = False
        while not self.done:
            for operation in operations:
                for mode in (GenerationMode.POSITIVE, GenerationMode.NEGATIVE):
                    if not self.done:
                        self._from_schema(operation, mode)
            turns = (*[self._made_up, self._upload] * len(operations), self._junk, self._flood)
            for turn in turns:
                for _ in range(BATCH):
                    if not self.done:
                        turn(self._random.choice(paths))
            if not warm:
                warm = True
                self._server.note()

    def _from_schema(self, operation: Any, mode: GenerationMode) -> None:
        @hypothesis_seed(self._random.getrandbits(32))
        @settings(
            max_examples=BATCH,
            database=None,
            deadline=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(operation.as_strategy(generation_mode=mode))
        def send(case: Any) -> None:
            if self.done:
                return
            headers = _WRITER if self._random.random() < 0.5 else {}
            with self._told(f"{case.method} {case.formatted_path!r}"):
                answer = case.call(session=self._session, headers=headers, timeout=30.0)
                self._note(answer.status_code, answer.content, f"{case.method} {case.formatted_path!r}")

        with suppress(
            schemathesis.errors.SchemathesisError, Unsatisfiable
        ):  # an operation of which nothing wrong can be made
            send()

    def _made_up(self, path: str) -> None:
        """A request for an address that exists, more or less, with headers of all sorts."""
        pick = self._random
        if pick.random() < 0.2:
            path = path.replace(f"/{MESH}", pick.choice(_PLACES))
        if pick.random() < 0.3:
            place = pick.randrange(len(path) + 1)
            path = path[:place] + quote(pick.randbytes(pick.randrange(1, 40))) + path[place:]
        elif pick.random() < 0.1:
            path += "?" + quote(pick.randbytes(20), safe="&=")
        names = pick.sample(sorted(_HEADERS), pick.randrange(4))
        headers = {name: pick.choice(_HEADERS[name]).encode() for name in names}
        body = pick.randbytes(pick.choice((0, 0, 1, 300, 70_000)))
        with self._told(f"{path!r} {headers}"):
            answer = self._session.request(
                pick.choice(_METHODS), self._server.url + path, headers=headers, data=body, timeout=30.0
            )
            self._note(answer.status_code, answer.content, f"{answer.request.method} {path!r} {headers}")

    def _upload(self, _: str) -> None:
        """An upload, or something done with an earlier one."""
        pick = self._random
        if pick.random() < 0.4:
            self._use()
            return
        upload = self._uploads.next()
        what = f"{upload.method} {upload.path} {upload.query} with {len(upload.body)} bytes"
        if pick.random() < 0.05:
            self._hang_up(upload)
            return
        with self._told(what):
            in_pieces = pick.random() < 0.2
            answer = self._session.request(
                upload.method,
                self._server.url + upload.path,
                params=upload.query,
                headers=_WRITER,
                data=_pieces(upload.body) if in_pieces and upload.body else upload.body,
                timeout=30.0,
            )
            self._note(answer.status_code, answer.content, what)
            if answer.status_code == httpx.codes.ACCEPTED:
                self.jobs[answer.json()["id"]] = upload.intact
                if len(self.jobs) % WAITING == 0:
                    self._server.wait_for_jobs()  # encoding takes longer than sending
            elif upload.intact:
                self._server.problems.append(f"HTTP status {answer.status_code} to {what}: {answer.content[:200]!r}")

    def _use(self) -> None:
        """Look at an upload, or change or delete it."""
        pick = self._random
        method = pick.choice(("GET", "GET", "GET", "GET", "PATCH", "DELETE"))
        path = f"/meshes/{pick.choice(IDS)}{pick.choice(_VIEWS) if method == 'GET' else ''}"
        if method == "GET" and self.jobs and pick.random() < 0.2:
            path = f"/jobs/{pick.choice(list(self.jobs))}"
        change = {name: pick.choice(values) for name, values in _CHANGES.items() if pick.random() < 0.5}
        body = json.dumps(change) if method == "PATCH" else None
        what = f"{method} {path} {body}"
        with self._told(what):
            answer = self._session.request(method, self._server.url + path, headers=_WRITER, data=body, timeout=30.0)
            self._note(answer.status_code, answer.content, what)

    def _hang_up(self, upload: Upload) -> None:
        """An upload whose client is gone before its end, or stands still until it is refused."""
        length = len(upload.body) + 10
        head = f"{upload.method} {upload.path}?filename=a.ply HTTP/1.1\r\nHost: h\r\nContent-Length: {length}\r\n"
        head += f"Authorization: Bearer {WRITE_TOKEN}\r\n\r\n"
        with suppress(OSError), self._connection() as connection:
            connection.sendall(head.encode() + upload.body)
            if self._random.random() < 0.2:
                line = connection.recv(4096).partition(b"\r\n")[0].split()
                self._note(int(line[1]) if len(line) > 1 else 0, b"", "an upload that stands still")
                return
        self._note(0, b"", "")

    def judge_jobs(self) -> Counter[str]:
        """Look at how the jobs have ended, once all have; returns how many did how."""
        self._server.wait_for_jobs()
        endings: Counter[str] = Counter()
        for job_id, intact in self.jobs.items():
            answer = self._session.get(f"{self._server.url}/jobs/{job_id}", timeout=30.0)
            if answer.status_code == httpx.codes.NOT_FOUND:  # it went with its mesh
                endings["gone"] += 1
                continue
            job = answer.json()
            error = str(job["error"] or "")
            endings[job["state"]] += 1
            replaced = "a later upload" in error
            wrong = job["state"] not in {"done", "failed"} or (intact and job["state"] == "failed" and not replaced)
            if wrong or any(fault in error for fault in _FAULTS):
                self._server.problems.append(f"job {job_id} is {job['state']}: {error[:300]}")
        return endings

    def _connection(self) -> socket.socket:
        parts = urlsplit(self._server.url)
        return socket.create_connection((parts.hostname or "", parts.port or 0), timeout=10.0)

    def _junk(self, path: str) -> None:
        """A request with damaged bytes, by a client that may hang up at once."""
        pick = self._random
        request = bytearray(f"GET {path} HTTP/1.1\r\nHost: h\r\nConnection: close\r\nRange: bytes=0-9\r\n\r\n".encode())
        for _ in range(pick.randrange(6)):
            request[pick.randrange(len(request))] = pick.randrange(256)
        if pick.random() < 0.3:
            del request[pick.randrange(len(request)) :]
        with suppress(OSError), self._connection() as connection:
            connection.sendall(request)
            if pick.random() < 0.5:
                connection.shutdown(socket.SHUT_WR)
                line = connection.recv(4096).partition(b"\r\n")[0].split()
                self._note(int(line[1]) if len(line) > 1 else 0, b"", f"junk {bytes(request)!r}")
                return
        self._note(0, b"", "")

    def _flood(self, path: str) -> None:
        """A request that does not end where it should, until the server has had enough of it."""
        pick = self._random
        start, block = pick.choice(_FLOODS)
        sent = 0
        with suppress(OSError), self._connection() as connection:
            connection.sendall(f"{pick.choice(('GET', 'PUT', 'HEAD', 'BREW'))} {path}".encode() + start)
            with suppress(OSError):
                while sent < MOST_FLOODED:
                    connection.sendall(block * 1000)
                    sent += 1000 * len(block)
            line = connection.recv(4096).partition(b"\r\n")[0].split()
            self._note(int(line[1]) if len(line) > 1 else 0, b"", f"a flood of {block!r} behind {start!r}")
            return
        self._note(0, b"", "")

    @contextmanager
    def _told(self, what: str) -> Iterator[None]:
        """An answer that does not come is a failure; what the client cannot write was not sent."""
        try:
            with suppress(UnicodeError, ValueError):
                yield
        except requests.Timeout:
            self._server.problems.append(f"no answer to {what[:300]}")
        except requests.RequestException as error:
            self.unsent[type(error).__name__] += 1

    def _note(self, status: int, body: bytes, what: str) -> None:
        self._budget.sent += 1
        self.statuses[status] += 1
        if status >= httpx.codes.INTERNAL_SERVER_ERROR and not _may_be(status, body):
            self._server.problems.append(f"HTTP status {status} to {what[:300]}: {body[:200]!r}")


def _may_be(status: int, body: bytes) -> bool:
    """Whether an answer of 500 and above is the documented one: something is not ready yet."""
    if status == httpx.codes.NOT_IMPLEMENTED:
        return False
    with suppress(ValueError, LookupError, TypeError):
        return status == httpx.codes.SERVICE_UNAVAILABLE and json.loads(body)["error"] == "not-ready"
    return False


def _pieces(body: bytes) -> Iterator[bytes]:
    """The body in several pieces, to be sent as chunks."""
    step = max(1, len(body) // 3)
    for start in range(0, len(body), step):
        yield body[start : start + step]


def fuzz(wanted: int, seconds: float, seed: int) -> dict[str, Any]:
    """Run, and return what was seen; `problems` is empty if nothing was wrong."""
    warnings.simplefilter("ignore")  # schemathesis's opinions of the document
    with watched_server(environment=_SETTINGS) as server:
        budget = Budget(server, wanted, seconds, seed)
        fuzzer = Fuzzer(budget)
        fuzzer.run()
        jobs = fuzzer.judge_jobs()
        return budget.report(
            "requests",
            statuses={str(status): count for status, count in sorted(fuzzer.statuses.items())},
            unsent=dict(fuzzer.unsent),
            jobs=dict(jobs),
        )


if __name__ == "__main__":
    sys.exit(run_command(__doc__, "requests", fuzz))
