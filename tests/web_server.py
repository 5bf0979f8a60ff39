"""A web server of one file, inside the test, which can be told to misbehave in every way that matters to a reader."""

from __future__ import annotations

import re
import threading
import zlib
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import ssl
    from collections.abc import Iterator


@dataclass
class WebServer:
    """What is served, and how.

    Args:
        content: the file, at every path.
        ranges: whether ranges are kept to.
        tag: its entity tag.
        status: answered instead of the file, if it is not 200.
        cuts: bytes after which the connection is cut, one entry a request; more requests are served to the end.
        headers: more headers of every answer.
        shift: how far ranges are wrong.
        heedless: whether If-Match is passed over.
        coding: what every answer is compressed with, whatever was accepted: "gzip" or "deflate"; a range of the
            content is taken first, as some proxies do.
        unframed: whether answers end with the connection, without saying how long they are.
        tokens: Authorization headers that are let pass; all, if there are none.
    """

    content: bytes
    ranges: bool = True
    tag: str = '"first"'
    status: int = 200
    cuts: list[int] = field(default_factory=list)
    headers: dict[str, str] = field(default_factory=dict)
    shift: int = 0
    heedless: bool = False
    coding: str = ""
    unframed: bool = False
    tokens: set[str] = field(default_factory=set)
    problem: bytes = b"nothing here"
    url: str = ""
    requests: list[tuple[str, str | None]] = field(default_factory=list)
    """Path and range of each one."""
    authorizations: list[str | None] = field(default_factory=list)
    accepted: list[str | None] = field(default_factory=list)
    """Accept-Encoding of each one."""
    sent: int = 0

    def answer(self, request: BaseHTTPRequestHandler) -> None:
        asked = request.headers.get("Range")
        self.requests.append((request.path, asked))
        self.authorizations.append(request.headers.get("Authorization"))
        if self.status != 200 or (self.tokens and request.headers.get("Authorization") not in self.tokens):
            self._send(request, self.status if self.status != 200 else 403, self.problem, {})
            return
        self.accepted.append(request.headers.get("Accept-Encoding"))
        if request.headers.get("If-Match", self.tag) != self.tag and not self.heedless:
            self._send(request, 412, b"", {})
            return
        found = re.fullmatch(r"bytes=(\d+)-(\d*)", asked or "")
        fixed = {"ETag": self.tag, "Last-Modified": "Wed, 21 Oct 2015 07:28:00 GMT", **self.headers}
        if not self.ranges or not found:
            self._send(request, 200, self.content, fixed)
            return
        start = int(found[1])
        end = min(int(found[2]) + 1 if found[2] else len(self.content), len(self.content))
        if start >= end:
            self._send(request, 416, b"", {"Content-Range": f"bytes */{len(self.content)}"})
            return
        place = f"bytes {start + self.shift}-{end - 1 + self.shift}/{len(self.content)}"
        self._send(request, 206, self.content[start:end], {"Content-Range": place, **fixed})

    def _send(self, request: BaseHTTPRequestHandler, status: int, body: bytes, headers: dict[str, str]) -> None:
        request.send_response(status)
        request.close_connection = True
        request.send_header("Connection", "close")
        if self.coding and body:
            compressor = zlib.compressobj(wbits=31 if self.coding == "gzip" else 15)
            body = compressor.compress(body) + compressor.flush()
            headers = {"Content-Encoding": self.coding, **headers}
        length = {} if self.unframed else {"Content-Length": str(len(body))}
        for name, value in {**length, **headers}.items():
            request.send_header(name, value)
        request.end_headers()
        cut = self.cuts.pop(0) if self.cuts else len(body)
        for start in range(0, min(cut, len(body)), 4096):
            request.wfile.write(body[start : min(start + 4096, cut)])
            self.sent += min(start + 4096, cut, len(body)) - start


@contextmanager
def web_server(server: WebServer, tls: ssl.SSLContext | None = None) -> Iterator[WebServer]:
    """Run `server` on a free port for as long as the block lasts, behind TLS if there is a certificate."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            try:
                server.answer(self)
            except (BrokenPipeError, ConnectionResetError):
                self.close_connection = True

        def log_message(self, *_: object) -> None:
            """Be silent."""

    listener = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    if tls is not None:
        listener.socket = tls.wrap_socket(listener.socket, server_side=True, do_handshake_on_connect=False)
        listener.handle_error = lambda *_: None  # type: ignore[method-assign]  # clients that trust nobody hang up
    thread = threading.Thread(target=listener.serve_forever, args=(0.02,))
    thread.start()
    server.url = f"http{'' if tls is None else 's'}://127.0.0.1:{listener.server_port}"
    try:
        yield server
    finally:
        listener.shutdown()
        thread.join()
        listener.server_close()
