"""Seconds and memory that streams take which were made to take a decoder's: python tests/bench/decompression_bombs.py.

Thousands of empty slices, with and without Diff packets, and a file that claims millions of vertices.
"""

from __future__ import annotations

import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np

from meshtide_codec.compact import encoder
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.errors import LimitError
from meshtide_codec.mesh import Mesh
from meshtide_codec.packets import PacketKind
from meshtide_codec.stream.container import read_container, write_container

SIDE = 68
KIBIBYTE = 1024  # what the operating system counts in


def sliced() -> EncodedMesh:
    """A flat square of more vertices than slices, nearly all of which are empty."""
    u, v = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    corner = (u * SIDE + v)[:-1, :-1].reshape(-1)
    faces = np.concatenate([np.stack([corner, corner + SIDE, corner + 1], axis=1)])
    mesh = Mesh.checked(np.stack([u, v, 0 * u], axis=-1).reshape(-1, 3), faces)
    with mock.patch.object(encoder, "even_slices", return_value=tuple(range(4096))):
        return encode(mesh, CompactOptions(bits=12, previews=()))


def read(data: bytes) -> None:
    """Read and decode a file as far as the limits allow."""
    with suppress(LimitError):
        header, packets = read_container(data)
        decoder = Decoder(header)
        for packet in packets:
            decoder.push(packet)


def peak() -> int:
    """The most bytes that this process has held so far (Linux)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * KIBIBYTE for line in lines if line.startswith("VmHWM"))


def measured(data: bytes, small: bytes) -> tuple[float, int]:
    """Processor time, and the bytes by which the process has grown; behind a small file, for which all is loaded."""
    read(small)
    before, start = peak(), time.process_time()
    read(data)
    return time.process_time() - start, peak() - before


def report(name: str, data: bytes) -> None:
    """Print what reading and decoding a file takes, in a process of its own."""
    small = encode(Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])).to_bytes()
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        seconds, grown = process.submit(measured, data, small).result()
    print(f"{name:30} {len(data):8} bytes {seconds:6.3f} s {grown / 1e6:6.1f} MB")


def main() -> None:
    """Measure each of them."""
    encoded = sliced()
    report("4096 slices with their Diffs", encoded.to_bytes())
    kept = [place for place, packet in enumerate(encoded.packets) if packet.kind is not PacketKind.DIFF]
    rows = tuple(encoded.header.packets[place] for place in kept)
    states = tuple(replace(row, packet_count=min(row.packet_count, len(rows))) for row in encoded.header.levels)
    bare = replace(encoded.header, packets=rows, levels=states)
    payloads = [encoded.packet_bytes[place] for place in kept]
    report("4096 slices without Diffs", write_container(bare, payloads))
    claim = replace(states[-1], vertices=1 << 26)
    report(
        "67 million vertices claimed",
        write_container(replace(bare, levels=(*states[:-1], claim)), payloads),
    )


if __name__ == "__main__":
    main()
