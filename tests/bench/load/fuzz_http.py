"""Random and mutated HTTP requests against a real server: `python tests/bench/load/fuzz_http.py --requests 10000`.

Three kinds take turns: requests that fit the OpenAPI document and requests that break it (both made by schemathesis),
requests for addresses that exist with headers and methods that were made up, and bytes that are hardly HTTP, written
to the socket. Any answer of 500 and above (but 503 with the code `not-ready`), an end of the server, a line about a
fault in its log, or growing memory or descriptors is a failure: the exit code is 1 then.
"""

from __future__ import annotations

import argparse
import json
import random
import socket
import sys
import time
import warnings
from collections import Counter
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, urlsplit

import httpx
import requests
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import seed as hypothesis_seed
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from watched_server import MESH, WRITE_TOKEN, WatchedServer, watched_server

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

BATCH = 40
"""Requests to one operation before it is another one's turn."""
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
        server: the server.
        wanted: how many requests.
        seconds: how long at most.
        seed: of everything that is random.
    """

    def __init__(self, server: WatchedServer, wanted: int, seconds: float, seed: int) -> None:
        self._server = server
        self._wanted = wanted
        self._until = time.monotonic() + seconds
        self._random = random.Random(seed)
        self._session = requests.Session()
        self._session.trust_env = False
        self.sent = 0
        self.statuses: Counter[int] = Counter()
        self.unsent: Counter[str] = Counter()
        """Requests that got no answer, by the client's error: such as headers that it does not write."""

    @property
    def done(self) -> bool:
        """Whether there were enough requests, time, or failures."""
        return self.sent >= self._wanted or time.monotonic() > self._until or len(self._server.problems) > 20

    def run(self) -> None:
        """Send all requests."""
        schema = schemathesis.openapi.from_url(f"{self._server.url}/openapi.json")
        operations = [result.ok() for result in schema.get_all_operations()]
        digest = httpx.get(f"{self._server.url}/meshes/{MESH}").json()["packets"][0]["sha256"]
        paths = [path.replace("{mesh_id}", MESH).replace("{digest}", digest) for path in schema.raw_schema["paths"]]
        warm = False
        while not self.done:
            for operation in operations:
                for mode in (GenerationMode.POSITIVE, GenerationMode.NEGATIVE):
                    if not self.done:
                        self._from_schema(operation, mode)
            for _ in range(BATCH * len(operations)):
                if not self.done:
                    self._made_up(self._random.choice(paths))
            for _ in range(BATCH):
                if not self.done:
                    self._junk(self._random.choice(paths))
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
            headers = {"Authorization": f"Bearer {WRITE_TOKEN}"} if self._random.random() < 0.5 else {}
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

    def _junk(self, path: str) -> None:
        """A request with damaged bytes, by a client that may hang up at once."""
        pick = self._random
        request = bytearray(f"GET {path} HTTP/1.1\r\nHost: h\r\nConnection: close\r\nRange: bytes=0-9\r\n\r\n".encode())
        for _ in range(pick.randrange(6)):
            request[pick.randrange(len(request))] = pick.randrange(256)
        if pick.random() < 0.3:
            del request[pick.randrange(len(request)) :]
        parts = urlsplit(self._server.url)
        with suppress(OSError), socket.create_connection((parts.hostname, parts.port), timeout=5.0) as connection:
            connection.sendall(request)
            if pick.random() < 0.5:
                connection.shutdown(socket.SHUT_WR)
                line = connection.recv(4096).partition(b"\r\n")[0].split()
                self._note(int(line[1]) if len(line) > 1 else 0, b"", f"junk {bytes(request)!r}")
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
        self.sent += 1
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


def fuzz(wanted: int, seconds: float, seed: int) -> dict[str, Any]:
    """Run, and return what was seen; `problems` is empty if nothing was wrong."""
    warnings.simplefilter("ignore")  # schemathesis's opinions of the document
    with watched_server() as server:
        fuzzer = Fuzzer(server, wanted, seconds, seed)
        started = time.monotonic()
        fuzzer.run()
        growth = server.growth()
        if fuzzer.sent < wanted:
            server.problems.append(f"only {fuzzer.sent} of {wanted} requests were sent in {seconds:g} s")
        return {
            "requests": fuzzer.sent,
            "seconds": round(time.monotonic() - started, 1),
            "statuses": {str(status): count for status, count in sorted(fuzzer.statuses.items())},
            "unsent": dict(fuzzer.unsent),
            **growth,
            "problems": server.problems,
        }


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; see above."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--requests", type=int, default=10_000, help="how many requests (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=900.0, help="how long at most (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of everything that is random (default: %(default)s)")
    given_arguments = parser.parse_args(arguments)
    result = fuzz(given_arguments.requests, given_arguments.seconds, given_arguments.seed)
    print(json.dumps(result, indent=1))
    return 1 if result["problems"] else 0


if __name__ == "__main__":
    sys.exit(main())
