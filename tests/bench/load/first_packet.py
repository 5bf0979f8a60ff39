"""Time from hello to the first packet: python tests/bench/load/first_packet.py [--clients 100] [--rounds 5].

In each round so many clients are connected; their hellos are spread evenly over a second, and each one then streams
the whole bunny while the others do. The clock runs in the client, from when the hello is given to its socket until
the first packet part is taken out of it. `at once` is the same with all hellos in one moment, the worst that can be.
"""

from __future__ import annotations

import argparse
import asyncio
import sys

import numpy as np
import uvloop
from hosting import MESH, Process, Row, allow_descriptors, fetch_exactly, folder_with_bunny, meshtide_server
from websocket_client import hello, open_clients

MUST = 100.0


async def one_round(server: Process, digest: bytes, clients: int, spread: float) -> list[float]:
    """Seconds to the first packet, of each client."""
    connected = await open_clients(server.host, server.port, f"/meshes/{MESH}/stream", clients, None)
    loop = asyncio.get_running_loop()
    started = loop.time()
    for turn, client in enumerate(connected):
        loop.call_at(started + spread * turn / clients, client.send, hello(MESH))
    async with asyncio.timeout(60):
        codes = await asyncio.gather(*(client.ended for client in connected))
    assert set(codes) == {1000}, codes
    assert all(client.digest == digest for client in connected)
    return [client.first_packet - client.asked for client in connected]


async def measure(server: Process, digest: bytes, clients: int, rounds: int) -> Row:
    """All rounds."""
    spread = [seconds for _ in range(rounds) for seconds in await one_round(server, digest, clients, 1.0)]
    at_once = [seconds for _ in range(rounds) for seconds in await one_round(server, digest, clients, 0.0)]
    milliseconds = 1e3 * np.percentile(spread, [50, 99, 100])
    return Row(
        what=f"time from hello to the first packet at {clients} clients, 99th percentile",
        value=float(milliseconds[1]),
        unit="ms",
        must=f"<= {MUST:g} ms",
        met=bool(milliseconds[1] <= MUST),
        details={
            "median ms": float(milliseconds[0]),
            "largest ms": float(milliseconds[2]),
            "99th percentile at once ms": float(1e3 * np.percentile(at_once, 99)),
            "hellos": len(spread),
        },
    )


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clients", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    allow_descriptors(2 * arguments.clients + 500)
    with folder_with_bunny() as (folder, encoded), meshtide_server(folder, "--rescan-seconds", 0) as server:
        digest = fetch_exactly(server.url, encoded)
        return uvloop.run(measure(server, digest, arguments.clients, arguments.rounds)).show()


if __name__ == "__main__":
    sys.exit(main())
