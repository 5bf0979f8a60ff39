"""Memory for each idle websocket client: python tests/bench/load/idle_memory.py [--clients 1000].

Idle is a client that has asked for a mesh and been sent its header, and then grants nothing. Resident memory of the
server's process is read before and after, once a first batch of clients has made it grow to its working size.
"""

from __future__ import annotations

import argparse
import asyncio
import sys

import uvloop
from hosting import MESH, Process, Row, allow_descriptors, fetch_exactly, folder_with_bunny, meshtide_server
from websocket_client import hello, open_clients

MUST = 150.0
WARMING = 100
SETTLING_SECONDS = 1.0


async def measure(server: Process, clients: int) -> Row:
    """Connect and count."""
    path = f"/meshes/{MESH}/stream"
    first = await open_clients(server.host, server.port, path, WARMING, hello(MESH, credit=1000))
    await asyncio.sleep(SETTLING_SECONDS)
    before = server.resident_bytes
    more = await open_clients(server.host, server.port, path, clients, hello(MESH, credit=1000))
    await asyncio.sleep(SETTLING_SECONDS)
    after = server.resident_bytes
    dropped = sum(client.ended.done() for client in (*first, *more))
    greeted = sum(client.size > 0 for client in more)
    for client in (*first, *more):
        client.abort()
    kibibytes = (after - before) / clients / 1024
    return Row(
        what="memory of the server for each idle websocket client",
        value=kibibytes,
        unit="KiB",
        must=f"<= {MUST:g} KiB",
        met=kibibytes <= MUST and not dropped and greeted == clients,
        details={"clients": clients, "dropped": dropped, "MiB of the server": after / 2**20},
    )


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clients", type=int, default=1000)
    arguments = parser.parse_args()
    allow_descriptors(2 * arguments.clients + 1000)
    with folder_with_bunny() as (folder, encoded), meshtide_server(folder, "--rescan-seconds", 0) as server:
        fetch_exactly(server.url, encoded)
        return uvloop.run(measure(server, arguments.clients)).show()


if __name__ == "__main__":
    sys.exit(main())
