"""Streams written by earlier programs must decode to the same meshes, and be written again byte for byte.

Those of the newest format version are what the encoder writes today; it does not write older versions, whose streams
are still read and passed on as they are.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golden_streams import GOLDEN_VARIANTS, VARIANTS, WRITTEN_AGAIN
from meshtide_codec.decoder import Decoder, decode
from meshtide_codec.errors import StreamError
from meshtide_codec.reference import reference_decode
from meshtide_codec.stream.container import read_available, read_container, write_container
from meshtide_codec.stream.header import FORMAT_VERSION

GOLDEN = Path(__file__).parent.parent / "golden"
FILES = [(version, name) for version, names in GOLDEN_VARIANTS.items() for name in names]


@pytest.mark.parametrize("version", GOLDEN_VARIANTS)
def test_every_golden_file_is_known_and_every_variant_has_one(version: int) -> None:
    assert {path.stem for path in (GOLDEN / f"version-{version}").glob("*.tide")} == set(GOLDEN_VARIANTS[version])


@pytest.mark.parametrize(("version", "name"), FILES)
def test_a_golden_stream_decodes_to_its_mesh(version: int, name: str) -> None:
    expected = VARIANTS[name]().quantized.mesh()
    decoded = decode(golden(version, name))
    assert np.array_equal(decoded.vertices, expected.vertices)
    assert np.array_equal(decoded.faces, expected.faces)


@pytest.mark.parametrize("name", WRITTEN_AGAIN)
def test_the_encoder_writes_the_golden_bytes_again(name: str) -> None:
    assert VARIANTS[name]().to_bytes() == golden(FORMAT_VERSION, name)


@pytest.mark.parametrize(("version", "name"), FILES)
def test_a_golden_stream_that_was_read_is_written_again_byte_for_byte(version: int, name: str) -> None:
    header, packets = read_container(golden(version, name))
    assert header.version == version
    assert write_container(header, [packet.payload for packet in packets]) == golden(version, name)


@pytest.mark.parametrize(("version", "name"), [file for file in FILES if file[0] < FORMAT_VERSION])
def test_the_reference_decoder_reads_older_versions(version: int, name: str) -> None:
    data = golden(version, name)
    header, _ = read_container(data)
    for level in {0, header.levels[0].level}:
        expected, found = decode(data, level), reference_decode(data, level)
        assert np.array_equal(found.vertices, expected.vertices)
        assert np.array_equal(found.faces, expected.faces)


def golden(version: int, name: str) -> bytes:
    return (GOLDEN / f"version-{version}" / f"{name}.tide").read_bytes()


def test_a_golden_stream_cut_at_every_byte_still_shows_its_whole_levels() -> None:
    data = golden(FORMAT_VERSION, "classic-bowl-power")
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
    data = golden(FORMAT_VERSION, "classic-tangle-power")
    for bit in range(8 * len(data)):
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << (bit % 8)
        with pytest.raises(StreamError):
            read_container(damaged)
