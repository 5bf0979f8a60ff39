"""Limits: sizes, memory, and how much a few bytes may claim; streams that were made to take a decoder's memory."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import pytest

from meshes import grid
from meshtide_codec.compact.effort import Effort
from meshtide_codec.compact.encoder import CompactEncoding
from meshtide_codec.compact.models import Models
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.compact.slices import Slices
from meshtide_codec.decoder import Decoder, decode
from meshtide_codec.encoder import encode
from meshtide_codec.errors import ContainerError, LimitError, OptionError
from meshtide_codec.limits import Limits, wanted_limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.stream.container import read_container, write_container
from meshtide_codec.stream.header import StreamHeader
from meshtide_codec.stream.packets import PacketKind
from meshtide_codec.stream.parts import write_number


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
    with pytest.raises(LimitError, match="level 0: the stream claims 4194304 vertices by .* --max-vertices"):
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
    payload = write_number(1 << 22) + encoded.packets[-1].payload[1:]
    packets = [*encoded.packets[:-1], replace(encoded.packets[-1], payload=payload)]
    decoder = Decoder(encoded.header)
    with pytest.raises(LimitError, match="claims 4194304 vertices by"):
        for packet in packets:
            decoder.push(packet)


def test_more_slices_than_vertices_can_begin_are_refused() -> None:
    encoded = encode(grid(9), CompactOptions(bits=8, previews=(), slices=2))
    starts = {"s": list(range(4096))}
    header = replace(encoded.header, options=dict(encoded.header.options) | starts)
    with pytest.raises(ContainerError, match="4096 slices, more than 82"):
        Decoder(header)


def test_thousands_of_empty_slices_share_what_they_start_from(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CompactEncoding, "_slices", lambda self, _: Slices(self._bits, tuple(range(4096))))
    encoded = encode(flat_square(65), CompactOptions(bits=8, previews=()))
    decode(encoded.to_bytes())  # what is loaded once does not count
    copies = 0
    copy = Models.copy

    def counted(models: Models) -> Models:
        nonlocal copies
        copies += 1
        return copy(models)

    monkeypatch.setattr(Models, "copy", counted)
    tracemalloc.start()
    decoder = Decoder(encoded.header)
    for packet in encoded.packets:
        decoder.push(packet)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert copies < 200
    assert peak < 20e6
    assert decoder.is_exact(0)
