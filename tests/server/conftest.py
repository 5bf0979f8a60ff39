"""Folders, applications and servers that host them: what the tests of the server share."""

from __future__ import annotations

import asyncio
import threading
import time
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import pytest

from meshtide_server.app import create_app
from meshtide_server.serving import Announcement, Server, bind, configuration, url_of
from meshtide_server.settings import Settings

from .databases import catalogue, database_url, postgresql  # noqa: F401 - fixtures
from .libraries import encoders  # noqa: F401 - a fixture
from .made_streams import make_stream

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Iterator

    from fastapi import FastAPI

TETRAHEDRON = """\
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with one stream, small.tide."""
    path = tmp_path / "meshes"
    path.mkdir()
    (path / "small.tide").write_bytes(make_stream())
    return path


@pytest.fixture
async def app(folder: Path) -> AsyncIterator[FastAPI]:
    """An application that hosts the folder, its meshes settled; without a socket."""
    application = create_app(Settings(directory=folder, rescan_seconds=0))
    async with application.router.lifespan_context(application):
        await application.parts.library.folder.settled()
        yield application


@pytest.fixture
async def client(app: FastAPI) -> AsyncIterator[httpx.AsyncClient]:
    """A client of `app`, which asks for compressed answers as browsers do."""
    headers = {"Accept-Encoding": "gzip, deflate, br"}
    transport = httpx.ASGITransport(app)
    async with httpx.AsyncClient(transport=transport, base_url="http://test", headers=headers) as made:
        yield made


@pytest.fixture(autouse=True)
def private_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No test touches the cache of the person who runs it, nor minds their environment."""
    path = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("XDG_CACHE_HOME", str(path))
    for name in Settings.model_fields:
        monkeypatch.delenv(f"MESHTIDE_{name.upper()}", raising=False)
    return path


@dataclass(frozen=True)
class LiveServer:
    """A server that runs in a thread."""

    url: str
    app: Any
    loop: asyncio.AbstractEventLoop
    server: Server

    @property
    def socket_url(self) -> str:
        """Its URL for websockets."""
        return self.url.replace("http://", "ws://")

    def stop(self) -> None:
        """Begin to shut down, as a signal would have it."""
        self.server.should_exit = True

    def running_streams(self, expected: int, seconds: float = 5.0) -> int:
        """How many streams run, once they are `expected` or the time is over."""
        deadline = time.monotonic() + seconds
        while self.app.parts.streams.count != expected and time.monotonic() < deadline:
            time.sleep(0.01)
        return int(self.app.parts.streams.count)


@contextmanager
def running(settings: Settings) -> Iterator[LiveServer]:
    """A server in a thread, its meshes settled."""
    listener = bind("127.0.0.1", 0)
    app = create_app(settings)
    loops: list[asyncio.AbstractEventLoop] = []
    ready = threading.Event()

    class Ready(Announcement):
        def make(self) -> None:
            ready.set()

    server = Server(configuration(app, settings), app, Ready(""))

    async def serve() -> None:
        loops.append(asyncio.get_running_loop())
        await server.serve([listener])

    thread = threading.Thread(target=lambda: asyncio.run(serve()))
    thread.start()
    try:
        assert ready.wait(20)
        asyncio.run_coroutine_threadsafe(app.parts.library.folder.settled(), loops[0]).result(60)
        yield LiveServer(url_of(listener), app, loops[0], server)
    finally:
        server.should_exit = True
        thread.join(20)
        listener.close()
        assert not thread.is_alive()


@pytest.fixture
def serve() -> Iterator[Callable[[Settings], LiveServer]]:
    """Starts servers that end with the test."""
    with ExitStack() as stack:
        yield lambda settings: stack.enter_context(running(settings))


@pytest.fixture
def stream_bytes() -> Callable[..., bytes]:
    """Makes `.tide` files; see make_stream."""
    return make_stream


@pytest.fixture
def tetrahedron() -> str:
    """A mesh file, as OBJ."""
    return TETRAHEDRON
