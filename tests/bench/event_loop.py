"""How long the server's event loop is ever kept from its work: while meshes are encoded, streamed and downloaded.

    python tests/bench/event_loop.py                     the samples
    python tests/bench/event_loop.py --meshes DIRECTORY  a folder of meshes
    python tests/bench/event_loop.py --clients 100       more clients at once

A task asks to be woken every few milliseconds and notes how late that happens. Meshes are always encoded anew, in a
temporary cache. Clients run in a process of their own. Where processors are scarce, delays also count the time in
which the system gave the processor to others.
"""

from __future__ import annotations

import argparse
import asyncio
import statistics
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import httpx
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from meshtide_codec.stream.messages import LARGEST_MESSAGE
from meshtide_codec.stream.session import ClientSession
from meshtide_server.app import create_app
from meshtide_server.operations.logs import set_up_log
from meshtide_server.serving import Announcement, Server, bind, configuration, url_of
from meshtide_server.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Awaitable

PERIOD = 0.005
TARGET = 0.050


class Monitor:
    """Measures delays of the event loop that it runs in."""

    def __init__(self) -> None:
        self._delays: list[float] = []

    async def run(self) -> None:
        """Measure until cancelled."""
        while True:
            due = time.perf_counter() + PERIOD
            await asyncio.sleep(PERIOD)
            self._delays.append(time.perf_counter() - due)

    async def during(self, title: str, work: Awaitable[object]) -> bool:
        """Print the delays while `work` is done; returns whether the target was met."""
        self._delays.clear()
        started = time.perf_counter()
        await work
        seconds = time.perf_counter() - started
        await asyncio.sleep(2 * PERIOD)
        largest = max(self._delays)
        median = statistics.median(self._delays)
        print(f"{title:28} {seconds:7.2f} s   median {1e3 * median:6.2f} ms   largest {1e3 * largest:6.2f} ms")
        return largest <= TARGET


async def stream_all(url: str, meshes: list[str], clients: int) -> None:
    """Stream meshes to many clients at once."""

    async def stream(mesh: str) -> None:
        session = ClientSession(mesh)
        address = f"{url.replace('http', 'ws', 1)}/meshes/{mesh}/stream"
        async with connect(address, compression=None, max_size=LARGEST_MESSAGE, open_timeout=60) as connection:
            await connection.send(session.hello())
            async for frame in connection:
                session.receive(frame)
                grant = session.credit_frame()
                if grant is not None:
                    with suppress(ConnectionClosed):
                        await connection.send(grant)
        assert session.finished

    await asyncio.gather(*(stream(meshes[i % len(meshes)]) for i in range(clients)))


async def download_all(url: str, meshes: list[str], clients: int) -> None:
    """Download meshes with many clients at once."""
    limits = httpx.Limits(max_connections=clients)
    async with httpx.AsyncClient(timeout=60, limits=limits) as client:
        paths = [f"{url}/meshes/{meshes[i % len(meshes)]}.tide" for i in range(clients)]
        for answer in await asyncio.gather(*(client.get(path) for path in paths)):
            answer.raise_for_status()


async def describe_all(url: str, meshes: list[str], clients: int) -> None:
    """Ask for all descriptions, again and again."""
    async with httpx.AsyncClient(timeout=60) as client:
        for _ in range(clients):
            for path in ("/meshes", "/healthz", *(f"/meshes/{mesh}" for mesh in meshes)):
                (await client.get(url + path)).raise_for_status()


WORKS = {"stream": stream_all, "download": download_all, "describe": describe_all}


async def in_another_process(work: str, url: str, meshes: list[str], clients: int) -> None:
    """Do one of the works above in another process."""
    arguments = [__file__, "--work", work, "--url", url, "--clients", str(clients), *meshes]
    process = await asyncio.create_subprocess_exec(sys.executable, *arguments)
    if await process.wait():
        raise RuntimeError(f"the clients failed: {work}")


async def measure(settings: Settings, clients: int) -> bool:
    """Run a server and measure its event loop; returns whether the target was always met."""
    app = create_app(settings)
    listener = bind("127.0.0.1", 0)
    server = Server(configuration(app, settings), app, Announcement(url_of(listener)))
    serving = asyncio.create_task(server.serve([listener]))
    monitor = Monitor()
    measuring = asyncio.create_task(monitor.run())
    while not server.started:  # noqa: ASYNC110 - there is no event for it
        await asyncio.sleep(PERIOD)
    url = url_of(listener)
    met = [await monitor.during("encoding", app.parts.library.folder.settled())]
    met.append(await monitor.during("idle", asyncio.sleep(1.0)))
    meshes = [mesh.id for mesh in app.parts.library.folder.meshes if mesh.stream is not None]
    size = sum(mesh.stream.size for mesh in app.parts.library.folder.meshes if mesh.stream is not None)
    print(f"{len(meshes)} meshes, {size} bytes")
    for work in WORKS:
        count = max(1, clients // 10) if work == "describe" else clients
        met.append(await monitor.during(f"{work}, {count} clients", in_another_process(work, url, meshes, count)))
    measuring.cancel()
    server.should_exit = True
    await serving
    return all(met)


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", type=Path, help="folder of meshes; the samples if it is left out")
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--work", choices=WORKS, help=argparse.SUPPRESS)
    parser.add_argument("--url", help=argparse.SUPPRESS)
    parser.add_argument("ids", nargs="*", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.work:
        asyncio.run(WORKS[arguments.work](arguments.url, arguments.ids, arguments.clients))
        return 0
    set_up_log("warning")
    with tempfile.TemporaryDirectory() as cache:
        settings = Settings(directory=arguments.meshes, samples=arguments.meshes is None, cache=Path(cache))
        met = asyncio.run(measure(settings, arguments.clients))
    print(f"target of {1e3 * TARGET:.0f} ms {'met' if met else 'missed'}")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
