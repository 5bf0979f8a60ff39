"""Packets and files over HTTP beside nginx: python tests/bench/load/http_throughput.py [--what packets|file].

nginx, one worker, serves the same bytes from files of the same names. Both are asked by the same client, in turns,
over connections that stay open, one request under way on each.
"""

from __future__ import annotations

import argparse
import shutil
import socket
import sys
from hashlib import sha256
from itertools import pairwise
from pathlib import Path

import uvloop
from hosting import MESH, Row, UnavailableError, folder_with_bunny, meshtide_server, nginx
from http_client import Throughput, load

from meshtide_codec.encoder import EncodedMesh
from meshtide_codec.stream.container import preamble

_SITE = """
    server {{
        listen 127.0.0.1:{port} backlog=1024;
        root {root};
    }}
"""


def packets_of(encoded: EncodedMesh) -> dict[str, bytes]:
    """The packets of a stream under their paths."""
    data = encoded.to_bytes()
    start = len(preamble(encoded.header.to_bytes()))
    offsets = [start + int(offset) for offset in encoded.header.packet_offsets]
    packets = [data[first:end] for first, end in pairwise(offsets)]
    return {f"/packets/{sha256(packet).hexdigest()}": packet for packet in packets}


def lay_out(encoded: EncodedMesh, root: Path, what: str) -> dict[str, int]:
    """Write what nginx serves; returns the paths and their lengths."""
    contents = packets_of(encoded) if what == "packets" else {f"/meshes/{MESH}.tide": encoded.to_bytes()}
    for path, data in contents.items():
        place = root / path.lstrip("/")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(data)
    return {path: len(data) for path, data in contents.items()}


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--what", choices=("packets", "file"), default="packets")
    parser.add_argument("--connections", type=int, default=32)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each turn")
    parser.add_argument("--turns", type=int, default=3)
    arguments = parser.parse_args()
    port = free_port()
    ours: list[Throughput] = []
    others: list[Throughput] = []
    with folder_with_bunny() as (folder, encoded):
        root = folder / "site"
        paths = lay_out(encoded, root, arguments.what)
        folder.chmod(0o755)
        with (
            meshtide_server(folder, "--rescan-seconds", 0) as server,
            nginx(_SITE.format(port=port, root=root), port, next(iter(paths))) as other,
        ):
            for _ in range(arguments.turns):
                for process, results in ((server, ours), (other, others)):
                    work = load(process.host, process.port, paths, arguments.connections, arguments.seconds)
                    results.append(uvloop.run(work))
        shutil.rmtree(root)
    best = max(ours, key=lambda result: result.rate)
    best_other = max(others, key=lambda result: result.rate)
    ratio = best.rate / best_other.rate
    return Row(
        what=f"throughput of {'packets' if arguments.what == 'packets' else 'the .tide file'} over HTTP beside nginx",
        value=100 * ratio,
        unit="%",
        must=">= 25 %",
        met=ratio >= 0.25,
        details={
            "meshtide MB/s": best.rate / 1e6,
            "nginx MB/s": best_other.rate / 1e6,
            "meshtide requests/s": best.requests / best.seconds,
            "nginx requests/s": best_other.requests / best_other.seconds,
            "bytes a request": sum(paths.values()) // len(paths),
            "connections": arguments.connections,
        },
    ).show()


if __name__ == "__main__":
    try:
        sys.exit(main())
    except UnavailableError as error:
        sys.exit(f"not measured: {error}")
