"""The reference decoder and the kernels' decoder give the same bits, for every level of every kind of stream."""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings

from golden_streams import VARIANTS, bowl, tangle
from meshes import random_meshes, tetrahedron
from meshtide_codec.compact import previews
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.encoder import encode
from meshtide_codec.errors import ContainerError, PacketError, StreamError
from meshtide_codec.mesh import Mesh
from meshtide_codec.reference import reference_decode, reference_permutation
from meshtide_codec.stream.container import read_container
from meshtide_codec.stream.header import version_of


def assert_same_levels(data: bytes) -> None:
    header, _ = read_container(data)
    for level in range(header.levels[0].level + 1):
        expected, found = decode(data, level), reference_decode(data, level)
        assert np.array_equal(found.vertices, expected.vertices), level
        assert np.array_equal(found.faces, expected.faces), level


@pytest.mark.parametrize("name", VARIANTS)
def test_every_level_of_the_golden_streams(name: str) -> None:
    assert_same_levels(VARIANTS[name]().to_bytes())


def test_the_variants_use_what_the_format_offers() -> None:
    headers = {name: make().header for name, make in VARIANTS.items() if name.startswith("compact")}
    assert {key for header in headers.values() for key in header.options} == {"b", "f", "d", "m", "s"}
    assert any(strength > 0 for header in headers.values() for strength in header.options["f"])


def test_previews(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(previews, "FEWEST_VERTICES", 100)
    encoded = encode(bowl(), CompactOptions(bits=8, previews=(16, 5)))
    assert len(encoded.header.options["p"]) > 0
    data = encoded.to_bytes()
    for state in encoded.header.levels:
        expected, found = decode(data, state.level), reference_decode(data, state.level)
        assert np.array_equal(found.vertices, expected.vertices)
        assert np.array_equal(found.faces, expected.faces)


@settings(max_examples=25)
@given(random_meshes(largest=30))
def test_random_meshes(mesh: Mesh) -> None:
    data = encode(mesh, CompactOptions(bits=6, slices=2)).to_bytes()
    expected, found = decode(data), reference_decode(data)
    assert np.array_equal(found.vertices, expected.vertices)
    assert np.array_equal(found.faces, expected.faces)


def test_the_order_of_the_input() -> None:
    encoded = encode(tangle(), CompactOptions(bits=8), store_permutation=True)
    data = encoded.to_bytes()
    assert reference_permutation(data) == encoded.quantized.permutation.tolist()
    assert reference_permutation(encode(tangle()).to_bytes()) is None
    assert np.array_equal(reference_decode(data).faces, decode(data).faces)


def test_a_level_that_is_not_there() -> None:
    data = encode(tetrahedron()).to_bytes()
    with pytest.raises(KeyError):
        reference_decode(data, 21)
    with pytest.raises(KeyError):
        reference_decode(data, -1)


def test_damage_is_noticed() -> None:
    data = VARIANTS["compact-scattered-1"]().to_bytes()
    for place in range(0, len(data), 7):
        damaged = bytearray(data)
        damaged[place] ^= 1
        with pytest.raises(StreamError):
            reference_decode(bytes(damaged))
    for foreign in (b"", data[:-1], data + b"\0"):
        with pytest.raises(StreamError):
            reference_decode(foreign)


def _changed(data: bytes, key: int, value: object) -> bytes:
    """The stream with another value in its header, and the checksum that belongs to it."""
    length = struct.unpack_from("<I", data, 10)[0]
    header = msgpack.unpackb(data[18 : 18 + length], strict_map_key=False)
    return _beginning(header | {key: value}) + data[18 + length :]


def _beginning(header: dict[int, object]) -> bytes:
    """Preamble and header."""
    packed = msgpack.packb(header)
    return struct.pack("<8sHII", b"\x89TIDE\r\n\x1a", version_of(packed), len(packed), zlib.crc32(packed)) + packed


def test_an_unknown_profile_is_refused() -> None:
    with pytest.raises(ContainerError, match="unknown profile 'other'"):
        reference_decode(_changed(encode(tetrahedron()).to_bytes(), 0, "other"))


def test_a_payload_that_goes_on_is_refused() -> None:
    encoded = encode(tetrahedron(), CompactOptions(bits=4))
    header = msgpack.unpackb(replace(encoded.header, version=1).to_bytes(), strict_map_key=False)
    payloads = list(encoded.packet_bytes)
    payloads[0] += bytes(5)
    header[6][3] += 5
    header[7] = b"".join(struct.pack("<I", zlib.crc32(payload)) for payload in payloads)
    with pytest.raises(PacketError):
        reference_decode(_beginning(header) + b"".join(payloads))
