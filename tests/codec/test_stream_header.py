from __future__ import annotations

from dataclasses import replace

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.errors import ContainerError, LimitError, StreamError, VersionError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.header import FORMAT_VERSION, Field, StreamHeader, check_version, stored_distance, version_of
from streams import MadeUpStream, encoded_grid

HEADER = MadeUpStream().header
SPELT_OUT = replace(HEADER, version=1)


def changed(field: Field, value: object, header: StreamHeader = SPELT_OUT) -> bytes:
    fields = msgpack.unpackb(header.to_bytes(), strict_map_key=False)
    fields[int(field)] = value
    return msgpack.packb(fields)


def test_round_trip() -> None:
    for header in (HEADER, SPELT_OUT, encoded_grid().header):
        data = header.to_bytes()
        assert StreamHeader.from_bytes(data) == header
        assert version_of(data) == header.version
    assert (HEADER.version, SPELT_OUT.version) == (2, 1)
    assert len(HEADER.to_bytes()) < len(SPELT_OUT.to_bytes())


def test_counts_and_offsets() -> None:
    assert HEADER.vertices == 1000
    assert HEADER.faces == 2000
    lengths = [entry.length for entry in HEADER.packets]
    assert HEADER.packet_offsets.tolist() == [0, lengths[0], sum(lengths[:2]), sum(lengths[:3]), sum(lengths)]
    assert [HEADER.level_bytes(row) for row in HEADER.levels] == [lengths[0], sum(lengths)]
    assert HEADER.entry(1) is HEADER.levels[0]
    with pytest.raises(KeyError):
        HEADER.entry(2)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        (Field.PROFILE, "x" * 33),
        (Field.PROFILE, 3),
        (Field.OPTIONS, []),
        (Field.OPTIONS, {1: 2}),
        (Field.BITS, 3),
        (Field.BITS, 21),
        (Field.ORIGIN, [0.0, 1.0]),
        (Field.ORIGIN, [0.0, 1.0, float("nan")]),
        (Field.EXTENT, -1.0),
        (Field.EXTENT, float("inf")),
        (Field.LEVELS, []),
        (Field.LEVELS, [0, 1, 10]),
        (Field.LEVELS, [1, 1, 10, 10, 1, 4, 20, 20]),  # does not end with level 0
        (Field.LEVELS, [1, 4, 10, 10, 0, 1, 20, 20]),  # not in transmission order
        (Field.LEVELS, [1, 1, 10, 10, 0, 5, 20, 20]),  # more packets than there are
        (Field.LEVELS, [1, 0, 10, 10, 0, 4, 20, 20]),
        (Field.LEVELS, [1, 1, 0, 10, 0, 4, 20, 20]),
        (Field.LEVELS, [1, 1, 10, -1, 0, 4, 20, 20]),
        (Field.LEVELS, [64, 1, 10, 10, 0, 4, 20, 20]),
        (Field.PACKETS, []),
        (Field.PACKETS, [0, 0, 0]),
        (Field.PACKETS, [9, 0, 0, 1] * 4),
        (Field.PACKETS, [0, 0, 0, -1] * 4),
        (Field.CHECKSUMS, b"123"),
        (Field.DISTANCES, b""),
        (Field.DISTANCES, b"\xff" * 8),  # not numbers
    ],
)
def test_wrong_fields_are_refused(field: Field, value: object) -> None:
    with pytest.raises(ContainerError, match="damaged stream header"):
        StreamHeader.from_bytes(changed(field, value))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        (Field.LEVELS, [0, 4, 20, 20]),
        (Field.LEVELS, b""),
        (Field.LEVELS, b"\x08"),
        (Field.LEVELS, b"\x12\x02\x02\0\0\0\0"),  # more packets than there are
        (Field.LEVELS, b"\x02\x02\x02\0\0\0\0"),  # does not end with level 0
        (Field.LEVELS, b"\x08\x01\x02\0\0\0\0"),  # a vertex less than none
        (Field.LEVELS, b"\x08\x02\x05\0\0\0\0"),  # a face less than none
        (Field.LEVELS, b"\x08\x02\x02\xff\xff\0\0"),  # a distance that is no number
        (Field.PACKETS, [0, 0, 0, 1]),
        (Field.PACKETS, b""),
        (Field.PACKETS, b"\x10\x01"),  # finer than level 0
        (Field.PACKETS, b"\x06\x01"),  # no such kind
        (Field.CHECKSUMS, b"123"),
    ],
)
def test_wrong_packed_fields_are_refused(field: Field, value: object) -> None:
    with pytest.raises(ContainerError, match="damaged stream header"):
        StreamHeader.from_bytes(changed(field, value, HEADER))


def test_missing_and_unknown_fields_are_refused() -> None:
    fields = msgpack.unpackb(SPELT_OUT.to_bytes(), strict_map_key=False)
    with pytest.raises(ContainerError, match="fields"):
        StreamHeader.from_bytes(msgpack.packb(fields | {77: 0}))
    del fields[0]
    with pytest.raises(ContainerError, match="fields"):
        StreamHeader.from_bytes(msgpack.packb(fields))


@pytest.mark.parametrize(
    "limits",
    [
        Limits(vertices=999),
        Limits(faces=1999),
        Limits(levels=1),
        Limits(packets=3),
        Limits(packet_bytes=4999),
        Limits(header_bytes=50),
        Limits(memory=10**5),
    ],
)
def test_claims_over_the_limits_are_refused(limits: Limits) -> None:
    with pytest.raises(LimitError):
        StreamHeader.from_bytes(HEADER.to_bytes(), limits)


def test_a_claim_of_a_million_million_vertices_is_refused_at_once() -> None:
    levels = [replace(row, vertices=10**12) for row in HEADER.levels]
    with pytest.raises(LimitError, match="1000000000000 vertices"):
        StreamHeader.from_bytes(replace(HEADER, levels=tuple(levels)).to_bytes())


def test_newer_versions_are_not_read() -> None:
    for version in range(1, FORMAT_VERSION + 1):
        check_version(version)
    for version in (0, FORMAT_VERSION + 1):
        with pytest.raises(VersionError, match=f"version {version}; this program reads versions 1 to {FORMAT_VERSION}"):
            check_version(version)


@given(st.data())
@settings(max_examples=200)
def test_mutated_headers_raise_stream_errors_only(data: st.DataObject) -> None:
    original = replace(encoded_grid().header, version=data.draw(st.integers(1, FORMAT_VERSION))).to_bytes()
    mutated = bytearray(original)
    for _ in range(data.draw(st.integers(1, 4))):
        mutated[data.draw(st.integers(0, len(mutated) - 1))] = data.draw(st.integers(0, 255))
    try:
        header = StreamHeader.from_bytes(bytes(mutated), Limits(vertices=10**6, faces=10**6))
    except StreamError:
        return
    assert header.vertices <= 10**6


@given(st.floats(0.0, 1e30))
def test_stored_distances_are_a_little_too_large_and_never_too_small(distance: float) -> None:
    stored = stored_distance(distance)
    assert distance <= stored <= distance * (1 + 2**-7) + 1e-37
    assert stored_distance(stored) == stored
    row = replace(HEADER.levels[-1], rms=stored, maximum=stored)
    assert StreamHeader.from_bytes(replace(HEADER, levels=(row,)).to_bytes()).levels == (row,)
