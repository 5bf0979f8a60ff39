import asyncio

from meshtide_server.http import gate as gates
from meshtide_server.http.connection import Connection
from meshtide_server.http.gate import PIECES_A_TURN, Gate

from ..connection_parts import Notes, connected, turns


class Lines(Gate):
    """Hands on lines."""

    def cut(self, waiting: bytearray) -> int | float:
        return waiting.find(b"\n") + 1


async def test_a_few_pieces_are_handed_on_in_each_turn_and_others_have_theirs_between() -> None:
    inner = Notes()
    gate = Lines(inner, Connection())
    transport = connected(gate)
    gate.data_received(b"x\n" * (3 * PIECES_A_TURN + 5) + b"half")
    assert len(inner.pieces) == PIECES_A_TURN
    assert not transport.reading  # so that no more can come than was read at once
    counts = []
    for _ in range(5):
        await turns(1)
        counts.append(len(inner.pieces))
    assert counts == [PIECES_A_TURN * 2, PIECES_A_TURN * 3, PIECES_A_TURN * 3 + 5, *[PIECES_A_TURN * 3 + 5] * 2]
    assert transport.reading
    assert gate.waiting == 4
    gate.data_received(b" line\n")
    assert inner.pieces[-1] == b"half line\n"


async def test_nothing_is_handed_on_while_the_protocol_behind_wants_nothing() -> None:
    class Slow(Notes):
        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            self.transport.pause_reading()

    inner = Slow()
    gate = Lines(inner, Connection())
    transport = connected(gate)
    gate.data_received(b"1\n2\n3\n")
    await turns(3)
    assert (inner.heard, transport.reading) == (b"1\n", False)
    gate.data_received(b"4\n")  # what was read before the pause
    await turns(3)
    assert inner.heard == b"1\n"
    inner.transport.resume_reading()
    inner.transport.resume_reading()
    await turns(3)
    assert (inner.heard, transport.reading) == (b"1\n2\n", False)
    for _ in range(3):
        inner.transport.resume_reading()
        await turns(2)
    assert inner.heard == b"1\n2\n3\n4\n"
    inner.transport.resume_reading()
    assert transport.reading


async def test_who_is_given_up_is_told_why_then_not_heard_and_closed() -> None:
    inner = Notes()
    gate = Lines(inner, Connection())
    transport = connected(gate)
    gate.data_received(b"1\n" * (PIECES_A_TURN + 1))
    seconds, gates.LINGER_SECONDS = gates.LINGER_SECONDS, 0.01
    try:
        gate.give_up(said=b"no more", heard=b"the end\n")
    finally:
        gates.LINGER_SECONDS = seconds
    assert transport.written == b"no more"
    assert transport.ended
    assert transport.reading  # else the system would tell the client that its bytes were lost, not what was said
    assert not transport.is_closing()
    assert inner.transport.is_closing()
    inner.transport.close()
    assert not transport.is_closing()
    gate.data_received(b"2\n")
    await turns(3)
    assert inner.pieces[-1] == b"the end\n"
    assert gate.waiting == 0
    await asyncio.sleep(0.05)
    assert transport.aborted


async def test_a_lost_connection_leaves_nothing() -> None:
    inner = Notes()
    gate = Lines(inner, Connection())
    connected(gate)
    gate.data_received(b"1\n" * (PIECES_A_TURN + 1))
    gate.connection_lost(None)
    await turns(2)
    assert inner.lost
    assert len(inner.pieces) == PIECES_A_TURN
    assert gate.waiting == 0


async def test_what_is_for_a_client_that_has_left_is_dropped() -> None:
    """The transports of uvloop raise an error when they are closed and written to."""
    inner = Notes()
    gate = Lines(inner, Connection())
    transport = connected(gate)
    inner.transport.write(b"heard")
    transport.abort()
    inner.transport.write(b"not heard")
    inner.transport.close()
    gate.give_up(said=b"no more")
    assert transport.written == b"heard"
    assert not transport.ended
