from __future__ import annotations

import tracemalloc
from contextlib import suppress
from dataclasses import replace
from itertools import permutations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import Decoder, LevelUpdate, decode
from meshtide_codec.distortion import DistortionMeter
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.errors import ContainerError, LimitError, PacketError
from meshtide_codec.filters import FilterSpec
from meshtide_codec.limits import Limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.packets import Packet, PacketKind
from meshtide_codec.stream.container import write_container
from meshtide_codec.stream.header import StreamHeader, packet_table
from meshtide_codec.testing import grid, random_meshes, shapes
from streams import check_with_one_damaged_packet, encoded_grid

SPECS = [
    FilterSpec("zeroth"),
    FilterSpec("gaussian"),
    FilterSpec("taubin"),
    FilterSpec("polynomial", degree=1),
    FilterSpec("polynomial", degree=3, basis="chebyshev"),
    FilterSpec("polynomial", degree=7),
    FilterSpec("polynomial", degree=2, norm=float("inf")),
    FilterSpec("polynomial", degree=2, norm=1.0),
    FilterSpec("polynomial", degree=2, norm=1.5),
    FilterSpec("rational", degree=1, denominator_degree=1),
]


def assert_exact(decoded: Mesh, encoded: EncodedMesh) -> None:
    expected = encoded.quantized.mesh()
    assert np.array_equal(decoded.vertices, expected.vertices)
    assert np.array_equal(decoded.faces, expected.faces)


@pytest.mark.parametrize("name", shapes())
@pytest.mark.parametrize("variable_from", [None, 2, 99])
def test_every_shape_survives(name: str, variable_from: int | None) -> None:
    encoded = encode(shapes()[name](), ClassicOptions(bits=7, coarsest_vertices=5, variable_from=variable_from))
    assert_exact(decode(encoded.to_bytes()), encoded)


@pytest.mark.parametrize("spec", SPECS, ids=str)
def test_every_filter_survives(spec: FilterSpec) -> None:
    encoded = encode(grid(14), ClassicOptions(bits=9, coarsest_vertices=10, filter=spec))
    assert len(encoded.header.levels) > 2
    assert_exact(decode(encoded.to_bytes()), encoded)


@given(random_meshes(), st.sampled_from(SPECS), st.integers(4, 14), st.integers(1, 3), st.sampled_from([None, 2, 9]))
@settings(max_examples=60)
def test_random_meshes_survive(mesh: Mesh, spec: FilterSpec, bits: int, drop_bits: int, start: int | None) -> None:
    options = ClassicOptions(
        bits=bits, drop_bits=drop_bits, filter=spec, coarsest_vertices=4, minimum_ratio=1.2, variable_from=start
    )
    encoded = encode(mesh, options)
    assert_exact(decode(encoded.to_bytes()), encoded)


def test_encoding_is_deterministic() -> None:
    assert encode(grid(16), ClassicOptions()).to_bytes() == encode(grid(16), ClassicOptions()).to_bytes()


def test_a_stream_cut_after_any_packet_is_a_drawable_mesh() -> None:
    encoded = encoded_grid()
    decoder = Decoder(encoded.header)
    assert decoder.finest is None
    for count, packet in enumerate(encoded.packets, 1):
        decoder.push(packet)
        finest = decoder.finest
        assert finest is not None
        mesh = decoder.mesh(finest)
        row = encoded.header.entry(finest)
        assert mesh.vertices.shape == (row.vertices, 3)
        assert mesh.faces.shape == (row.faces, 3)
        assert mesh.faces.max() < len(mesh.vertices)
        assert np.isfinite(mesh.vertices).all()
        complete = [entry.level for entry in encoded.header.levels if entry.packet_count <= count]
        assert [level for level in complete if not decoder.is_exact(level)] == []
    assert decoder.is_exact(0)


def test_updates_tell_each_level_when_it_can_be_drawn_and_when_it_is_exact() -> None:
    encoded = encoded_grid()
    decoder = Decoder(encoded.header)
    updates = [(packet.kind, decoder.push(packet)) for packet in encoded.packets]
    coarsest = encoded.header.levels[0].level
    assert updates[0] == (PacketKind.BASE, [LevelUpdate(coarsest, exact=True)])
    for kind, changed in updates[1:]:
        levels = [(update.level, update.exact) for update in changed]
        if kind is PacketKind.MAP_CONN:
            assert levels == []  # without its Param the level cannot be predicted
        elif kind is PacketKind.PARAM:
            assert levels == [(decoder_level(levels), False)]
        else:
            assert levels == [(decoder_level(levels), True)]


def decoder_level(levels: list[tuple[int, bool]]) -> int:
    assert len(levels) == 1
    return levels[0][0]


