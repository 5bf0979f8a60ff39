from __future__ import annotations

import gzip
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_client.connection.content_coding import PIECE, ContentDecoder, read_body
from meshtide_codec.errors import ProtocolError, TransferError


def raw_deflate(data: bytes) -> bytes:
    compressor = zlib.compressobj(wbits=-15)
    return compressor.compress(data) + compressor.flush()


PACKERS = {"gzip": gzip.compress, "x-gzip": gzip.compress, "GZip ": gzip.compress, "deflate": zlib.compress}


@given(
    st.sampled_from([*PACKERS.items(), ("deflate", raw_deflate), ("", bytes), ("identity", bytes)]),
    st.lists(st.binary(max_size=80), max_size=4),
    st.integers(1, 30),
)
def test_what_was_compressed_comes_back(packer: tuple[str, object], parts: list[bytes], step: int) -> None:
    coding, pack = packer
    whole = b"".join(parts) * 5
    packed = pack(whole)  # type: ignore[operator]
    if pack is gzip.compress:
        packed = b"".join(gzip.compress(part) for part in parts * 5)  # several members
    pieces = [packed[start : start + step] for start in range(0, len(packed), step)]
    assert read_body(pieces, coding, "a list", 1 << 20) == whole


@pytest.mark.parametrize("coding", ["gzip", "deflate"])
def test_pieces_are_small_however_much_a_body_expands(coding: str) -> None:
    size = 1 << 24
    bomb = PACKERS[coding](bytes(size))
    decoder = ContentDecoder(coding, "a list")
    total = 0
    for piece in decoder.feed(bomb):
        assert len(piece) <= PIECE
        total += len(piece)
    decoder.end()
    assert total == size
    with pytest.raises(ProtocolError, match="more than 100000 bytes"):
        read_body([bomb], coding, "a list", 100_000)


@pytest.mark.parametrize("coding", ["br", "zstd", "gzip, gzip", "compress", "\x1b[31m"])
def test_other_codings_are_refused(coding: str) -> None:
    with pytest.raises(ProtocolError, match="a list comes compressed on the way") as caught:
        ContentDecoder(coding, "a list")
    assert "\x1b" not in str(caught.value)


@pytest.mark.parametrize("coding", ["gzip", "deflate"])
@given(cut=st.integers(1, 10**6))
def test_a_body_that_ends_early_is_told(coding: str, cut: int) -> None:
    packed = PACKERS[coding](bytes(range(200)))
    with pytest.raises(TransferError, match="ended inside of its compression"):
        read_body([packed[: 1 + cut % (len(packed) - 1)]], coding, "a list", 1000)


@given(st.binary(max_size=100))
def test_damaged_bodies_raise_from_the_tree_only(data: bytes) -> None:
    for coding in ("gzip", "deflate"):
        try:
            read_body([data], coding, "a list", 10_000)
        except (TransferError, ProtocolError) as error:
            assert "a list" in str(error)


def test_bytes_after_the_end_are_told() -> None:
    for coding in ("gzip", "deflate"):
        with pytest.raises(TransferError, match="damaged inside of its compression"):
            read_body([PACKERS[coding](b"abc") + b"def"], coding, "a list", 1000)


def test_a_body_expands_as_it_arrives() -> None:
    decoder = ContentDecoder("gzip", "a file")
    packed = gzip.compress(b"abc" * 50_000)
    pieces = [piece for start in range(0, len(packed), 10) for piece in decoder.feed(packed[start : start + 10])]
    decoder.end()
    assert b"".join(pieces) == b"abc" * 50_000
    assert max(map(len, pieces)) <= PIECE
