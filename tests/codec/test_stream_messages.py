from __future__ import annotations

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import ProtocolError
from meshtide_codec.stream.messages import (
    FINGERPRINT_BYTES,
    LARGEST_MESSAGE,
    LARGEST_PART,
    Credit,
    Done,
    Error,
    HeaderPart,
    Hello,
    PacketPart,
    decode_message,
    encode_message,
)

HELLO = Hello(1, "bunny", b"f" * FINGERPRINT_BYTES, ((0, 3), (5, 6)), 2, 0.5, 1000, 1 << 20)
MESSAGES = [
    HELLO,
    Hello(1, "", b"", (), None, None, None, 0),
    Credit(5),
    HeaderPart(b"f" * FINGERPRINT_BYTES, 100, 0, b"abc"),
    PacketPart(3, 0, bytes(LARGEST_PART)),
    Done(4, 1000, more=True),
    Error("code", "message"),
]


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: type(message).__name__)
def test_round_trip_within_the_largest_frame(message: object) -> None:
    frame = encode_message(message)  # type: ignore[arg-type]
    assert decode_message(frame) == message
    assert len(frame) <= LARGEST_MESSAGE


def test_frames_are_frozen() -> None:
    assert encode_message(Credit(1024)).hex() == "9201cd0400"
    assert encode_message(Done(2, 300, more=False)).hex() == "940402cd012cc2"
    assert encode_message(Hello(1, "a", b"", ((0, 2),), None, 0.5, None, 9)).hex() == (
        "990001a161c400919200" + "02c0cb3fe0000000000000c009"
    )


@pytest.mark.parametrize(
    "value",
    [
        [],
        7,
        {},
        [6],
        [-1, 0],
        [1],
        [1, -1],
        [1, 1, 1],
        [1, "5"],
        [0, 1, "m", b"short", [], None, None, None, 1],
        [0, 1, "m" * 201, b"", [], None, None, None, 1],
        [0, 1, "m", b"", [[2, 1]], None, None, None, 1],
        [0, 1, "m", b"", [[0, 2], [1, 3]], None, None, None, 1],
        [0, 1, "m", b"", [[0]], None, None, None, 1],
        [0, 1, "m", b"", [[0, 1]] * 5000, None, None, None, 1],
        [0, 1, "m", b"", [], 64, None, None, 1],
        [0, 1, "m", b"", [], None, -0.5, None, 1],
        [0, 1, "m", b"", [], None, float("nan"), None, 1],
        [0, 1, "m", b"", [], None, None, -1, 1],
        [3, 0, 0, "text"],
        [3, 0, 0, bytes(LARGEST_PART + 1)],
        [4, 1, 1, 1],
        [5, "code", b"bytes"],
        [5, "code", "x" * 1001],
    ],
)
def test_malformed_messages_are_refused(value: object) -> None:
    with pytest.raises(ProtocolError, match="not a meshtide message"):
        decode_message(msgpack.packb(value))


def test_text_and_oversized_frames_are_refused() -> None:
    with pytest.raises(ProtocolError, match="text frame"):
        decode_message("hello")
    with pytest.raises(ProtocolError, match="the protocol allows"):
        decode_message(bytes(LARGEST_MESSAGE + 1))


@given(st.binary(max_size=100))
def test_any_bytes_are_a_message_or_a_protocol_error(frame: bytes) -> None:
    try:
        message = decode_message(frame)
    except ProtocolError:
        return
    assert decode_message(encode_message(message)) == message