def test_the_same_levels_come_out_in_any_order_of_arrival() -> None:
    encoded = encode(grid(8), ClassicOptions(bits=6, coarsest_vertices=12))
    packets = list(encoded.packets[:7])
    reference = Decoder(encoded.header)
    for packet in packets:
        reference.push(packet)
    rng = np.random.default_rng(0)
    orders = list(permutations(range(len(packets))))
    for index in rng.choice(len(orders), 60, replace=False):
        decoder = Decoder(encoded.header)
        for place in orders[index]:
            decoder.push(packets[place])
            finest = decoder.finest
            if finest is not None:
                decoder.mesh(finest)  # what was drawn too early must not stay
        assert decoder.finest == reference.finest
        for level in range(encoded.header.levels[0].level, reference.finest - 1, -1):  # type: ignore[operator]
            assert np.array_equal(decoder.mesh(level).vertices, reference.mesh(level).vertices)


@given(st.sets(st.integers(0, 5)))
@settings(max_examples=20)
def test_missing_diffs_cost_precision_and_nothing_else(missing: set[int]) -> None:
    encoded = encoded_grid()
    decoder = Decoder(encoded.header)
    for packet in encoded.packets:
        if not (packet.kind is PacketKind.DIFF and packet.level in missing):
            decoder.push(packet)
    lost = {packet.level for packet in encoded.packets if packet.kind is PacketKind.DIFF} & missing
    for row in encoded.header.levels:
        mesh = decoder.mesh(row.level)
        assert np.isfinite(mesh.vertices).all()
        assert decoder.is_exact(row.level) == (not any(level >= row.level for level in lost))
    assert np.array_equal(decoder.mesh(0).faces, encoded.quantized.mesh().faces)
    if not lost:
        assert_exact(decoder.mesh(0), encoded)


def test_a_late_diff_makes_all_finer_levels_better() -> None:
    encoded = encoded_grid()
    decoder = Decoder(encoded.header)
    late = next(packet for packet in encoded.packets if packet.kind is PacketKind.DIFF)
    for packet in encoded.packets:
        if packet is not late:
            decoder.push(packet)
    assert not decoder.is_exact(0)
    decoder.mesh(0)
    assert decoder.push(late) == [LevelUpdate(level, exact=True) for level in range(late.level, -1, -1)]
    assert_exact(decoder.mesh(0), encoded)


def test_a_level_without_its_diff_is_nearer_than_its_parents() -> None:
    encoded = encode(grid(30), ClassicOptions(bits=12, filter=FilterSpec("polynomial", degree=3), coarsest_vertices=40))
    whole, predicted = Decoder(encoded.header), Decoder(encoded.header)
    for packet in encoded.packets:
        whole.push(packet)
        if not (packet.kind is PacketKind.DIFF and packet.level == 0):
            predicted.push(packet)
    exact, mesh = whole.mesh(0), predicted.mesh(0)
    measured = DistortionMeter(exact.vertices, exact.faces).measure(mesh.vertices, mesh.faces)
    assert 0.0 < measured.rms < 0.8 * encoded.header.entry(1).rms


def test_the_header_tells_the_distance_of_each_level() -> None:
    encoded = encoded_grid()
    rms = [row.rms for row in encoded.header.levels]
    assert rms == sorted(rms, reverse=True)
    assert rms[-1] == 0.0
    assert all(row.maximum >= row.rms for row in encoded.header.levels)
    coarsest = encoded.header.levels[0]
    cell = 2.0 ** (encoded.header.options.shifts[-1]) / (2**8 - 1)
    largest = cell * encoded.header.extent * 3**0.5 / 2
    assert coarsest.maximum * grid(16).diagonal <= 1.25 * largest  # a maximum is stored at most 1/4 too large


def test_decoding_a_coarser_level_needs_only_its_packets() -> None:
    encoded = encoded_grid()
    row = encoded.header.levels[1]
    mesh = decode(encoded.to_bytes(), row.level)
    assert (len(mesh.vertices), len(mesh.faces)) == (row.vertices, row.faces)
    with pytest.raises(KeyError, match="levels 0"):
        decode(encoded.to_bytes(), 40)


def test_decoding_a_level_reads_no_preview_but_its_own() -> None:
    encoded = encode(grid(60), CompactOptions(bits=10, previews=(40, 10)))
    levels = [packet.level for packet in encoded.packets if packet.kind is PacketKind.PREVIEW]
    assert len(levels) == 2
    damaged = [
        replace(packet, payload=bytes(9)) if packet.kind is PacketKind.PREVIEW else packet for packet in encoded.packets
    ]
    table, packet_bytes = packet_table(damaged)
    data = write_container(replace(encoded.header, packets=table), packet_bytes)
    assert_exact(decode(data), encoded)
    for level in levels:
        with pytest.raises(PacketError, match=f"level {level}, Preview packet"):
            decode(data, level)


def test_packets_that_do_not_belong_are_refused() -> None:
    encoded = encoded_grid()
    decoder = Decoder(encoded.header)
    base = encoded.packets[0]
    for packet in (
        replace(base, level=0),
        replace(base, slice=1),
        replace(base, level=60),
        Packet(PacketKind.DIFF, base.level, 0, b""),
        Packet(PacketKind.MAP_CONN, base.level, 0, b""),
        Packet(PacketKind.PREVIEW, 0, 0, b""),
    ):
        with pytest.raises(PacketError, match="no such packet"):
            decoder.push(packet)
    for packet in encoded.packets:
        decoder.push(packet)
        with pytest.raises(PacketError, match="came twice"):
            decoder.push(packet)
    assert_exact(decoder.mesh(0), encoded)


