"""Streams of random bytes, and real ones."""

from __future__ import annotations

from pathlib import Path
from random import Random

from meshtide_codec.classic.options import ClassicHeader
from meshtide_codec.filters import FilterSpec
from meshtide_codec.packets import Packet, PacketKind
from meshtide_codec.stream.container import write_container
from meshtide_codec.stream.header import LevelEntry, StreamHeader, packet_table

GOLDEN = Path(__file__).parents[1] / "golden"


def make_stream(seed: int = 0, payloads: tuple[int, ...] = (400, 30, 40, 2000, 50, 5000)) -> bytes:
    """A `.tide` file whose packets hold random bytes of the given lengths; three levels, valid in every respect."""
    random = Random(seed)
    places = (
        (PacketKind.BASE, 2),
        (PacketKind.MAP_CONN, 1),
        (PacketKind.DIFF, 1),
        (PacketKind.MAP_CONN, 0),
        (PacketKind.PARAM, 0),
        (PacketKind.DIFF, 0),
    )
    packets = [
        Packet(kind, level, 0, random.randbytes(length)) for (kind, level), length in zip(places, payloads, strict=True)
    ]
    table, encoded = packet_table(packets)
    header = StreamHeader(
        ClassicHeader((0, 1, 2), FilterSpec("gaussian"), frozenset({0, 1})),
        bits=12,
        origin=(0.0, -1.0, 0.5),
        extent=2.0,
        levels=(
            LevelEntry(2, 1, 100, 196, 0.02, 0.05),
            LevelEntry(1, 3, 400, 796, 0.01, 0.03),
            LevelEntry(0, 6, 1600, 3196, 0.0, 0.0),
        ),
        packets=table,
    )
    return write_container(header, encoded)


def real_stream(number: int) -> bytes:
    """A small `.tide` file that decodes, one of five for the numbers 1 to 5."""
    return (GOLDEN / f"compact-scattered-{number}.tide").read_bytes()
