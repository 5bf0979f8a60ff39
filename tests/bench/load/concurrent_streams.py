"""Many clients at once: python tests/bench/load/concurrent_streams.py [--clients 500] [--idle 0] [--rounds 1].

Each client opens a websocket; once all are open, all ask for the bunny at the same moment. One client decodes what it
gets and holds it against the quantized input; the others compare the digest of all their frames with that one's.
With --idle, so many more clients stay connected all the while, greeted but without credit.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
import time
from collections import Counter

import uvloop
from hosting import MESH, Process, Row, allow_descriptors, fetch_exactly, folder_with_bunny, meshtide_server
from websocket_client import hello, open_clients

BOUND_SECONDS = 120.0


async def measure(server: Process, digest: bytes, clients: int, idle: int) -> Row:
    """Stream to all clients at once."""
    path = f"/meshes/{MESH}/stream"
    waiting = await open_clients(server.host, server.port, path, idle, hello(MESH, credit=0))
    busy_before = server.processor_seconds
    streaming = await open_clients(server.host, server.port, path, clients, None)
    started = time.perf_counter()
    for client in streaming:
        client.send(hello(MESH))
    async with asyncio.timeout(BOUND_SECONDS):
        codes = await asyncio.gather(*(client.ended for client in streaming))
    seconds = time.perf_counter() - started
    whole = sum(code == 1000 and client.digest == digest for code, client in zip(codes, streaming, strict=True))
    dropped = sum(client.ended.done() for client in waiting)
    for client in waiting:
        client.abort()
    total = sum(client.size for client in streaming)
    return Row(
        what=f"{clients} clients stream the bunny at once, {idle} more idle: complete and exact",
        value=float(whole),
        unit="clients",
        must=f"{clients}",
        met=whole == clients and not dropped,
        details={
            "close codes": dict(Counter(codes)),
            "idle clients dropped": dropped,
            "seconds": seconds,
            "streams/s": clients / seconds,
            "MB/s": total / seconds / 1e6,
            "server processor ms/stream": 1e3 * (server.processor_seconds - busy_before) / clients,
            "MiB of the server": server.resident_bytes / 2**20,
        },
    )


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clients", type=int, default=500)
    parser.add_argument("--idle", type=int, default=0)
    arguments = parser.parse_args()
    allow_descriptors(2 * (arguments.clients + arguments.idle) + 500)
    with folder_with_bunny() as (folder, encoded), meshtide_server(folder, "--rescan-seconds", 0) as server:
        digest = fetch_exactly(server.url, encoded)
        return uvloop.run(measure(server, digest, arguments.clients, arguments.idle)).show()


if __name__ == "__main__":
    sys.exit(main())
