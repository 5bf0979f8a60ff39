"""Golden streams decode to their meshes, and are written again byte for byte; damage of them is noticed.

That the encoder writes them again is tested with the command that does (`tests/tools/test_make_golden.py`).
"""

from __future__ import annotations

import numpy as np
import pytest

from golden_streams import GOLDEN, VARIANTS
from meshtide_codec.decoder import Decoder, decode
from meshtide_codec.errors import StreamError
from meshtide_codec.stream.container import read_available, read_container, write_container


def golden(name: str) -> bytes:
    return (GOLDEN / f"{name}.tide").read_bytes()


def test_every_golden_file_is_known_and_every_variant_has_one() -> None:
    assert {path.stem for path in GOLDEN.iterdir()} == set(VARIANTS)


@pytest.mark.parametrize("name", VARIANTS)
def test_a_golden_stream_decodes_to_its_mesh(name: str) -> None:
    expected = VARIANTS[name].mesh()
    decoded = decode(golden(name))
    assert np.array_equal(decoded.vertices, expected.vertices)
    assert np.array_equal(decoded.faces, expected.faces)


@pytest.mark.parametrize("name", VARIANTS)
def test_a_golden_stream_that_was_read_is_written_again_byte_for_byte(name: str) -> None:
    header, packets = read_container(golden(name))
    assert write_container(header, [packet.payload for packet in packets]) == golden(name)


def test_a_golden_stream_cut_at_every_byte_still_shows_its_whole_levels() -> None:
    data = golden("classic-bowl-power")
    header, _ = read_container(data)
    start = len(data) - int(header.packet_offsets[-1])
    for length in range(start, len(data)):
        cut_header, packets, problem = read_available(data[:length])
        assert problem is not None
        decoder = Decoder(cut_header)
        for packet in packets:
            decoder.push(packet)
        whole = [row.level for row in header.levels if start + header.level_bytes(row) <= length]
        assert all(decoder.is_exact(level) for level in whole)
        assert (decoder.finest is None) == (not packets)


def test_every_flipped_bit_of_a_golden_stream_is_noticed() -> None:
    data = golden("classic-tangle-power")
    for bit in range(8 * len(data)):
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << (bit % 8)
        with pytest.raises(StreamError):
            read_container(damaged)