def test_an_error_names_level_and_packet() -> None:
    encoded = encoded_grid()
    decoder = Decoder(encoded.header)
    decoder.push(encoded.packets[0])
    bad = replace(encoded.packets[1], payload=b"\x05abc")
    with pytest.raises(PacketError, match=rf"level {bad.level}, Map&Conn packet, byte 4"):
        decoder.push(bad)
    assert decoder.finest == encoded.packets[0].level


def test_a_waiting_packet_that_turns_out_damaged_is_named() -> None:
    encoded = encoded_grid()
    decoder = Decoder(encoded.header)
    bad = replace(encoded.packets[1], payload=b"\x00")
    assert decoder.push(bad) == []
    with pytest.raises(PacketError, match=rf"level {bad.level}, "):
        decoder.push(encoded.packets[0])


def test_headers_that_make_no_sense_are_refused() -> None:
    header = encoded_grid().header
    with pytest.raises(ContainerError, match="not one state for each level"):
        Decoder(replace(header, levels=header.levels[1:]))
    finest = replace(header.levels[-1], vertices=1)
    with pytest.raises(ContainerError, match="fewer vertices"):
        Decoder(replace(header, levels=(*header.levels[:-1], finest)))
    with pytest.raises(LimitError, match="vertices"):
        Decoder(header, Limits(vertices=10))
    for level in (0, -1, 64):
        assert not Decoder(header).is_available(level)
        assert not Decoder(header).is_exact(level)
        with pytest.raises(KeyError, match="not available"):
            Decoder(header).mesh(level)


@given(st.data())
@settings(max_examples=80)
def test_hostile_payloads_with_right_framing_raise_from_the_tree_only(data: st.DataObject) -> None:
    check_with_one_damaged_packet(encoded_grid(10), data)


@pytest.mark.parametrize("profile", [ClassicOptions(bits=10, coarsest_vertices=40), CompactOptions(bits=10)], ids=repr)
@given(st.data())
@settings(max_examples=25)
def test_a_hostile_stream_takes_no_more_memory_than_the_limit(
    profile: ClassicOptions | CompactOptions, data: st.DataObject
) -> None:
    """The header claims as much as the limit allows, and the payloads are junk or belong to a smaller mesh."""
    encoded = encode(grid(20), profile)
    limits = Limits(memory=40_000_000)
    count = data.draw(st.integers(1, 30))
    rows = [replace(row, vertices=1000 * count, faces=400 * count) for row in encoded.header.levels]
    header = replace(encoded.header, levels=tuple(rows))
    tracemalloc.start()
    try:
        decoder = Decoder(header, limits)
        for packet in encoded.packets:
            junk = data.draw(st.one_of(st.none(), st.binary(max_size=50)))
            with suppress(PacketError, LimitError):
                decoder.push(packet if junk is None else replace(packet, payload=junk))
            if decoder.finest is not None:
                with suppress(PacketError):
                    decoder.mesh(decoder.finest)
        assert tracemalloc.get_traced_memory()[1] < limits.memory
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1.7e308])
def test_a_grid_that_reaches_beyond_numbers_is_refused(place: int, value: float) -> None:
    header = encode(grid(5), CompactOptions(bits=6)).header
    numbers = [*header.origin, header.extent]
    numbers[place] = value
    changed = replace(header, origin=(numbers[0], numbers[1], numbers[2]), extent=numbers[3])
    if place < 3 and value == 1.7e308:
        changed = replace(changed, extent=1.7e308)
    with pytest.raises(ContainerError):
        StreamHeader.from_bytes(changed.to_bytes())


@pytest.mark.parametrize(
    "options", [CompactOptions(bits=8), ClassicOptions(bits=8, coarsest_vertices=12)], ids=["compact", "classic"]
)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_a_hook_that_returns_what_is_not_finite_is_refused(
    options: CompactOptions | ClassicOptions, value: float
) -> None:
    encoded = encode(grid(9), options)

    def spoil(_level: int, _slice: int, differences: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.full(differences.shape, value)

    decoder = Decoder(encoded.header, perturb=spoil)
    with pytest.raises(PacketError, match="finite numbers"):
        for packet in encoded.packets:
            decoder.push(packet)


def test_a_hook_that_returns_huge_numbers_leaves_finite_positions() -> None:
    for options in (CompactOptions(bits=8), ClassicOptions(bits=8, coarsest_vertices=12)):
        encoded = encode(grid(9), options)
        decoder = Decoder(encoded.header, perturb=lambda _level, _slice, differences: differences + 1.7e308)
        for packet in encoded.packets:
            decoder.push(packet)
        for row in encoded.header.levels:
            assert np.isfinite(decoder.mesh(row.level).vertices).all()
