"""What a flood of tiny websocket frames does to others: python tests/bench/load/tiny_frames.py [--seconds 8].

For each kind of frame, one socket writes as many as a new server takes for so many seconds, and connects again when it
is closed. Meanwhile others ask for a packet's worth of bytes at fixed times; the figure is the median of how long they
wait, of the worst kind. A request that was begun within those seconds is waited for, a minute at most, which is then
what it counts as.
"""

from __future__ import annotations

import argparse
import asyncio
import socket
import sys
import time
from contextlib import suppress
from multiprocessing import get_context
from typing import TYPE_CHECKING

import numpy as np
from hosting import MESH, Process, Row, fetch_exactly, folder_with_bunny, meshtide_server
from websocket_client import hello

from meshtide_codec.stream.messages import Credit, encode_message

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

MUST = 50.0
PAUSE_SECONDS = 0.05
LONGEST_WAIT = 60.0
_FIN, _CONTINUATION, _BINARY, _PING, _PONG = 0x80, 0x0, 0x2, 0x9, 0xA
_REQUEST = f"GET /meshes/{MESH}/header HTTP/1.1\r\nHost: h\r\nIf-Match: *\r\n\r\n".encode()


def frame(opcode: int, payload: bytes = b"") -> bytes:
    """One frame of a client, masked with zeros; `opcode` with the bit that ends a message, if it is the last."""
    return bytes((opcode, 0x80 | len(payload))) + bytes(4) + payload


FLOODS = {
    "pings": frame(_FIN | _PING),
    "pongs": frame(_FIN | _PONG),
    "credits of 1": frame(_FIN | _BINARY, encode_message(Credit(1))),
    "empty fragments": frame(_CONTINUATION),
}


def flood(host: str, port: int, kind: str, stop: Event) -> None:
    """Write frames of one kind until it is time to stop."""
    block = FLOODS[kind] * 20_000
    while not stop.is_set():
        with suppress(OSError), socket.create_connection((host, port), timeout=1.0) as connection:
            connection.sendall(
                f"GET /meshes/{MESH}/stream HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
            )
            connection.recv(4096)
            message = hello(MESH, 1)
            start = frame(_BINARY, message) if kind == "empty fragments" else frame(_FIN | _BINARY, message)
            connection.sendall(start)
            while not stop.is_set():
                with suppress(TimeoutError):
                    connection.sendall(block)


async def ask(host: str, port: int) -> float:
    """Ask once; returns how long the answer took to come."""
    begun = time.perf_counter()
    with suppress(TimeoutError):
        async with asyncio.timeout(LONGEST_WAIT):
            reader, writer = await asyncio.open_connection(host, port)
            writer.write(_REQUEST)
            head = await reader.readuntil(b"\r\n\r\n")
            await reader.readexactly(int(head.lower().partition(b"content-length: ")[2].split(b"\r\n")[0]))
            writer.close()
    return time.perf_counter() - begun


async def others(server: Process, seconds: float) -> list[float]:
    """How long all requests waited, in seconds; they begin at their times, whether earlier ones are answered or not."""
    tasks = []
    for _ in range(int(seconds / PAUSE_SECONDS)):
        tasks.append(asyncio.create_task(ask(server.host, server.port)))
        await asyncio.sleep(PAUSE_SECONDS)
    return await asyncio.gather(*tasks)


def measure(server: Process, kind: str, seconds: float) -> dict[str, float]:
    """How long others wait, in milliseconds, while one socket sends frames of one kind."""
    calm = asyncio.run(others(server, 1.0))
    context = get_context("spawn")
    stop = context.Event()
    attacker = context.Process(target=flood, args=(server.host, server.port, kind, stop))
    attacker.start()
    try:
        time.sleep(1.0)  # it imports, and begins
        before = server.processor_seconds
        waits = asyncio.run(others(server, seconds))
        used = server.processor_seconds - before
    finally:
        stop.set()
        attacker.join(5.0)
        attacker.kill()
    return {
        "calm": 1e3 * float(np.median(calm)),
        "median": 1e3 * float(np.median(waits)),
        "largest": 1e3 * max(waits),
        "server processor s": used,
    }


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=8.0)
    arguments = parser.parse_args()
    details: dict[str, float] = {}
    with folder_with_bunny() as (folder, encoded):
        for kind in FLOODS:
            with meshtide_server(folder, "--rescan-seconds", 0) as server:
                fetch_exactly(server.url, encoded)
                figures = measure(server, kind, arguments.seconds)
            details |= {f"{kind}, {name}": value for name, value in figures.items()}
    worst = max(value for name, value in details.items() if name.endswith("median"))
    return Row(
        what="median wait of others while one socket sends tiny frames",
        value=worst,
        unit="ms",
        must=f"<= {MUST:g} ms",
        met=worst <= MUST,
        details=details,
    ).show()


if __name__ == "__main__":
    sys.exit(main())
