"""The reference decoder and the core give the same bits, for every level of every kind of stream."""

from __future__ import annotations

import re
import zlib
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from golden_streams import GOLDEN, VARIANTS, tangle
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactHeader, CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.errors import ContainerError, PacketError, StreamError, VersionError
from meshtide_codec.mesh import Mesh
from meshtide_codec.packets import PacketKind
from meshtide_codec.reference import candidates, diff, reference_decode, reference_order
from meshtide_codec.reference import map as maps
from meshtide_codec.reference.header import VERSION
from meshtide_codec.stream.container import PREAMBLE_BYTES, read_container, write_container
from meshtide_codec.testing import grid, tetrahedron
from random_streams import (
    GridMesh,
    check_agreement,
    classic_stream,
    compact_stream,
    random_mesh,
    welded,
    without_some_diffs,
)

FEW_PACKETS = {
    "compact-dome-previews": 4,
    "compact-bowl-high": 2,
    "compact-dome-high": 2,
    "compact-tangle-high-slices": 2,
}
"""Of these golden streams the first packets are enough: all of them, and compact-twins-high, take many seconds in plain
Python; tests/bench/reference_agrees.py decodes them whole."""
DOCUMENT = (Path(__file__).parents[2] / "docs" / "format.md").read_text()
LAYERS = {
    "Map, default": (maps.DEFAULT_SHAPE, len(maps.DEFAULT_NEURONS[0])),
    "Map, high": (maps.HIGH_SHAPE, len(maps.HIGH_NEURONS[0])),
    "connectivity, default": (candidates.DEFAULT_SHAPE, 3),
    "connectivity, high": (candidates.HIGH_SHAPE, 4),
    "connectivity without positions": (candidates.PLAIN_SHAPE, 3),
    "Diff, default": (diff.DEFAULT_SHAPE, diff.DEFAULT_NEURONS),
    "Diff, high": (diff.HIGH_SHAPE, len(diff.NEURON_SIZES)),
}


@pytest.mark.parametrize("name", sorted(set(VARIANTS) - {"compact-twins-high"}))
def test_levels_of_the_golden_streams(name: str) -> None:
    header, packets = read_container((GOLDEN / f"{name}.tide").read_bytes())
    told = [packet for packet in packets if packet.kind is not PacketKind.ORDER]
    assert check_agreement(header, told[: FEW_PACKETS.get(name)]) > 0


def test_the_golden_streams_use_what_the_format_offers() -> None:
    headers = [read_container(path.read_bytes())[0] for path in GOLDEN.glob("*.tide")]
    compact = [header.options for header in headers if isinstance(header.options, CompactHeader)]
    assert {options.effort for options in compact} == set(Effort)
    assert {options.mirror is None for options in compact} == {True, False}
    assert max(len(options.slices) for options in compact) > 1
    assert any(any(options.strengths) for options in compact)
    assert {entry.kind for header in headers for entry in header.packets} == set(PacketKind)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("effort", Effort)
def test_random_compact_streams(effort: Effort, seed: int) -> None:
    rng = np.random.default_rng(seed)
    header, packets = compact_stream(rng, random_mesh(rng, 40), effort)
    check_agreement(header, packets)
    check_agreement(header, without_some_diffs(rng, packets))


@pytest.mark.parametrize("seed", range(20))
def test_random_classic_streams(seed: int) -> None:
    rng = np.random.default_rng(seed)
    header, packets = classic_stream(rng, random_mesh(rng, 60))
    check_agreement(header, without_some_diffs(rng, packets))


@pytest.mark.parametrize("bits", range(4, 21))
def test_every_number_of_bits(bits: int) -> None:
    rng = np.random.default_rng(bits)
    mesh = random_mesh(rng, 12, bits)
    check_agreement(*compact_stream(rng, mesh, Effort.DEFAULT))
    check_agreement(*classic_stream(rng, mesh))


@pytest.mark.parametrize("effort", Effort)
def test_a_single_point(effort: Effort) -> None:
    mesh = GridMesh(5, np.array([[3, 17, 31]], np.int32), np.zeros((0, 3), np.int32))
    assert check_agreement(*compact_stream(np.random.default_rng(1), mesh, effort)) > 0


def book(blades: int, pages: int, count: int) -> GridMesh:
    """A fan of many faces around one vertex, an edge of many faces, loose faces; vertices in three clusters."""
    rng = np.random.default_rng(8)
    fan = np.stack([np.zeros(blades), np.arange(1, blades + 1), np.arange(2, blades + 2)], axis=1)
    turned = np.stack([np.full(pages, 5), np.full(pages, count - 1), np.arange(10, 10 + pages)], axis=1)
    points = rng.integers(0, 40, (count, 3)) + 900 * (np.arange(count) % 3)[:, None]
    return welded(12, points, np.concatenate([fan, turned, rng.integers(0, count, (20, 3))]).astype(int))


@pytest.mark.parametrize("way", ["classic", *Effort])
def test_more_faces_and_children_than_searches_look_at(way: str) -> None:
    mesh = book(66, 65, 90) if way == Effort.HIGH else book(70, 70, 300)
    rng = np.random.default_rng(2)
    header, packets = classic_stream(rng, mesh) if way == "classic" else compact_stream(rng, mesh, Effort(way))
    without_planes = [packet for packet in packets if packet.kind is not PacketKind.DIFF]
    check_agreement(header, without_planes)


