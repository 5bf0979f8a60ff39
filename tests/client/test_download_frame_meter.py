from hypothesis import given
from hypothesis import strategies as st
from websockets.frames import Frame, Opcode

from meshtide_client.download.frame_meter import FrameMeter

ANSWER = b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n\r\n"
OPCODES = [Opcode.CONT, Opcode.TEXT, Opcode.BINARY, Opcode.PING, Opcode.PONG, Opcode.CLOSE]
MESSAGES = {Opcode.CONT, Opcode.TEXT, Opcode.BINARY}


def frame(opcode: Opcode, size: int, *, mask: bool = False) -> bytes:
    return Frame(opcode, bytes(size)).serialize(mask=mask)


@given(
    st.lists(st.tuples(st.sampled_from(OPCODES), st.sampled_from([0, 1, 125, 126, 300, 65_536]), st.booleans())),
    st.lists(st.integers(1, 400), max_size=20),
)
def test_the_content_of_messages_is_counted_however_it_comes(
    frames: list[tuple[Opcode, int, bool]], steps: list[int]
) -> None:
    frames = [(opcode, size if opcode in MESSAGES else min(size, 125), mask) for opcode, size, mask in frames]
    data = ANSWER + b"".join(frame(opcode, size, mask=mask) for opcode, size, mask in frames)
    meter = FrameMeter()
    place = 0
    for step in steps:
        meter.feed(data[place : place + step])
        place += step
    meter.feed(data[place:])
    assert meter.message_bytes == sum(size for opcode, size, _ in frames if opcode in MESSAGES)


def test_a_frame_counts_before_it_is_whole() -> None:
    meter = FrameMeter()
    counted = []
    for byte in ANSWER + frame(Opcode.PING, 3) + frame(Opcode.BINARY, 2):
        meter.feed(bytes([byte]))
        counted.append(meter.message_bytes)
    assert counted == [0] * (len(counted) - 2) + [1, 2]


def test_what_is_no_websocket_counts_nothing() -> None:
    meter = FrameMeter()
    for _ in range(100):
        meter.feed(b"HTTP/1.1 200 OK\r\n")
    assert meter.message_bytes == 0
