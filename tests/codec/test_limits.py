"""Limits: sizes, memory, and how much a few bytes may claim; streams that were made to take a decoder's memory."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import pytest

from meshtide_codec.compact import encoder as compact_encoder
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import Decoder, decode
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.errors import ContainerError, LimitError, OptionError
from meshtide_codec.limits import Limits, wanted_limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.packets import PacketKind
from meshtide_codec.stream.container import read_container, write_container
from meshtide_codec.stream.header import StreamHeader
from meshtide_codec.testing import grid


def test_a_mesh_within_the_limits_passes_and_one_over_them_does_not() -> None:
    limits = Limits(vertices=100, faces=200)
    limits.check_mesh(100, 200)
    with pytest.raises(LimitError, match="claims 101 vertices"):
        limits.check_mesh(101, 0)
    with pytest.raises(LimitError, match="level 3: the stream claims 201 faces"):
        limits.check_mesh(1, 201, level=3)


def test_memory_is_a_limit_of_its_own() -> None:
    with pytest.raises(LimitError, match="decoding would take about"):
        Limits(memory=1000).check_mesh(100, 0)


def test_limits_must_be_positive() -> None:
    with pytest.raises(OptionError, match="Limits.packets"):
        Limits(packets=0)


def flat_square(side: int) -> Mesh:
    """The most regular mesh there is, whose stream has the most vertices a byte."""
    return Mesh(grid(side).vertices * [1, 1, 0], grid(side).faces)


def claiming(vertices: int) -> bytes:
    """A small valid file whose header says that its last level has so many vertices."""
    encoded = encode(grid(9), CompactOptions(bits=8, previews=()))
    last = replace(encoded.header.levels[-1], vertices=vertices)
    header = replace(encoded.header, levels=(*encoded.header.levels[:-1], last))
    return write_container(header, encoded.packet_bytes)


def test_few_bytes_that_claim_millions_are_refused_before_anything_is_made_of_them() -> None:
    data = claiming(1 << 22)
    assert len(data) < 319
    tracemalloc.start()
    with pytest.raises(LimitError, match="the stream claims 4194304 vertices by .* --max-vertices"):
        read_container(data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1 << 20
    header, _ = read_container(data, wanted_limits(1 << 23, None))
    assert header.vertices == 1 << 22


def test_diffs_and_packets_of_finer_levels_do_not_count_as_bytes_of_a_level() -> None:
    encoded = encode(grid(9), CompactOptions(bits=8, previews=()))
    row = replace(encoded.header.levels[-1], vertices=1 << 22)
    packets = tuple(
        replace(packet, length=1 << 29) if packet.kind is PacketKind.DIFF else packet
        for packet in encoded.header.packets
    )
    lying = replace(encoded.header, levels=(row,), packets=packets)
    with pytest.raises(LimitError, match="claims 4194304 vertices"):
        StreamHeader.from_bytes(lying.to_bytes())


@pytest.mark.parametrize("effort", Effort)
def test_the_most_regular_meshes_pass_with_a_wide_margin(effort: Effort) -> None:
    encoded = encode(flat_square(128), CompactOptions(bits=7, previews=(), effort=effort))
    used = len(encoded.header.to_bytes()) + encoded.header.size_bytes
    assert 8 * encoded.header.vertices < used * Limits().vertices_per_byte
    assert 8 * encoded.header.faces < used * Limits().faces_per_byte
    decode(encoded.to_bytes())


def test_an_order_that_claims_millions_is_refused() -> None:
    encoded = encode(grid(9), CompactOptions(bits=8, previews=()), store_order=True)
    payload = b"\x80\x80\x80\x02" + encoded.packets[-1].payload[1:]  # 2^22, in digits of seven bits
    packets = [*encoded.packets[:-1], replace(encoded.packets[-1], payload=payload)]
    decoder = Decoder(encoded.header)
    with pytest.raises(LimitError, match="claims 4194304 vertices by"):
        for packet in packets:
            decoder.push(packet)


def test_more_slices_than_vertices_can_begin_are_refused() -> None:
    encoded = encode(grid(9), CompactOptions(bits=8, previews=(), slices=2))
    header = replace(encoded.header, options=replace(encoded.header.options, slices=tuple(range(4096))))
    with pytest.raises(ContainerError, match="more slices than there can be"):
        Decoder(header)


def test_thousands_of_empty_slices_take_no_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compact_encoder, "even_slices", lambda _positions, _count: tuple(range(4096)))
    encoded = encode(flat_square(65), CompactOptions(bits=8, previews=()))
    decoder = Decoder(encoded.header, Limits(memory=20_000_000))
    for packet in encoded.packets:
        decoder.push(packet)
    assert decoder.is_exact(0)


def test_memory_is_counted_while_it_is_taken() -> None:
    encoded = encode(grid(60), CompactOptions(bits=12, previews=()))
    row = max(640 * row.vertices + 256 * row.faces for row in encoded.header.levels)
    decoder = Decoder(replace(encoded.header), Limits(memory=row))
    decoder.push(encoded.packets[0])
    with pytest.raises(LimitError, match="more memory than the limits allow"):
        Decoder(encode(grid(3), CompactOptions(bits=8)).header, Limits(memory=640 * 9 + 256 * 8))
