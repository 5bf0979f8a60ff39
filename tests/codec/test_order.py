"""The input's order: vertices and faces come back index for index, and any bytes are an order or an error."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import encode
from meshtide_codec.errors import LimitError, MeshtideError, PacketError
from meshtide_codec.limits import Limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.order import Order, in_input_order, order_packet, read_order
from meshtide_codec.packets import Packet, PacketKind
from meshtide_codec.quantize import quantize
from meshtide_codec.testing import grid, random_meshes, shapes


def check_restored(mesh: Mesh, options: CompactOptions | ClassicOptions) -> None:
    encoded = encode(mesh, options, store_order=True)
    decoder = Decoder(encoded.header)
    for packet in encoded.packets:
        assert decoder.order is None
        decoder.push(packet)
    assert decoder.order is not None
    assert np.array_equal(decoder.order.vertices, encoded.quantized.permutation)
    restored = in_input_order(decoder.mesh(0), decoder.order)
    assert np.array_equal(restored.faces, mesh.faces)
    step = encoded.quantized.extent / (2**encoded.header.bits - 1)
    assert np.abs(restored.vertices - mesh.vertices).max() <= 0.5 * step * (1 + 1e-9) + 1e-9


@given(random_meshes(), st.sampled_from([CompactOptions(), ClassicOptions(bits=9)]))
@settings(max_examples=25, deadline=None)
def test_the_inputs_order_comes_back_through_either_profile(
    mesh: Mesh, options: CompactOptions | ClassicOptions
) -> None:
    check_restored(mesh, options)


@pytest.mark.parametrize("name", shapes())
def test_degenerate_and_repeated_faces_and_welded_vertices_come_back(name: str) -> None:
    mesh = shapes()[name]()
    spoilt = np.concatenate(
        [mesh.faces, mesh.faces[::3][:, [1, 2, 0]], mesh.faces[:2, [0, 0, 1]], mesh.faces[:1, ::-1]]
    )
    check_restored(Mesh(mesh.vertices, spoilt), CompactOptions(bits=4))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_any_order_of_faces_corners_and_twins_comes_back_from_its_packet(seed: int) -> None:
    rng = np.random.default_rng(seed)
    patch = grid(6)
    copies = rng.permutation(np.repeat(np.arange(36), rng.integers(1, 4, 36)))  # the vertex that each twin repeats
    twins = [np.flatnonzero(copies == vertex) for vertex in range(36)]
    faces = np.array([[rng.choice(twins[vertex]) for vertex in face] for face in rng.permutation(patch.faces).tolist()])
    turn = rng.integers(0, 3, (len(faces), 1))
    mesh = Mesh(patch.vertices[copies], np.take_along_axis(faces, (turn + np.arange(3)) % 3, axis=1))
    quantized = quantize(mesh, 6)
    order = Order(quantized.permutation, mesh.faces)
    packet = order_packet(order, quantized.faces, len(quantized.positions))
    found = read_order(packet, quantized.faces, len(quantized.positions))
    assert np.array_equal(found.vertices, order.vertices)
    assert np.array_equal(found.faces, order.faces)


def test_an_input_in_stream_order_costs_almost_nothing() -> None:
    quantized = quantize(grid(100), 12)
    order = Order(np.arange(10_000), quantized.faces.astype(np.int64))
    packet = order_packet(order, quantized.faces, 10_000)
    assert len(packet.payload) < 60 + len(quantized.faces) // 8
    assert np.array_equal(read_order(packet, quantized.faces, 10_000).faces, quantized.faces)


def test_the_order_of_a_grid_costs_few_bits_a_face() -> None:
    mesh = grid(100)
    quantized = quantize(mesh, 12)
    vertices_only = order_packet(Order(quantized.permutation, np.zeros((0, 3), np.int64)), quantized.faces, 10_000)
    whole = order_packet(Order(quantized.permutation, mesh.faces), quantized.faces, 10_000)
    assert 8 * (len(whole.payload) - len(vertices_only.payload)) < 3 * len(mesh.faces)


def test_the_packet_may_come_before_the_levels() -> None:
    mesh = grid(5)
    encoded = encode(mesh, CompactOptions(bits=6), store_order=True)
    for packets in permutations(encoded.packets):
        decoder = Decoder(encoded.header)
        for packet in packets:
            decoder.push(packet)
        assert decoder.order is not None
        assert np.array_equal(decoder.order.faces, mesh.faces)


@given(st.binary(max_size=60), st.integers(0, 5))
def test_any_bytes_are_an_order_or_an_error(payload: bytes, faces: int) -> None:
    stream_faces = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2], [2, 4, 3], [0, 3, 1]], np.int32)[:faces]
    try:
        order = read_order(Packet(PacketKind.ORDER, 0, 0, payload), stream_faces, 6, Limits(vertices=1000, faces=1000))
    except MeshtideError as error:
        assert isinstance(error, PacketError | LimitError)
        return
    assert order.vertices.size == 0 or (order.vertices.min() >= 0 and order.vertices.max() < 6)
    assert order.faces.size == 0 or (order.faces.min() >= 0 and order.faces.max() < len(order.vertices))


def test_every_cut_and_every_flipped_bit_is_an_order_or_an_error() -> None:
    quantized = quantize(shapes()["soup"](), 4)
    order = Order(quantized.permutation, shapes()["soup"]().faces)
    payload = order_packet(order, quantized.faces, len(quantized.positions)).payload
    damaged = [payload[:length] for length in range(len(payload))]
    for bit in range(8 * len(payload)):
        changed = bytearray(payload)
        changed[bit // 8] ^= 1 << (bit % 8)
        damaged.append(bytes(changed))
    refused = 0
    for data in damaged:
        packet = Packet(PacketKind.ORDER, 0, 0, data)
        try:
            found = read_order(packet, quantized.faces, len(quantized.positions), Limits(vertices=5000, faces=5000))
        except PacketError as error:
            assert error.packet == "Order"
            refused += 1
        except LimitError:
            refused += 1
        else:
            assert found.faces.size == 0 or 0 <= found.faces.min() <= found.faces.max() < len(found.vertices)
    assert refused > len(damaged) // 4


def test_a_vertex_that_no_input_vertex_became_ends_in_an_error() -> None:
    faces = np.array([[0, 1, 2]], np.int32)
    packet = order_packet(Order(np.array([0, 1, 2]), np.array([[0, 1, 2]])), faces, 3)
    with pytest.raises(PacketError, match="names what is not there"):
        read_order(packet, np.array([[0, 1, 3]], np.int32), 4)


@pytest.mark.parametrize("counts", [b"\xff\xff\x7f\x00\x00", b"\x01\xff\xff\x7f\x00"])
def test_claims_beyond_the_limits_are_refused_before_memory_is_taken(counts: bytes) -> None:
    with pytest.raises(LimitError, match="the stream claims 2097151"):
        read_order(Packet(PacketKind.ORDER, 0, 0, counts), np.zeros((0, 3), np.int32), 1, Limits(vertices=9, faces=9))


def test_a_second_order_is_refused() -> None:
    encoded = encode(Mesh.checked([[0, 0, 0], [1, 1, 1]], []), store_order=True)
    decoder = Decoder(encoded.header)
    decoder.push(encoded.packets[-1])
    with pytest.raises(PacketError, match="came twice"):
        decoder.push(encoded.packets[-1])


def test_an_order_packet_has_to_be_announced() -> None:
    encoded = encode(grid(6), CompactOptions(bits=8), store_order=True)
    order = encoded.packets[-1]
    without = Decoder(encode(grid(6), CompactOptions(bits=8)).header)
    with pytest.raises(PacketError, match="no such packet"):
        without.push(order)
    for moved in (replace(order, level=7), replace(order, slice=3)):
        with pytest.raises(PacketError, match="no such packet"):
            Decoder(encoded.header).push(moved)


@pytest.mark.parametrize("payload", [b"", b"\xff" * 40])
def test_a_damaged_order_takes_no_level_away_and_may_come_again(payload: bytes) -> None:
    encoded = encode(grid(6), CompactOptions(bits=8), store_order=True)
    order = encoded.packets[-1]
    decoder, expected = Decoder(encoded.header), Decoder(encoded.header)
    decoder.push(replace(order, payload=payload))
    for packet in encoded.packets[:-1]:
        assert decoder.push(packet) == expected.push(packet)
    with pytest.raises(PacketError):
        _ = decoder.order
    with pytest.raises(PacketError):  # now it is read at once
        decoder.push(replace(order, payload=payload))
    decoder.push(order)
    assert decoder.order is not None
    assert np.array_equal(decoder.order.vertices, encoded.quantized.permutation)
