from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.reference.packed_header import read_packed_header
from meshtide_codec.stream.distances import pack_distances, unpack_distances
from meshtide_codec.stream.packed_header import VERSION, PlainHeader, pack_header, unpack_header
from meshtide_codec.stream.plain_values import BadValueError

PACKETS = st.lists(
    st.tuples(st.integers(0, 7), st.integers(0, 63), st.integers(0, 65535), st.integers(0, 2**40)), max_size=20
)


@st.composite
def headers(draw: st.DrawFn) -> PlainHeader:
    packets = draw(PACKETS)
    counts = sorted(draw(st.lists(st.integers(1, len(packets)), max_size=12))) if packets else []
    sizes = st.integers(0, 2**30) | st.just(7)
    return PlainHeader(
        profile=draw(st.sampled_from(["classic", "compact", "x", "a name spelt öut"])),
        options=draw(st.dictionaries(st.text(max_size=3), st.integers(0, 300) | st.binary(max_size=9), max_size=3)),
        bits=draw(st.integers(4, 20)),
        origin=draw(st.lists(st.floats(-9.0, 9.0), min_size=3, max_size=3)),
        extent=draw(st.floats(0.0, 9.0)),
        packets=packets,
        checksums=[draw(st.integers(0, 2**32 - 1)) for _ in packets],
        states=[
            (draw(st.integers(0, 63) | st.just(packets[count - 1][1])), count, draw(sizes), draw(sizes))
            for count in counts
        ],
        distances=[unpack_distances(draw(st.binary(min_size=2, max_size=2))) for _ in counts],
    )


PLAIN = PlainHeader(
    profile="compact",
    options={},
    bits=12,
    origin=[0.0, 0.5, -2.25],
    extent=1.0,
    packets=[(0, 5, 0, 100), (1, 4, 0, 90), (3, 4, 0, 80), (3, 3, 0, 70)],
    checksums=[1, 2, 3, 4],
    states=[(5, 1, 50, 96), (4, 2, 110, 216), (4, 3, 110, 216), (3, 4, 110, 216), (0, 4, 110, 216)],
    distances=[(0.25, 0.5), (0.125, 0.25), (0.125, 0.1875), (0.0625, 0.125), (0.0, 0.0)],
)


@given(headers())
@settings(max_examples=50)
def test_any_header_comes_back(header: PlainHeader) -> None:
    assert unpack_header(pack_header(header), 1000) == header


@given(headers())
@settings(max_examples=50)
def test_the_reference_reads_the_same(header: PlainHeader) -> None:
    found = read_packed_header(pack_header(header))
    assert (found.profile, found.options, found.bits) == (header.profile, header.options, header.bits)
    assert (found.origin, found.extent) == (header.origin, header.extent)
    assert (found.packets, found.checksums) == (header.packets, header.checksums)
    assert found.states == header.states
    assert found.distances == [pack_distances(*pair) for pair in header.distances]


def test_what_is_expected_takes_few_bytes() -> None:
    data = pack_header(PLAIN)
    fixed = len(bytes([VERSION, 1, 12])) + 2 + 2 + 3 + 2
    row = 1 + 1 + 4
    state = 1 + 1 + 2
    elsewhere, more = 2, 1 + 2  # level and slice of the first packet; two states at the last one
    same_size = 2
    assert len(data) == fixed + 1 + elsewhere + 4 * row + more + 4 * state + same_size + len(b"\x80")


def test_a_header_cut_at_any_byte_is_refused() -> None:
    data = pack_header(PLAIN)
    for length in range(len(data)):
        with pytest.raises(BadValueError):
            unpack_header(data[:length], 1000)


@pytest.mark.parametrize(
    ("data", "wrong"),
    [
        (b"", "first byte"),
        (bytes([VERSION + 1, 1]), "first byte"),
        (bytes([VERSION, 1]), "1 bytes at byte 2 are cut off"),
        (bytes([VERSION, 2 + 1, 0xFF]), "UTF-8"),
        (bytes([VERSION, 2 + 9, 65]), "9 bytes at byte 2 are cut off"),
        (bytes([VERSION, 1, 12, 0, 0, 0, 0, 0, 0, 0, 0, 1, 128, 1]), "row of packet 0 begins as none does"),
        (bytes([VERSION, 1, 12, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 9, 0, 0]), "4 bytes"),
        (bytes([VERSION, 1, 12, 0, 0, 0, 0, 0, 0, 0, 0, 1, 32, 9, 0, 0, 0, 0, 2, 2, 0]), "2 bytes"),
        (bytes([VERSION, 1, 12, 0, 0, 0, 0, 0, 0, 0, 0, 0]), "msgpack"),
    ],
)
def test_damaged_headers_are_refused(data: bytes, wrong: str) -> None:
    with pytest.raises(BadValueError, match=wrong):
        unpack_header(data, 1000)
