"""Seconds and memory that streams take which were made to take a decoder's: python tests/bench/decompression_bombs.py.

Thousands of empty slices, with and without Diff packets, and a file that claims millions of vertices.
"""

from __future__ import annotations

import time
import tracemalloc
from contextlib import suppress
from dataclasses import replace
from unittest import mock

import numpy as np

from meshtide_codec.compact.encoder import CompactEncoding
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.compact.slices import Slices
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.errors import LimitError
from meshtide_codec.mesh import Mesh
from meshtide_codec.stream.container import read_container, write_container
from meshtide_codec.stream.packets import PacketKind

SIDE = 68


def sliced() -> EncodedMesh:
    """A flat square of more vertices than slices, nearly all of which are empty."""
    u, v = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    corner = (u * SIDE + v)[:-1, :-1].reshape(-1)
    faces = np.concatenate([np.stack([corner, corner + SIDE, corner + 1], axis=1)])
    mesh = Mesh.checked(np.stack([u, v, 0 * u], axis=-1).reshape(-1, 3), faces)
    with mock.patch.object(CompactEncoding, "_slices", lambda self, _: Slices(self._bits, tuple(range(4096)))):
        return encode(mesh, CompactOptions(bits=12, previews=()))


def report(name: str, data: bytes) -> None:
    """Print what reading and decoding a file takes, the second time."""

    def read() -> None:
        with suppress(LimitError):
            header, packets = read_container(data)
            decoder = Decoder(header)
            for packet in packets:
                decoder.push(packet)

    read()
    start = time.thread_time()
    read()
    seconds = time.thread_time() - start
    tracemalloc.start()
    read()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    print(f"{name:30} {len(data):8} bytes {seconds:6.3f} s {peak / 1e6:6.1f} MB")


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
        write_container(replace(bare, options={}, levels=(*states[:-1], claim)), payloads),
    )


if __name__ == "__main__":
    main()
