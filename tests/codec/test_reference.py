"""The reference decoder and the kernels' decoder give the same bits, for every level of every kind of stream."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from golden_streams import GOLDEN, VARIANTS, bowl, tangle
from meshes import random_meshes, tetrahedron
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact import previews
from meshtide_codec.compact.effort import Effort
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.errors import ContainerError, PacketError, StreamError
from meshtide_codec.mesh import Mesh
from meshtide_codec.reference import reference_decode, reference_order
from meshtide_codec.stream.container import PREAMBLE_BYTES, read_container, write_container
from meshtide_codec.stream.header import FORMAT_VERSION
from meshtide_codec.stream.packets import PacketKind

LARGE = {"compact-bowl-high", "compact-dome-high", "compact-dome-previews", "compact-twins-high"}
"""In plain Python each level of these takes seconds, since it begins anew with the coarsest."""


def assert_same_levels(data: bytes, *, all_levels: bool) -> None:
    """Hold the previews and all levels, or the coarsest and the finest, against the kernels' decoder."""
    header, _ = read_container(data)
    coarsest = next(entry.level for entry in header.packets if entry.kind is PacketKind.BASE)
    for level in range(header.levels[0].level + 1):
        if 0 < level < coarsest and not all_levels:
            continue
        expected, found = decode(data, level), reference_decode(data, level)
        assert np.array_equal(found.vertices, expected.vertices), level
        assert np.array_equal(found.faces, expected.faces), level


@pytest.mark.parametrize("name", VARIANTS)
def test_levels_of_the_golden_streams(name: str) -> None:
    assert_same_levels((GOLDEN / f"{name}.tide").read_bytes(), all_levels=name not in LARGE)


def test_the_variants_use_what_the_format_offers() -> None:
    headers = [read_container(path.read_bytes())[0] for path in GOLDEN.glob("compact-*.tide")]
    assert {key for header in headers for key in header.options} == {"e", "f", "m", "s"}
    assert {entry.kind for header in headers for entry in header.packets} == set(PacketKind) - {PacketKind.PARAM}


def test_previews(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(previews, "FEWEST_VERTICES", 100)
    encoded = encode(bowl(), CompactOptions(bits=8, previews=(16, 5)))
    assert encoded.packets[0].kind is PacketKind.PREVIEW
    data = encoded.to_bytes()
    for state in encoded.header.levels:
        expected, found = decode(data, state.level), reference_decode(data, state.level)
        assert np.array_equal(found.vertices, expected.vertices)
        assert np.array_equal(found.faces, expected.faces)


@settings(max_examples=15)
@given(random_meshes(largest=30))
@pytest.mark.parametrize("effort", Effort)
def test_random_meshes(effort: Effort, mesh: Mesh) -> None:
    data = encode(mesh, CompactOptions(bits=6, slices=2, effort=effort)).to_bytes()
    expected, found = decode(data), reference_decode(data)
    assert np.array_equal(found.vertices, expected.vertices)
    assert np.array_equal(found.faces, expected.faces)


def test_the_order_of_the_input() -> None:
    mesh = tangle()
    encoded = encode(mesh, CompactOptions(bits=8), store_order=True)
    data = encoded.to_bytes()
    found = reference_order(data)
    assert found is not None
    assert found[0] == encoded.quantized.permutation.tolist()
    assert [list(face) for face in found[1]] == mesh.faces.tolist()
    assert reference_order(encode(mesh).to_bytes()) is None
    assert np.array_equal(reference_decode(data).faces, decode(data).faces)


def test_a_level_that_is_not_there() -> None:
    data = encode(tetrahedron()).to_bytes()
    with pytest.raises(KeyError):
        reference_decode(data, 21)
    with pytest.raises(KeyError):
        reference_decode(data, -1)


def test_damage_is_noticed() -> None:
    data = (GOLDEN / "compact-scattered-1.tide").read_bytes()
    for place in range(0, len(data), 7):
        damaged = bytearray(data)
        damaged[place] ^= 1
        with pytest.raises(StreamError):
            reference_decode(bytes(damaged))
    for foreign in (b"", data[:-1], data + b"\0"):
        with pytest.raises(StreamError):
            reference_decode(foreign)


def _with_header(encoded: EncodedMesh, **changes: object) -> bytes:
    """The stream with other values in its header, and the checksum that belongs to it."""
    return write_container(replace(encoded.header, **changes), encoded.packet_bytes)  # type: ignore[arg-type]


def test_an_unknown_profile_is_refused() -> None:
    with pytest.raises(ContainerError, match="unknown profile 'other'"):
        reference_decode(_with_header(encode(tetrahedron()), profile="other"))


def test_a_payload_that_goes_on_is_refused() -> None:
    header, packets = read_container((GOLDEN / "compact-scattered-1.tide").read_bytes())
    payloads = [packet.payload for packet in packets]
    payloads[0] += bytes(5)
    entry = replace(header.packets[0], length=len(payloads[0]), checksum=zlib.crc32(payloads[0]))
    longer = replace(header, packets=(entry, *header.packets[1:]))
    with pytest.raises(PacketError):
        reference_decode(write_container(longer, payloads))


@pytest.mark.parametrize("version", [2, 4])
def test_another_format_version_is_refused(version: int) -> None:
    data = encode(tetrahedron()).to_bytes()
    header = read_container(data)[0].to_bytes()
    assert data[PREAMBLE_BYTES] == FORMAT_VERSION
    other = bytes([version]) + header[1:]
    packets = data[PREAMBLE_BYTES + len(header) :]
    for wrong in (
        data[:8] + bytes([version]) + data[9:],
        data[:14] + zlib.crc32(other).to_bytes(4, "little") + other + packets,
    ):
        with pytest.raises(ContainerError, match="not a (stream|header) of format version 3"):
            reference_decode(wrong)


@pytest.mark.parametrize(
    "options", [CompactOptions(bits=10, effort=effort) for effort in Effort] + [ClassicOptions(bits=10)]
)
def test_a_hub_of_more_faces_than_a_gate_looks_at(options: CompactOptions | ClassicOptions) -> None:
    count = 150
    rng = np.random.default_rng(5)
    rim = np.stack([np.cos(np.arange(count) / 24), np.sin(np.arange(count) / 24), rng.random(count)], axis=1)
    faces = [[0, 1 + i, 1 + (i + 1) % count] for i in range(count)] + [
        [0, 1 + i, 1 + (7 * i) % count] for i in range(30)
    ]
    data = encode(Mesh.checked(np.concatenate([[[0.0, 0, 0]], rim]), faces), options).to_bytes()
    expected, found = decode(data), reference_decode(data)
    assert np.array_equal(found.vertices, expected.vertices)
    assert np.array_equal(found.faces, expected.faces)
