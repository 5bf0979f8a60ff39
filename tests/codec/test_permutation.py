from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshes import random_meshes
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import encode
from meshtide_codec.errors import LimitError, MeshtideError, PacketError
from meshtide_codec.limits import Limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.permutation import in_input_order, permutation_packet, read_permutation
from meshtide_codec.stream.packets import Packet, PacketKind


@given(random_meshes(), st.sampled_from([None, ClassicOptions(bits=9)]))
@settings(max_examples=25)
def test_the_inputs_order_comes_back_through_either_profile(mesh: Mesh, options: ClassicOptions | None) -> None:
    encoded = encode(mesh, options, store_permutation=True)
    decoder = Decoder(encoded.header)
    assert decoder.permutation is None
    for packet in encoded.packets:
        decoder.push(packet)
    assert decoder.permutation is not None
    assert np.array_equal(decoder.permutation, encoded.quantized.permutation)
    restored = in_input_order(decoder.mesh(0), decoder.permutation)
    step = encoded.quantized.extent / (2**encoded.header.bits - 1)
    assert np.abs(restored.vertices - mesh.vertices).max() <= 0.5 * step * (1 + 1e-9) + 1e-9
    assert np.array_equal(restored.vertices[restored.faces], decoder.mesh(0).vertices[decoder.mesh(0).faces])


def test_an_input_in_stream_order_costs_almost_nothing() -> None:
    packet = permutation_packet(np.arange(10_000), 10_000)
    assert len(packet.payload) < 60
    assert np.array_equal(read_permutation(packet, 10_000, Limits()), np.arange(10_000))


@given(st.binary(max_size=60), st.integers(1, 100))
def test_any_bytes_are_indices_in_range_or_an_error(payload: bytes, vertices: int) -> None:
    try:
        table = read_permutation(Packet(PacketKind.PERMUTATION, 0, 0, payload), vertices, Limits(vertices=1000))
    except MeshtideError as error:
        assert isinstance(error, PacketError | LimitError)
        return
    assert table.size == 0 or (table.min() >= 0 and table.max() < vertices)


def test_a_second_permutation_is_refused() -> None:
    encoded = encode(Mesh.checked([[0, 0, 0], [1, 1, 1]], []), store_permutation=True)
    decoder = Decoder(encoded.header)
    decoder.push(encoded.packets[-1])
    with pytest.raises(PacketError, match="no such packet"):
        decoder.push(encoded.packets[-1])