@pytest.mark.parametrize("options", [CompactOptions(bits=7), ClassicOptions(bits=7, coarsest_vertices=9)])
def test_whole_files_in_the_unit_of_the_input(options: CompactOptions | ClassicOptions) -> None:
    data = encode(grid(9), options).to_bytes()
    for level in range(read_container(data)[0].levels[0].level + 1):
        expected, found = decode(data, level), reference_decode(data, level)
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
    assert reference_order(encode(tetrahedron()).to_bytes()) is None


def test_a_level_that_is_not_there() -> None:
    data = encode(tetrahedron()).to_bytes()
    for level in (21, -1):
        with pytest.raises(KeyError):
            reference_decode(data, level)


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


@pytest.mark.parametrize("way", ["classic", *Effort])
def test_damaged_payloads_are_refused_alike_or_decode_alike(way: str) -> None:
    rng = np.random.default_rng(3)
    mesh = random_mesh(rng, 14, 6)
    header, packets = classic_stream(rng, mesh) if way == "classic" else compact_stream(rng, mesh, Effort(way))
    refused = 0
    for _ in range(20):
        place = int(rng.integers(len(packets)))
        payload = bytearray(packets[place].payload)
        if not payload:
            continue
        payload[int(rng.integers(len(payload)))] ^= 1 << int(rng.integers(8))
        damaged = [*packets[:place], replace(packets[place], payload=bytes(payload)), *packets[place + 1 :]]
        refused += check_agreement(header, damaged) == 0
    assert refused > 0


def test_a_payload_that_goes_on_is_refused() -> None:
    header, packets = read_container((GOLDEN / "compact-scattered-1.tide").read_bytes())
    payloads = [packet.payload for packet in packets]
    payloads[0] += bytes(5)
    entry = replace(header.packets[0], length=len(payloads[0]), checksum=zlib.crc32(payloads[0]))
    longer = replace(header, packets=(entry, *header.packets[1:]))
    with pytest.raises(PacketError, match="left over"):
        reference_decode(write_container(longer, payloads))


@pytest.mark.parametrize("version", [3, 5])
def test_another_format_version_is_refused(version: int) -> None:
    data = encode(tetrahedron()).to_bytes()
    header = read_container(data)[0].to_bytes()
    assert data[PREAMBLE_BYTES] == VERSION
    other = bytes([version]) + header[1:]
    packets = data[PREAMBLE_BYTES + len(header) :]
    for wrong in (
        data[:8] + bytes([version]) + data[9:],
        data[:14] + zlib.crc32(other).to_bytes(4, "little") + other + packets,
    ):
        with pytest.raises(VersionError, match=f"is of format {version}"):
            reference_decode(wrong)


def test_an_unknown_profile_is_refused() -> None:
    data = encode(tetrahedron()).to_bytes()
    header = bytearray(read_container(data)[0].to_bytes())
    header[1] = 7
    packets = data[PREAMBLE_BYTES + len(header) :]
    with pytest.raises(ContainerError, match="unknown profile"):
        reference_decode(data[:14] + zlib.crc32(header).to_bytes(4, "little") + bytes(header) + packets)


@pytest.mark.parametrize("name", ["default", "high", "classic"])
def test_the_document_names_the_states_that_are_shipped(name: str) -> None:
    data = (resources.files("meshtide_codec") / "states" / f"{name}.states").read_bytes()
    assert f"| `{name}.states` | {len(data)} | {zlib.crc32(data):08x} |" in DOCUMENT


@pytest.mark.parametrize("name", LAYERS)
def test_the_document_tells_how_large_the_layers_are(name: str) -> None:
    s, asked = LAYERS[name]
    numbers = s.scores, s.contexts, s.neurons, s.final_neurons, s.groups, asked, s.rate, s.settled
    told = [name, *numbers, s.score_shift, s.shift, s.final_shift]
    assert f"| {' | '.join(str(number) for number in told)} |" in DOCUMENT


def test_a_mesh_of_doubles() -> None:
    mesh = Mesh.checked(np.random.default_rng(1).normal(size=(20, 3)) * 1e6, [[0, 1, 2], [2, 1, 3], [4, 5, 6]])
    data = encode(mesh, CompactOptions(bits=20)).to_bytes()
    assert np.array_equal(reference_decode(data).vertices, decode(data).vertices)


def test_a_lost_diff_of_depth_0_is_missed_by_nobody() -> None:
    mesh = GridMesh(4, np.array([[3, 9, 14]], np.int32), np.zeros((0, 3), np.int32))
    for seed in range(100):
        header, packets = compact_stream(np.random.default_rng(seed), mesh, Effort.DEFAULT)
        options = header.options
        if isinstance(options, CompactHeader) and options.diff_depths[0] == 0:
            break
    told = [packet for packet in packets if (packet.kind, packet.level) != (PacketKind.DIFF, 4)]
    assert len(told) == len(packets) - 1
    assert check_agreement(header, told) > 0


def test_sections_that_sources_name_are_in_the_document() -> None:
    root = Path(__file__).parents[2]
    headings = set(re.findall(r"^#+ [0-9.]* *(.+)$", DOCUMENT, re.MULTILINE))
    named = set()
    for folder, pattern in (("codec/core", "*.[hc]*"), ("codec/meshtide_codec", "*.py")):
        for path in (root / folder).rglob(pattern):
            text = re.sub(r"\n\s*(//|\*)? ?", " ", path.read_text())
            named |= set(re.findall(r"docs/format\.md, ([A-Z][A-Za-z ]+)", text))
    assert len(named) > 12
    assert named <= headings, named - headings
