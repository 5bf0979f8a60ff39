"""Websocket throughput beside a bare server: python tests/bench/load/websocket_throughput.py [--clients 50].

The bare server is one of the library `websockets` that greets, waits for one message, and sends the very frames that
meshtide sends, held in memory. Both are asked by the same clients, in turns, for the same time; each client opens a
connection, takes the whole stream, and opens the next one.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import pickle
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import uvloop
from hosting import MESH, Process, Row, allow_descriptors, fetch_exactly, folder_with_bunny, meshtide_server, process_of
from websocket_client import LightClient, hello
from websockets.asyncio.server import ServerConnection, serve

from meshtide_codec.stream.container import preamble
from meshtide_codec.stream.messages import Done, Hello, decode_message
from meshtide_codec.stream.session import PacketRange, ServerSession

if TYPE_CHECKING:
    from collections.abc import Iterator

    from meshtide_codec.encoder import EncodedMesh

PATH = f"/meshes/{MESH}/stream"


def frames_of(encoded: EncodedMesh) -> list[bytes]:
    """What meshtide's server sends to a client that wants everything."""
    header_bytes, data = encoded.header.to_bytes(), encoded.to_bytes()
    session = ServerSession(MESH, encoded.header, header_bytes)
    session.receive(hello(MESH))
    frames = []
    while (due := session.next()) is not None:
        if isinstance(due, PacketRange):
            offset = len(preamble(header_bytes)) + int(encoded.header.packet_offsets[due.index])
            due = due.frame(data[offset + due.start : offset + due.end])
        frames.append(due)
    assert isinstance(decode_message(hello(MESH)), Hello)
    assert isinstance(decode_message(frames[-1]), Done)
    return frames


async def serve_bare(frames: list[bytes]) -> None:
    """Serve until cancelled."""

    async def handler(connection: ServerConnection) -> None:
        await connection.recv()
        for frame in frames:
            await connection.send(frame)

    async with serve(handler, "127.0.0.1", 0, compression=None) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        print(json.dumps({"url": f"http://127.0.0.1:{port}"}), flush=True)
        await server.serve_forever()


@contextmanager
def bare_server(encoded: EncodedMesh, *, loop: str) -> Iterator[Process]:
    """The bare server in a process of its own."""
    with tempfile.NamedTemporaryFile(suffix=".frames") as file:
        pickle.dump(frames_of(encoded), file)
        file.flush()
        with process_of([sys.executable, __file__, "--bare", file.name, "--loop", loop]) as popen:
            assert popen.stdout is not None
            yield Process(json.loads(popen.stdout.readline())["url"], popen)


async def measure(server: Process, digest: bytes, clients: int, seconds: float) -> tuple[float, float]:
    """Bytes a second that clients are sent, and streams a second."""
    loop = asyncio.get_running_loop()
    until = time.perf_counter() + seconds
    total = streams = 0

    async def work() -> None:
        nonlocal total, streams
        while time.perf_counter() < until:
            client = LightClient(server.host, PATH, hello(MESH))
            transport, _ = await loop.create_connection(lambda: client, server.host, server.port)  # noqa: B023 - at once
            code = await client.ended
            transport.close()
            assert code == 1000, code
            assert client.digest == digest
            total += client.size
            streams += 1

    started = time.perf_counter()
    await asyncio.gather(*(work() for _ in range(clients)))
    elapsed = time.perf_counter() - started
    return total / elapsed, streams / elapsed


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each turn")
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--loop", choices=("asyncio", "uvloop"), default="uvloop", help="of the bare server")
    parser.add_argument("--bare", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.bare:
        run = uvloop.run if arguments.loop == "uvloop" else asyncio.run
        run(serve_bare(pickle.loads(arguments.bare.read_bytes())))  # noqa: S301 - written by the process that asks
        return 0
    allow_descriptors(4 * arguments.clients + 200)
    ours: list[tuple[float, float]] = []
    bares: list[tuple[float, float]] = []
    with (
        folder_with_bunny() as (folder, encoded),
        meshtide_server(folder, "--rescan-seconds", 0) as server,
        bare_server(encoded, loop=arguments.loop) as bare,
    ):
        digest = fetch_exactly(server.url, encoded)
        for _ in range(arguments.turns):
            ours.append(uvloop.run(measure(server, digest, arguments.clients, arguments.seconds)))
            bares.append(uvloop.run(measure(bare, digest, arguments.clients, arguments.seconds)))
    best, best_bare = max(ours), max(bares)
    ratio = best[0] / best_bare[0]
    return Row(
        what="websocket throughput beside a bare websockets server",
        value=100 * ratio,
        unit="%",
        must=">= 60 %",
        met=ratio >= 0.6,
        details={
            "meshtide MB/s": best[0] / 1e6,
            "bare MB/s": best_bare[0] / 1e6,
            "meshtide streams/s": best[1],
            "bare streams/s": best_bare[1],
            "bare server's loop": arguments.loop,
            "clients": arguments.clients,
        },
    ).show()


if __name__ == "__main__":
    sys.exit(main())
