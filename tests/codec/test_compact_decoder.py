from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import Decoder, decode
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import DISTANCE_SAMPLES, DISTANCE_VERTICES, EncodedMesh, encode
from meshtide_codec.errors import ContainerError, LimitError, PacketError
from meshtide_codec.limits import Limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.packets import Packet, PacketKind
from meshtide_codec.stream.container import read_available
from meshtide_codec.testing import grid, random_meshes, shapes
from streams import check_with_one_damaged_packet, leaf_depths, slice_of


@cache
def encoded_patch(slices: int = 1, effort: Effort = Effort.DEFAULT) -> EncodedMesh:
    """A mesh with several levels beyond its base and several Diffs."""
    return encode(grid(30), CompactOptions(bits=10, slices=slices, previews=(), effort=effort))


def assert_exact(decoded: Mesh, encoded: EncodedMesh) -> None:
    expected = encoded.quantized.mesh()
    assert np.array_equal(decoded.vertices, expected.vertices)
    assert np.array_equal(decoded.faces, expected.faces)


def decoder_of(encoded: EncodedMesh, without: set[int] | None = None) -> Decoder:
    decoder = Decoder(encoded.header)
    for index, packet in enumerate(encoded.packets):
        if index not in (without or set()):
            decoder.push(packet)
    return decoder


@pytest.mark.parametrize("name", shapes())
@pytest.mark.parametrize(("slices", "effort"), [(1, Effort.DEFAULT), (3, Effort.DEFAULT), (2, Effort.HIGH)])
def test_every_shape_survives(name: str, slices: int, effort: Effort) -> None:
    encoded = encode(shapes()[name](), CompactOptions(bits=7, slices=slices, effort=effort))
    assert_exact(decode(encoded.to_bytes()), encoded)


@given(random_meshes(), st.integers(4, 16), st.sampled_from([1, 2, 7]), st.sampled_from(Effort))
@settings(max_examples=60)
def test_random_meshes_survive(mesh: Mesh, bits: int, slices: int, effort: Effort) -> None:
    encoded = encode(mesh, CompactOptions(bits=bits, slices=slices, effort=effort))
    assert_exact(decode(encoded.to_bytes()), encoded)


@pytest.mark.parametrize("effort", Effort)
def test_encoding_is_deterministic(effort: Effort) -> None:
    options = CompactOptions(bits=10, slices=2, effort=effort)
    assert encode(grid(30), options).to_bytes() == encode(grid(30), options).to_bytes()


def test_a_mirror_plane_is_used_and_carried() -> None:
    half = grid(30)
    image = half.vertices * [-1, 1, 1] - [1, 0, 0]
    mesh = Mesh.checked(
        np.concatenate([half.vertices, image]), np.concatenate([half.faces, half.faces[:, ::-1] + len(half.vertices)])
    )
    encoded = encode(mesh, CompactOptions(bits=10))
    assert encoded.header.options.mirror is not None
    assert_exact(decode(encoded.to_bytes()), encoded)
    plain = encode(mesh, CompactOptions(bits=10, mirror=False))
    assert plain.header.options.mirror is None
    assert_exact(decode(plain.to_bytes()), plain)
    assert len(encoded.to_bytes()) < 0.9 * len(plain.to_bytes())


def test_effort_high_is_smaller_and_told_in_the_header() -> None:
    default, high = encoded_patch(), encoded_patch(effort=Effort.HIGH)
    assert (default.header.options.effort, high.header.options.effort) == (Effort.DEFAULT, Effort.HIGH)
    assert len(high.to_bytes()) < len(default.to_bytes())


@pytest.mark.parametrize("effort", Effort)
def test_a_stream_cut_after_any_packet_is_a_drawable_mesh(effort: Effort) -> None:
    encoded = encoded_patch(effort=effort)
    decoder = Decoder(encoded.header)
    for count, packet in enumerate(encoded.packets, 1):
        decoder.push(packet)
        best = decoder.best
        assert best is not None
        mesh = decoder.mesh(best)
        assert np.isfinite(mesh.vertices).all()
        assert mesh.faces.max() < len(mesh.vertices)
        for row in encoded.header.levels:
            if row.packet_count <= count:
                assert decoder.is_exact(row.level)
                drawn = decoder.mesh(row.level)
                assert (len(drawn.vertices), len(drawn.faces)) == (row.vertices, row.faces)
    assert_exact(decoder.mesh(0), encoded)


