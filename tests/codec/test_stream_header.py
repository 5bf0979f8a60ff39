from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.errors import ContainerError, LimitError, OptionError, StreamError, VersionError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.header import FORMAT_VERSION, LevelEntry, StreamHeader, check_version
from streams import MadeUpStream, encoded_grid

HEADER = MadeUpStream().header


def test_round_trip() -> None:
    for header in (HEADER, encoded_grid().header):
        data = header.to_bytes()
        assert data[0] == FORMAT_VERSION
        assert StreamHeader.from_bytes(data) == header


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


def test_other_versions_are_refused_by_name() -> None:
    check_version(FORMAT_VERSION)
    for version in range(FORMAT_VERSION):
        with pytest.raises(VersionError, match=rf"older meshtide \(format {version}\): encode it again"):
            check_version(version)
    for version in (FORMAT_VERSION + 1, 65535):
        with pytest.raises(VersionError, match=rf"newer meshtide \(format {version}; .* {FORMAT_VERSION}\): update"):
            check_version(version)


def test_a_header_alone_tells_its_version_too() -> None:
    data = HEADER.to_bytes()[1:]
    with pytest.raises(VersionError, match="format 3.: encode it again"):
        StreamHeader.from_bytes(b"\3" + data)
    with pytest.raises(VersionError, match="format 5;"):
        StreamHeader.from_bytes(b"\5" + data)


@given(st.data())
@settings(max_examples=200)
def test_mutated_headers_raise_stream_errors_only(data: st.DataObject) -> None:
    mutated = bytearray(encoded_grid().header.to_bytes())
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
        {"options": replace(HEADER.options, shifts=(0, 13))},  # type: ignore[arg-type]
        {"options": replace(HEADER.options, levels_with_diff=frozenset({1}))},  # type: ignore[arg-type]
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
    with pytest.raises((ContainerError, OptionError)) as caught:
        StreamHeader.from_bytes(replace(HEADER, **change).to_bytes())  # type: ignore[arg-type]
    if isinstance(caught.value, ContainerError):
        assert "damaged stream header" in str(caught.value)
        assert caught.value.offset is not None


def test_profiles_and_kinds_that_there_are_not_are_refused() -> None:
    data = HEADER.to_bytes()
    with pytest.raises(ContainerError, match=r"byte 2: .* an unknown profile; a newer meshtide may read it"):
        StreamHeader.from_bytes(data[:1] + b"\2" + data[2:])
    unknown = replace(HEADER.packets[0], kind=7)  # type: ignore[arg-type]
    with pytest.raises(ContainerError, match="the row of a packet begins as none does"):
        StreamHeader.from_bytes(replace(HEADER, packets=(unknown, *HEADER.packets[1:])).to_bytes())


def test_a_header_cut_at_any_byte_is_refused() -> None:
    for header in (HEADER, encoded_grid().header):
        data = header.to_bytes()
        for length in range(len(data)):
            with pytest.raises(ContainerError, match="damaged stream header"):
                StreamHeader.from_bytes(data[:length])
        with pytest.raises(ContainerError, match="damaged stream header"):
            StreamHeader.from_bytes(data + b"\0")


def test_bytes_that_begin_as_no_header_does_are_refused() -> None:
    for foreign in (b"\x80", b"\x89", b"\xff" * 99):
        with pytest.raises(ContainerError, match="damaged stream header: it does not begin as headers do"):
            StreamHeader.from_bytes(foreign)


@pytest.mark.parametrize(("origin", "extent"), [((0.0, 0.0, 0.0), 0.0), ((1e9, -1e9, 1e9), 1e-9)])
def test_a_grid_of_one_point_is_for_one_vertex(origin: tuple[float, float, float], extent: float) -> None:
    header = replace(HEADER, origin=origin, extent=extent)
    with pytest.raises(ContainerError, match="a grid of one point for"):
        StreamHeader.from_bytes(header.to_bytes())
    levels = tuple(LevelEntry(level, 4 - level, 1, 0, 0.0, 0.0) for level in (1, 0))
    for point in (replace(header, levels=levels), replace(header, extent=1e-3)):
        assert StreamHeader.from_bytes(point.to_bytes()) == point


def test_only_level_0_ranks_as_the_finest_mesh() -> None:
    assert [LevelEntry(level, 1, 1, 0, rms, rms).rank for level, rms in [(0, 0.0), (0, 0.5), (3, 0.0), (3, 0.5)]] == [
        0.0,
        0.5,
        math.inf,
        0.5,
    ]
