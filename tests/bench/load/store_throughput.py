"""Streams from an S3 server beside a folder: python tests/bench/load/store_throughput.py [--clients 50].

A SeaweedFS server keeps the bunny's stream and a large one of random bytes. The bunny is streamed by many clients at
once, as it is from a folder, by the same clients in turns: it should cost the server no more, and the S3 server one
read. The large stream, several times what the server may keep in memory, is downloaded by several clients at once,
whose bytes are compared; the server's memory is read before and after.
"""

from __future__ import annotations

import argparse
import asyncio
import hashlib
import os
import re
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from random import Random

import httpx
import uvloop
from hosting import MESH, Process, Row, allow_descriptors, fetch_exactly, folder_with_bunny, meshtide_server
from websocket_throughput import measure

from meshtide_codec.compact.options import CompactHeader
from meshtide_codec.effort import Effort
from meshtide_codec.packets import Packet, PacketKind
from meshtide_codec.stream.container import write_container
from meshtide_codec.stream.header import LevelEntry, StreamHeader, packet_table
from meshtide_server.catalogue import Catalogue
from meshtide_server.hosting.publishing import Publication, publish
from meshtide_server.store.s3 import S3Store

sys.path.insert(0, str(Path(__file__).parents[2]))
from s3_server import BUCKET, running_s3_server

MUST_RATIO = 0.75
CACHE_MEBIBYTES = 16
LARGE_PACKETS = 96
"""Of a mebibyte each."""
MUST_GROWTH = 2.5 * CACHE_MEBIBYTES
"""What is kept, and what is on its way to the clients."""


def large_stream() -> bytes:
    """A stream with a few levels and many packets of random bytes."""
    random = Random(1)
    kinds = [(PacketKind.BASE, 1), (PacketKind.MAP_CONN, 0), *[(PacketKind.DIFF, 0)] * LARGE_PACKETS]
    slices = [0, 0, *range(LARGE_PACKETS)]
    packets = [
        Packet(kind, level, part, random.randbytes(1 << 20 if kind == PacketKind.DIFF else 1000))
        for (kind, level), part in zip(kinds, slices, strict=True)
    ]
    table, encoded = packet_table(packets)
    levels = (LevelEntry(1, 1, 100, 196, 0.02, 0.05), LevelEntry(0, len(packets), 400, 796, 0.0, 0.0))
    options = CompactHeader(
        base_depth=11,
        strengths=(0, 0),
        diff_depths=(12,),
        mirror=None,
        slices=tuple(range(LARGE_PACKETS)),
        previews=0,
        effort=Effort.DEFAULT,
    )
    header = StreamHeader(options, 12, (0.0, 0.0, 0.0), 1.0, levels, table)
    return write_container(header, encoded)


async def fill(url: str, streams: dict[str, bytes]) -> None:
    """Publish `streams`."""
    catalogue = await Catalogue.open(url)
    for name, data in streams.items():
        await publish(S3Store(BUCKET), catalogue, data, Publication(name, name))
    await catalogue.close()


def reads(server: Process) -> tuple[float, float]:
    """How often the server has asked its store, and how many bytes that brought."""
    text = httpx.get(f"{server.url}/metrics").text
    found = [
        re.search(rf"^{name} (\S+)$", text, re.MULTILINE)
        for name in (r"meshtide_store_reads_total\{outcome=\"done\"\}", "meshtide_store_read_bytes_total")
    ]
    return tuple(float(each[1]) if each else 0.0 for each in found)  # type: ignore[return-value]


def digest_of(url: str) -> tuple[str, int]:
    """SHA-256 and size of what a URL answers, of which a piece is held at a time."""
    digest, size = hashlib.sha256(), 0
    with httpx.stream("GET", url, timeout=120) as answer:
        for piece in answer.iter_bytes(1 << 16):
            digest.update(piece)
            size += len(piece)
    return digest.hexdigest(), size


def hot(server: Process, plain: Process, digest: bytes, arguments: argparse.Namespace) -> Row:
    """The bunny from S3 and from the folder, in turns."""
    ours, folders = [], []
    before = reads(server)[0]
    for _ in range(arguments.turns):
        ours.append(uvloop.run(measure(server, digest, arguments.clients, arguments.seconds)))
        folders.append(uvloop.run(measure(plain, digest, arguments.clients, arguments.seconds)))
    ratio = max(ours)[0] / max(folders)[0]
    asked = reads(server)[0] - before
    details = {
        "streams/s from S3": max(ours)[1],
        "streams/s from the folder": max(folders)[1],
        "reads of the store": asked,
        "clients": arguments.clients,
    }
    return Row(
        "websocket throughput of a stream in S3 beside one in a folder",
        100 * ratio,
        "%",
        f">= {100 * MUST_RATIO:g} %, 0 reads",
        ratio >= MUST_RATIO and asked == 0,
        details,
    )


def large(server: Process, data: bytes, clients: int) -> Row:
    """The large stream, by several at once."""
    expected = hashlib.sha256(data).hexdigest()
    before, count = server.resident_bytes, reads(server)[0]
    with ThreadPoolExecutor(clients) as pool:
        found = list(pool.map(digest_of, [f"{server.url}/meshes/large.tide"] * clients))
    growth = (server.resident_bytes - before) / 2**20
    exact = found == [(expected, len(data))] * clients
    details = {
        "exact": exact,
        "clients": clients,
        "MiB of the stream": len(data) / 2**20,
        "MiB of the cache": CACHE_MEBIBYTES,
        "reads of the store": reads(server)[0] - count,
    }
    return Row(
        "memory for a stream of six times the cache",
        growth,
        "MiB",
        f"<= {MUST_GROWTH:g} MiB, exact",
        exact and growth <= MUST_GROWTH,
        details,
    )


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each turn")
    parser.add_argument("--turns", type=int, default=3)
    arguments = parser.parse_args()
    allow_descriptors(4 * arguments.clients + 200)
    data = large_stream()
    with ExitStack() as stack:
        folder, encoded = stack.enter_context(folder_with_bunny())
        s3 = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="meshtide-load-")))
        environment = {
            "AWS_ENDPOINT_URL": stack.enter_context(running_s3_server(s3)),
            "AWS_REGION": "us-east-1",
            "AWS_ACCESS_KEY_ID": "any",
            "AWS_SECRET_ACCESS_KEY": "any",
        }
        os.environ.update(environment)
        database = f"sqlite:///{s3}/catalogue.db"
        asyncio.run(fill(database, {MESH: encoded.to_bytes(), "large": data}))
        told = {
            "MESHTIDE_DATABASE": database,
            "MESHTIDE_STORE": f"s3://{BUCKET}",
            "MESHTIDE_STORE_CACHE_MIB": str(CACHE_MEBIBYTES),
            "MESHTIDE_METRICS": "open",
            **environment,
        }
        server = stack.enter_context(meshtide_server(environment=told))
        plain = stack.enter_context(meshtide_server(folder, "--rescan-seconds", 0))
        digest = fetch_exactly(server.url, encoded)
        fetch_exactly(plain.url, encoded)
        return max([row.show() for row in (hot(server, plain, digest, arguments), large(server, data, 8))])


if __name__ == "__main__":
    sys.exit(main())