def test_what_the_encoder_measured_is_what_the_decoder_draws() -> None:
    encoded = encoded_patch(slices=2)
    decoder = Decoder(encoded.header)
    rows = {row.packet_count: row for row in encoded.header.levels}
    from meshtide_codec.distortion import DistortionMeter
    from meshtide_codec.stream.distances import stored_distances

    exact = encoded.quantized
    meter = DistortionMeter(
        exact.positions.astype(float), exact.faces, samples=DISTANCE_SAMPLES, vertex_limit=DISTANCE_VERTICES
    )
    for count, packet in enumerate(encoded.packets, 1):
        decoder.push(packet)
        if count in rows and rows[count].rms > 0:
            row = rows[count]
            measured = meter.measure(decoder.drawn_positions(row.level), decoder.mesh(row.level).faces)
            assert stored_distances(measured.rms, measured.maximum) == (row.rms, row.maximum)


def cells_of(encoded: EncodedMesh, decoder: Decoder) -> None:
    """Every vertex of level 0 lies within the leaf cell that Maps alone tell."""
    side = 1 << (encoded.header.bits - leaf_depths(encoded))[:, None]
    low = encoded.quantized.positions // side * side - 0.5
    drawn = decoder.drawn_positions(0)
    assert (drawn >= low - 1e-9).all()
    assert (drawn <= low + side + 1e-9).all()


@pytest.mark.parametrize("effort", Effort)
def test_every_diff_removed_leaves_connectivity_exact_and_vertices_in_their_cells(effort: Effort) -> None:
    encoded = encoded_patch(slices=3, effort=effort)
    whole = decoder_of(encoded)
    diffs = {i for i, packet in enumerate(encoded.packets) if packet.kind is PacketKind.DIFF}
    assert len(diffs) > 3
    bare = decoder_of(encoded, without=diffs)
    for row in encoded.header.levels:
        assert np.array_equal(bare.mesh(row.level).faces, whole.mesh(row.level).faces)
    assert not bare.is_exact(0)
    cells_of(encoded, bare)


@pytest.mark.parametrize("effort", Effort)
def test_a_decoder_that_keeps_the_finest_level_only_has_no_other_in_the_end(effort: Effort) -> None:
    encoded = encoded_patch(slices=3, effort=effort)
    decoder = Decoder(encoded.header, only_finest=True)
    for packet in encoded.packets:
        decoder.push(packet)
        finest = decoder.finest
        assert finest is not None
        assert len(decoder.mesh(finest).vertices) == next(
            row.vertices for row in encoded.header.levels if row.level == finest
        )
    coarser = [row.level for row in encoded.header.levels if row.vertices < encoded.header.vertices]
    assert len(coarser) > 1
    assert not any(decoder.is_available(level) for level in coarser)
    with pytest.raises(KeyError, match="is not available"):
        decoder.mesh(encoded.header.levels[0].level)
    assert_exact(decoder.mesh(0), encoded)


