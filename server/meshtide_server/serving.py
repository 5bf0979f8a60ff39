"""Running the application: the socket, the log, the announcement, and a shutdown that everybody hears of.

SIGTERM and Ctrl-C (SIGINT) end the server in order. It drains first: /readyz answers 503, new streams are asked to
connect elsewhere, what is running has a while to end. Then come an error frame and a close frame for each stream that
is left, and the end of the encoder's process. Both signals are the ordinary way to stop a server: the exit code is 0.
A second one cuts the waiting short.
"""

from __future__ import annotations

import json
import logging
import signal
import socket
import sys
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import uvicorn
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from meshtide_codec.errors import TransferError
from meshtide_codec.output_files import write_atomically
from meshtide_codec.output_policy import output_file
from meshtide_server.app import create_app
from meshtide_server.http.connection import STATE, Connecting, Connection
from meshtide_server.http.frame_gate import FrameGate
from meshtide_server.http.request_framing import HeadLimits
from meshtide_server.http.request_gate import RequestGate
from meshtide_server.operations import metrics

if TYPE_CHECKING:
    from pathlib import Path
    from types import FrameType

    from meshtide_server.http.application import Application
    from meshtide_server.settings import Settings

logger = logging.getLogger("meshtide.server")

BACKLOG = 512
PING_SECONDS = 20.0
_ANY_ADDRESS = {"0.0.0.0": "127.0.0.1", "::": "::1", "": "127.0.0.1"}  # noqa: S104 - compared with, not bound to


class AddressError(TransferError):
    """The server cannot listen where it should."""


class Server(uvicorn.Server):
    """uvicorn's server, with an announcement at its start and a farewell to its streams at its end."""

    def __init__(
        self, config: uvicorn.Config, app: Application, announcement: Announcement, drain_timeout: float = 0.0
    ) -> None:
        super().__init__(config)
        self._app = app
        self._drain_timeout = drain_timeout
        self._announcement = announcement
        self._drain_until: float | None = None

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start, then report to whoever waits for it."""
        await super().startup(sockets)
        if self.started:
            self._announcement.make()

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """A signal came; a second one means at once."""
        if self.should_exit:
            self.force_exit = True
        super().handle_exit(sig, frame)

    async def on_tick(self, counter: int) -> bool:
        """Called ten times a second; returns whether it is time to shut down."""
        return await super().on_tick(counter) and self._drained()

    def _drained(self) -> bool:
        """Whether all that was running when the server was to stop has ended, or had its time."""
        waiting = len(self.server_state.tasks)
        if self._drain_until is None:
            self._drain_until = time.monotonic() + self._drain_timeout
            self._app.parts.draining.set()
            metrics.draining(now=True)
            if waiting:
                logger.info("draining: %d streams and requests have %g s to end", waiting, self._drain_timeout)
        return not waiting or self.force_exit or time.monotonic() >= self._drain_until

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Part from the streams before uvicorn drops their connections."""
        for server in self.servers:
            server.close()
        logger.info("shutting down")
        self._app.parts.draining.set()
        await self._app.parts.streams.close(*([0.0] if self.force_exit else []))
        metrics.draining(now=False)
        # What uvicorn still has to say is that it drops connections that did not end in time.
        logging.getLogger("uvicorn.error").setLevel(logging.CRITICAL)
        await super().shutdown(sockets)


class Announcement:
    """Reports in the log, and to a parent process if asked to, where the server listens.

    Args:
        url: of the server.
        on_output: whether to print {"url": ...} as one line on standard output.
        ready_file: where to write the same, or None.
    """

    def __init__(self, url: str, *, on_output: bool = False, ready_file: Path | None = None) -> None:
        self._url = url
        self._on_output = on_output
        self._ready_file = ready_file

    def make(self) -> None:
        """Say it."""
        logger.info("listening on %s", self._url)
        line = json.dumps({"url": self._url}) + "\n"
        if self._ready_file is not None:
            try:
                write_atomically(self._ready_file, line.encode())
            except OSError as error:
                logger.error("cannot write %s: %s", self._ready_file, error.strerror or error)  # noqa: TRY400
        if self._on_output:
            with suppress(OSError, ValueError):  # nobody reads
                sys.stdout.write(line)
                sys.stdout.flush()


