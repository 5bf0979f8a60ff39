"""Streams that tests share: real ones of small meshes, and made-up ones whose payloads mean nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from hypothesis import strategies as st

from meshtide_codec.classic.options import ClassicHeader, ClassicOptions
from meshtide_codec.compact.options import CompactHeader
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.errors import LimitError, MeshtideError, PacketError
from meshtide_codec.filters import FilterSpec
from meshtide_codec.packets import Packet, PacketKind
from meshtide_codec.quantize import morton_codes
from meshtide_codec.stream.header import LevelEntry, StreamHeader, packet_table
from meshtide_codec.testing import grid

if TYPE_CHECKING:
    from numpy.typing import NDArray


@cache
def encoded_grid(side: int = 16, degree: int = 2) -> EncodedMesh:
    """A small mesh with several levels."""
    spec = FilterSpec("polynomial", degree=degree)
    return encode(grid(side), ClassicOptions(bits=8, coarsest_vertices=12, filter=spec))


class Served:
    """A real stream as a server has it."""

    def __init__(self, side: int = 16) -> None:
        self.encoded = encoded_grid(side)
        self.header = self.encoded.header
        self.header_bytes = self.header.to_bytes()
        self.whole = self.encoded.to_bytes()

    def packet_part(self, index: int, start: int, end: int) -> bytes:
        """Bytes of a packet."""
        return bytes(self.encoded.packet_bytes[index][start:end])


def check_with_one_damaged_packet(encoded: EncodedMesh, data: st.DataObject) -> None:
    """Push a stream into a decoder, one payload damaged behind a right checksum, as a stranger could send it.

    Whatever comes out is a mesh, or an error of the tree that a decoder's caller expects.
    """
    victim = data.draw(st.integers(0, len(encoded.packets) - 1))
    payload = bytearray(encoded.packets[victim].payload)
    kind = data.draw(st.sampled_from(["flip", "cut", "junk"]))
    if kind == "junk":
        payload = bytearray(data.draw(st.binary(max_size=60)))
    elif payload and kind == "flip":
        payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    elif payload:
        del payload[data.draw(st.integers(0, len(payload) - 1)) :]
    decoder = Decoder(encoded.header)
    for index, packet in enumerate(encoded.packets):
        try:
            decoder.push(replace(packet, payload=bytes(payload)) if index == victim else packet)
            mesh = None if decoder.finest is None else decoder.mesh(decoder.finest)
        except MeshtideError as error:
            assert isinstance(error, PacketError | LimitError)
            return
        if mesh is not None:
            assert np.isfinite(mesh.vertices).all()
            assert mesh.faces.size == 0 or mesh.faces.max() < len(mesh.vertices)


def leaf_depths(encoded: EncodedMesh) -> NDArray[np.int64]:
    """(n,) the least depth at which each vertex of the finest mesh is alone in its cell."""
    bits, codes = encoded.header.bits, morton_codes(encoded.quantized.positions)
    depths = np.full(len(codes), bits)
    for depth in range(bits, -1, -1):
        _, cells, counts = np.unique(codes >> np.uint64(3 * (bits - depth)), return_inverse=True, return_counts=True)
        depths[counts[cells] == 1] = depth
    return depths


def slice_of(encoded: EncodedMesh, index: int) -> NDArray[np.bool_]:
    """(n,) which vertices belong to a slice: by the Morton code of their leaf cells' lowest corners."""
    bits = encoded.header.bits
    shifts = (3 * (bits - leaf_depths(encoded))).astype(np.uint64)
    corners = morton_codes(encoded.quantized.positions) >> shifts << shifts
    options = encoded.header.options
    assert isinstance(options, CompactHeader)
    starts = [*options.slices, 1 << 3 * bits]
    return (corners >= starts[index]) & (corners < starts[index + 1])


class MadeUpStream:
    """A stream of random payloads in a valid frame; it can be sent and stored, but not decoded."""

    def __init__(self, lengths: tuple[int, ...] = (100, 5000, 20, 900), seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        kinds = [PacketKind.BASE, *[PacketKind.MAP_CONN, PacketKind.PARAM, PacketKind.DIFF] * len(lengths)]
        coarsest = min((len(lengths) + 1) // 3, 12)
        places = [coarsest, *(coarsest - 1 - i // 3 for i in range(len(lengths)))]
        self.packets = [
            Packet(kind, max(level, 0), 0, rng.bytes(length))
            for kind, level, length in zip(kinds, places, lengths, strict=False)
        ]
        table, self.packet_bytes = packet_table(self.packets)
        levels = tuple(
            LevelEntry(
                level=level,
                packet_count=1
                if level == coarsest
                else max(i + 1 for i, p in enumerate(self.packets) if p.level >= level),
                vertices=1000 >> level,
                faces=2000 >> level,
                rms=0.125 * level,
                maximum=0.25 * level,
            )
            for level in range(coarsest, -1, -1)
        )
        options = ClassicHeader(tuple(range(coarsest + 1)), FilterSpec(), frozenset(range(coarsest)))
        self.header = StreamHeader(options, 12, (0.5, -1.0, 2.0), 3.0, levels, table)
        self.header_bytes = self.header.to_bytes()

    def packet_part(self, index: int, start: int, end: int) -> memoryview:
        """As `StreamSource` wants it."""
        return memoryview(self.packet_bytes[index])[start:end]
