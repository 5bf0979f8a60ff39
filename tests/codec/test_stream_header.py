from __future__ import annotations

import math
from dataclasses import replace

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.errors import ContainerError, LimitError, StreamError, VersionError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.header import FORMAT_VERSION, Field, LevelEntry, StreamHeader, check_version, version_of
from streams import MadeUpStream, encoded_grid

HEADER = MadeUpStream().header
SPELT_OUT = replace(HEADER, version=1)
TABLES = replace(HEADER, version=2)


def changed(field: Field, value: object, header: StreamHeader = SPELT_OUT) -> bytes:
    fields = msgpack.unpackb(header.to_bytes(), strict_map_key=False)
    fields[int(field)] = value
    return msgpack.packb(fields)


def test_round_trip() -> None:
    for header in (HEADER, SPELT_OUT, TABLES, encoded_grid().header):
        data = header.to_bytes()
        assert StreamHeader.from_bytes(data) == header
        assert version_of(data) == header.version
    assert (HEADER.version, TABLES.version, SPELT_OUT.version) == (3, 2, 1)
    assert len(HEADER.to_bytes()) < len(TABLES.to_bytes()) < len(SPELT_OUT.to_bytes())


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
        StreamHeader.from_bytes(changed(field, value, TABLES))


def test_missing_and_unknown_fields_are_refused() -> None:
    fields = msgpack.unpackb(SPELT_OUT.to_bytes(), strict_map_key=False)
    with pytest.raises(ContainerError, match="fields"):
        StreamHeader.from_bytes(msgpack.packb({key: value for key, value in fields.items() if key} | {77: 0}))
    with pytest.raises(ContainerError, match="first byte"):
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


@pytest.mark.parametrize(
    "change",
    [
        {"profile": "x" * 33},
        {"options": {1: 2}},
        {"bits": 3},
        {"bits": 21},
        {"origin": (0.0, 1.0, float("nan"))},
        {"origin": (float("inf"), 1.0, 0.0)},
        {"extent": -1.0},
        {"levels": ()},
        {"levels": HEADER.levels[:1]},  # does not end with level 0
        {"levels": (replace(HEADER.levels[0], level=64), HEADER.levels[1])},
        {"levels": (replace(HEADER.levels[0], vertices=0), HEADER.levels[1])},
        {"levels": (replace(HEADER.levels[0], faces=-1), HEADER.levels[1])},
        {"packets": ()},
        {"packets": (replace(HEADER.packets[0], level=64), *HEADER.packets[1:])},
        {"packets": (replace(HEADER.packets[0], slice=1 << 16), *HEADER.packets[1:])},
    ],
    ids=str,
)
def test_wrong_values_are_refused(change: dict[str, object]) -> None:
    data = replace(HEADER, **change).to_bytes()  # type: ignore[arg-type]
    with pytest.raises(ContainerError, match="damaged stream header"):
        StreamHeader.from_bytes(data)


def test_options_that_are_no_map_and_kinds_that_are_none_are_refused() -> None:
    data = HEADER.to_bytes()
    options = len(msgpack.packb(dict(HEADER.options)))
    with pytest.raises(ContainerError, match="options must be a map"):
        StreamHeader.from_bytes(data[:-options] + msgpack.packb([]))
    unknown = replace(HEADER.packets[0], kind=7)  # type: ignore[arg-type]
    with pytest.raises(ContainerError, match="packet kind"):
        StreamHeader.from_bytes(replace(HEADER, packets=(unknown, *HEADER.packets[1:])).to_bytes())


def test_a_header_cut_at_any_byte_is_refused() -> None:
    for header in (HEADER, TABLES, SPELT_OUT, encoded_grid().header):
        data = header.to_bytes()
        for length in range(len(data)):
            with pytest.raises(ContainerError, match="damaged stream header"):
                StreamHeader.from_bytes(data[:length])
        with pytest.raises(ContainerError, match="damaged stream header"):
            StreamHeader.from_bytes(data + b"\0")


def test_the_version_of_headers_and_of_other_bytes() -> None:
    assert [version_of(header.to_bytes()) for header in (SPELT_OUT, TABLES, HEADER)] == [1, 2, 3]
    for foreign in (b"", b"\0", b"\x04", b"\x87", b"ply"):
        assert version_of(foreign) == FORMAT_VERSION
        with pytest.raises(ContainerError, match="first byte"):
            StreamHeader.from_bytes(foreign)


@pytest.mark.parametrize("version", [1, 2, 3])
@pytest.mark.parametrize(("origin", "extent"), [((0.0, 0.0, 0.0), 0.0), ((1e9, -1e9, 1e9), 1e-9)])
def test_a_grid_of_one_point_is_for_one_vertex(version: int, origin: tuple[float, float, float], extent: float) -> None:
    header = replace(SPELT_OUT, version=version, origin=origin, extent=extent)
    with pytest.raises(ContainerError, match="a grid of one point for"):
        StreamHeader.from_bytes(header.to_bytes())
    for point in (replace(header, levels=(LevelEntry(0, 1, 1, 0, 0.0, 0.0),)), replace(header, extent=1e-3)):
        assert StreamHeader.from_bytes(point.to_bytes()) == point


def test_only_level_0_ranks_as_the_finest_mesh() -> None:
    assert [LevelEntry(level, 1, 1, 0, rms, rms).rank for level, rms in [(0, 0.0), (0, 0.5), (3, 0.0), (3, 0.5)]] == [
        0.0,
        0.5,
        math.inf,
        0.5,
    ]