def is_announcement(path: Path) -> bool:
    """Whether a file holds what a server that was killed has left, or nothing: it may be written."""
    try:
        content = path.read_bytes()
        return not content or set(json.loads(content)) == {"url"}
    except (OSError, ValueError, TypeError):
        return False


def run(settings: Settings, *, announce: bool = False, ready_file: Path | None = None) -> None:
    """Serve until SIGTERM or SIGINT comes.

    Args:
        settings: what to host and where.
        announce: whether to print {"url": ...} on standard output once the server listens.
        ready_file: where to write the same, or None.

    Raises:
        OptionError: the ready file cannot be made, or is there and not what a server has left.
        AddressError: the address is taken, or not of this machine.
    """
    if ready_file is not None:
        output_file(ready_file, own=is_announcement)
    listener = bind(settings.host, settings.port)
    with listener:
        app = create_app(settings)
        announcement = Announcement(url_of(listener), on_output=announce, ready_file=ready_file)
        server = Server(configuration(app, settings), app, announcement, settings.drain_timeout)

        def stop(_: int, __: FrameType | None) -> None:
            server.should_exit = True

        # While it runs, uvicorn listens to signals itself. It raises them again when it is done, and this takes them;
        # it also serves in the moments before and after that.
        before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            server.run([listener])
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
            if ready_file is not None and ready_file.is_file():
                with suppress(OSError):
                    ready_file.unlink()


def configuration(app: Application, settings: Settings) -> uvicorn.Config:
    """How uvicorn runs `app`."""
    limits = HeadLimits(settings.max_request_line, settings.max_head, settings.max_headers)

    def http_protocol(*, app_state: dict[str, Any], **arguments: Any) -> RequestGate:  # noqa: ANN401 - uvicorn's
        connection = Connection()
        protocol = HttpToolsProtocol(app_state={**app_state, STATE: connection}, **arguments)
        return RequestGate(protocol, connection, limits, settings.hello_timeout)

    def websocket_protocol(*, app_state: dict[str, Any], **arguments: Any) -> FrameGate:  # noqa: ANN401 - uvicorn's
        return FrameGate(
            WebSocketsSansIOProtocol(app_state=app_state, **arguments),
            app_state[STATE],
            frames=settings.frames_per_second,
            control_frames=settings.control_frames_per_second,
        )

    return uvicorn.Config(
        Connecting(app),
        lifespan="on",
        http=http_protocol,  # type: ignore[arg-type] # called like a class
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=list(settings.trusted_proxies),
        ws=websocket_protocol,  # type: ignore[arg-type] # the same
        ws_max_size=settings.max_message,
        ws_per_message_deflate=False,  # packets are compressed already
        ws_ping_interval=PING_SECONDS,
        # On a slow link, a ping queues behind a whole window of data: patience as with a stream that stands still.
        ws_ping_timeout=settings.stall_timeout,
        timeout_graceful_shutdown=settings.shutdown_timeout,
        backlog=BACKLOG,
        log_config=None,
        access_log=False,  # its lines hold queries; see observation.py
        server_header=False,
    )


def bind(host: str, port: int) -> socket.socket:
    """A socket bound to that address.

    Raises:
        AddressError: the address is taken, or not of this machine.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, protocol)
        try:
            if sys.platform != "win32":  # there it would let two servers share a port
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(address)
        except OSError:
            listener.close()
            raise
    except (OSError, UnicodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        message = f"cannot listen on {host} port {port}: {reason}; choose others with --host and --port"
        raise AddressError(message) from error
    return listener


def url_of(listener: socket.socket) -> str:
    """The URL under which this machine reaches a listening socket."""
    host, port = listener.getsockname()[:2]
    host = _ANY_ADDRESS.get(host, host)
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
