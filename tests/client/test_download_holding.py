from __future__ import annotations

import pytest

from meshtide_client.download.holding import Holding
from meshtide_codec.errors import ProtocolError
from meshtide_codec.stream.container import write_container
from streams import MadeUpStream

STREAM = MadeUpStream()


def test_it_counts_what_it_is_given() -> None:
    holding = Holding()
    assert (holding.size, holding.state, holding.summary()) == (0, None, "no level is complete yet")
    holding.begin(STREAM.header, STREAM.header_bytes)
    states = []
    for index, data in enumerate(STREAM.packet_bytes):
        holding.append(index, data)
        states.append(holding.state)
    assert states == [
        next((row for row in reversed(STREAM.header.levels) if row.packet_count <= count), None)
        for count in range(1, len(STREAM.packets) + 1)
    ]
    assert holding.size == len(write_container(STREAM.header, STREAM.packet_bytes))
    assert holding.summary() == "level 0 is complete (1000 vertices, 2000 faces)"
    assert holding.stored_packets() == ()


def test_a_new_stream_starts_from_nothing() -> None:
    holding = Holding()
    holding.begin(STREAM.header, STREAM.header_bytes)
    holding.append(0, STREAM.packet_bytes[0])
    other = MadeUpStream(seed=1)
    holding.begin(other.header, other.header_bytes)
    assert (holding.count, holding.header_bytes) == (0, other.header_bytes)
    with pytest.raises(ProtocolError, match="packet 1 arrived where packet 0 was due"):
        holding.append(1, other.packet_bytes[1])