def test_a_damaged_preview_is_not_there() -> None:
    header, packets, _ = read_available((Path(__file__).parents[1] / "golden/compact-dome-previews.tide").read_bytes())
    preview = next(packet for packet in packets if packet.kind is PacketKind.PREVIEW)
    refusals = Counter[str]()
    for first in range(8 * len(preview.payload)):
        for second in range(first, min(first + 12, 8 * len(preview.payload))):
            payload = bytearray(preview.payload)
            for bit in {first, second}:
                payload[bit // 8] ^= 1 << bit % 8
            decoder = Decoder(header)
            try:
                decoder.push(replace(preview, payload=bytes(payload)))
            except PacketError as error:
                refusals[str(error).rpartition(": ")[2]] += 1
                assert not decoder.is_available(preview.level)
    assert refusals["a face is there twice"] > 0  # which is found last
    assert refusals.total() > 1000


@given(st.sets(st.integers(0, 40)), st.sampled_from(Effort))
@settings(max_examples=40)
def test_vertices_whose_diffs_are_all_there_are_exact(missing: set[int], effort: Effort) -> None:
    encoded = encoded_patch(slices=4, effort=effort)
    lost = {i for i in missing if i < len(encoded.packets) and encoded.packets[i].kind is PacketKind.DIFF}
    decoder = decoder_of(encoded, without=lost)
    expected = encoded.quantized.mesh()
    mesh = decoder.mesh(0)
    assert np.array_equal(mesh.faces, expected.faces)
    cells_of(encoded, decoder)
    for index in range(len(encoded.header.options.slices)):
        part = slice_of(encoded, index)
        assert part.any()
        if not any(encoded.packets[i].slice == index for i in lost):
            assert np.array_equal(mesh.vertices[part], expected.vertices[part])
    if not lost:
        assert_exact(mesh, encoded)


@given(st.randoms(use_true_random=False), st.sampled_from(Effort))
@settings(max_examples=25)
def test_the_same_mesh_comes_out_in_any_order_of_arrival(random: object, effort: Effort) -> None:
    encoded = encoded_patch(slices=2, effort=effort)
    packets = list(encoded.packets)
    random.shuffle(packets)  # type: ignore[attr-defined]
    decoder = Decoder(encoded.header)
    seen: set[int] = set()
    for packet in packets:
        for update in decoder.push(packet):
            seen.add(update.level)
            decoder.mesh(update.level)
    assert decoder.is_exact(0)
    assert set(range(encoded.header.levels[0].level + 1)) == seen
    assert_exact(decoder.mesh(0), encoded)


def test_packets_that_do_not_belong_are_refused() -> None:
    encoded = encoded_patch()
    base = encoded.packets[0]
    decoder = Decoder(encoded.header)
    for packet in (
        replace(base, level=0),
        replace(base, slice=1),
        Packet(PacketKind.MAP_CONN, base.level, 0, b""),
        Packet(PacketKind.MAP_CONN, 60, 0, b""),
        Packet(PacketKind.DIFF, 60, 0, b""),
        Packet(PacketKind.DIFF, 0, 1, b""),
        Packet(PacketKind.PARAM, 0, 0, b""),
        Packet(PacketKind.PREVIEW, 0, 0, b""),
        Packet(PacketKind.PREVIEW, base.level + 1, 0, b""),
    ):
        with pytest.raises(PacketError, match="no such packet"):
            decoder.push(packet)
    for packet in encoded.packets:
        decoder.push(packet)
        with pytest.raises(PacketError, match="came twice"):
            decoder.push(packet)
    assert_exact(decoder.mesh(0), encoded)


def test_headers_that_make_no_sense_are_refused() -> None:
    header = encoded_patch().header
    with pytest.raises(ContainerError, match="the table of states lacks a level"):
        Decoder(replace(header, levels=(header.levels[0], header.levels[-1])))
    with pytest.raises(LimitError, match="vertices"):
        Decoder(header, Limits(vertices=10))


@given(st.data(), st.sampled_from(Effort))
@settings(max_examples=120)
def test_hostile_payloads_with_right_framing_raise_from_the_tree_only(data: st.DataObject, effort: Effort) -> None:
    check_with_one_damaged_packet(encoded_patch(slices=2, effort=effort), data)


@pytest.mark.parametrize("kind", [PacketKind.BASE, PacketKind.MAP_CONN, PacketKind.DIFF])
def test_a_payload_of_effort_high_cut_at_every_byte_is_a_mesh_or_an_error(kind: PacketKind) -> None:
    encoded = encoded_patch(effort=Effort.HIGH)
    packets = encoded.packets
    victim = min((i for i, packet in enumerate(packets) if packet.kind is kind), key=lambda i: len(packets[i].payload))
    for length in range(len(packets[victim].payload)):
        decoder = Decoder(encoded.header)
        try:
            for index, packet in enumerate(packets):
                shorter = replace(packet, payload=packet.payload[:length])
                decoder.push(shorter if index == victim else packet)
            assert decoder.finest is not None
            mesh = decoder.mesh(decoder.finest)
        except (PacketError, LimitError):
            continue
        assert np.isfinite(mesh.vertices).all()


@pytest.mark.parametrize("effort", Effort)
def test_a_map_that_claims_more_children_than_the_header_has_vertices_stops(effort: Effort) -> None:
    encoded = encoded_patch(effort=effort)
    smaller = [replace(row, vertices=min(row.vertices, 500)) for row in encoded.header.levels]
    decoder = Decoder(replace(encoded.header, levels=tuple(smaller)))
    with pytest.raises(PacketError, match=r"level \d, Map&Conn packet, byte \d+: more cells than vertices"):
        for packet in encoded.packets:
            decoder.push(packet)
