"""Random small meshes, and streams of them with everything that the format offers, for whoever holds decoders together.

Meshes are of integers: points in the cube, in two planes, over a grid, or a surface; faces between any, between
near ones, or those of the surface. Streams are made of the core's payloads, with a base depth, a mirror, slices,
depths of Diffs and strengths that no encoder would choose.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic.level_coding import LevelEncoder, encode_param
from meshtide_codec.classic.options import ClassicHeader
from meshtide_codec.compact.mirror import Mirror
from meshtide_codec.compact.octree_encoder import OctreeEncoder
from meshtide_codec.compact.options import CompactHeader
from meshtide_codec.compact.previews import Preview, make_previews
from meshtide_codec.decoder import Decoder
from meshtide_codec.effort import Effort
from meshtide_codec.errors import StreamError
from meshtide_codec.filters import KINDS, FilterSpec, coefficient_count
from meshtide_codec.mesh import canonical_faces
from meshtide_codec.packets import Packet, PacketKind
from meshtide_codec.reference import reference_levels
from meshtide_codec.reference.header import read_header
from meshtide_codec.stream.header import LevelEntry, StreamHeader, packet_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

DISTANCES = (0.0, 0.0)


@dataclass(frozen=True)
class GridMesh:
    """Vertices on a grid of `bits` bits, in Morton order, and canonical faces."""

    bits: int
    positions: NDArray[np.int32]
    faces: NDArray[np.int32]


def morton_codes(positions: NDArray[np.integer], bits: int) -> list[int]:
    """The bits of x, y, z interleaved, x highest."""
    codes = []
    for x, y, z in positions.tolist():
        code = 0
        for place in range(bits - 1, -1, -1):
            code = code << 3 | (x >> place & 1) << 2 | (y >> place & 1) << 1 | z >> place & 1
        codes.append(code)
    return codes


def random_mesh(rng: np.random.Generator, most: int, bits: int | None = None) -> GridMesh:
    """Any mesh of at most so many vertices."""
    bits = int(rng.integers(4, 21)) if bits is None else bits
    wanted, shape = int(rng.integers(1, most + 1)), int(rng.integers(5))
    reach = min(1 << bits, 2 << int(rng.integers(bits)))
    side = int(np.ceil(np.sqrt(wanted)))
    step = np.arange(wanted)
    points = rng.integers(0, reach, (wanted, 3))
    if shape >= 2:
        points[:, 0], points[:, 1] = step % side * (reach - 1) // side, step // side * (reach - 1) // side
    if shape in {1, 2}:
        points[:, 2] &= 1
    if shape == 4:
        points[:, 2] = (points[:, 0] * 7 + points[:, 1] * 5) // 13
    kind = int(rng.integers(4))
    if shape >= 2 and kind == 3:
        corner = np.array([i for i in step if i % side < side - 1 and i + side + 1 < wanted], int)
        lower = np.stack([corner, corner + side, corner + 1], axis=1)
        upper = np.stack([corner + 1, corner + side, corner + side + 1], axis=1)
        faces = np.concatenate([lower, upper])
    else:
        faces = rng.integers(0, wanted, (int(rng.integers(3 * wanted)), 3))
        if kind > 0:
            faces[:, 1] = faces[:, 0] + rng.integers(1, 6, len(faces))
            faces[:, 2] = faces[:, 1] + rng.integers(1, 10, len(faces))
        if kind == 2:
            faces[::2] = faces[::2, ::-1]
    return welded(bits, points, faces % wanted)


def welded(bits: int, points: NDArray[np.integer], faces: NDArray[np.integer]) -> GridMesh:
    """The mesh of some points and faces: equal points are one vertex, faces that collapse are none."""
    codes, first, vertex = np.unique(
        np.array(morton_codes(points, bits), np.uint64), return_index=True, return_inverse=True
    )
    del codes
    return GridMesh(
        bits, points[first].astype(np.int32), canonical_faces(vertex.reshape(-1)[faces].astype(np.int32).reshape(-1, 3))
    )


def compact_stream(rng: np.random.Generator, mesh: GridMesh, effort: Effort) -> tuple[StreamHeader, list[Packet]]:
    """A stream of profile compact."""
    bits, count = mesh.bits, len(mesh.positions)
    mirror = None
    if rng.integers(2):
        axis = int(rng.integers(3))
        along = mesh.positions[:, axis]
        middle = int(along.min() + along.max())
        mirror = Mirror(axis, middle if rng.integers(2) else int(rng.integers(2 << bits)), bits)
    slices = [0]
    if count > 4 and not rng.integers(3):
        codes = morton_codes(mesh.positions[rng.integers(1, count, 2)], bits)
        slices += sorted({code for code in codes if code})
    encoder = OctreeEncoder(mesh.positions, mesh.faces, bits, effort=effort, mirror=mirror, slices=tuple(slices))
    split = next(depth for depth, cells in enumerate(encoder.cells) if cells == count)
    base_depth = min(int(rng.integers(bits + 1)), split)
    packets, states = _previews(rng, bits, bits - base_depth)
    diff_depths = []
    for depth in range(base_depth, bits + 1):
        level = bits - depth
        if depth == base_depth:
            packets.append(Packet(PacketKind.BASE, level, 0, encoder.base(depth)))
        elif depth <= split:
            packets.append(Packet(PacketKind.MAP_CONN, level, 0, encoder.next_level()))
        if depth == bits or rng.integers(2):
            diff_depths.append(depth)
            for part in range(len(slices)):
                encoder.add_planes(part, depth)
                packets.append(Packet(PacketKind.DIFF, level, part, encoder.take_planes(part)))
        states.append(LevelEntry(level, len(packets), encoder.cells[depth], encoder.faces[depth], *DISTANCES))
    options = CompactHeader(
        base_depth=base_depth,
        strengths=tuple(rng.integers(0, 16, bits - base_depth + 1).tolist()),
        diff_depths=tuple(diff_depths),
        mirror=mirror,
        slices=tuple(slices),
        previews=sum(packet.kind is PacketKind.PREVIEW for packet in packets),
        effort=effort,
    )
    return _header(options, bits, states, packets), packets


def _previews(rng: np.random.Generator, bits: int, coarsest: int) -> tuple[list[Packet], list[LevelEntry]]:
    """None, or one or two of some hilly surface."""
    packets: list[Packet] = []
    states: list[LevelEntry] = []
    made = _hills(bits)[: int(rng.integers(3))] if coarsest < 16 else []
    for place, preview in enumerate(made):
        level = coarsest + len(made) - place
        packets.append(Packet(PacketKind.PREVIEW, level, 0, preview.payload))
        states.append(LevelEntry(level, len(packets), len(preview.positions), len(preview.faces), *DISTANCES))
    return packets, states


@cache
def _hills(bits: int, side: int = 46) -> list[Preview]:
    """Previews of a surface of side x side vertices."""
    step = np.arange(side * side)
    u, v = step % side, step // side
    height = 0.5 + 0.4 * np.sin(u * 0.3) * np.cos(v * 0.2)
    points = np.stack([u / side, v / side, height], axis=1) * ((1 << bits) - 1)
    corner = step[(u < side - 1) & (v < side - 1)]
    lower = np.stack([corner, corner + side, corner + 1], axis=1)
    upper = np.stack([corner + 1, corner + side, corner + side + 1], axis=1)
    mesh = welded(bits, points.astype(int), np.concatenate([lower, upper]))
    return make_previews(mesh.positions, mesh.faces, bits, (64, 24))


def classic_stream(rng: np.random.Generator, mesh: GridMesh) -> tuple[StreamHeader, list[Packet]]:
    """A stream of profile classic, with coefficients and Diffs that correct nothing."""
    spec = FilterSpec(
        KINDS[int(rng.integers(len(KINDS)))],
        degree=int(rng.integers(6)),
        basis="chebyshev" if rng.integers(2) else "power",
        denominator_degree=int(rng.integers(1, 4)),
    )
    shifts = [0]
    while shifts[-1] < mesh.bits and rng.integers(5):
        shifts.append(min(shifts[-1] + int(rng.integers(1, 4)), mesh.bits))
    levels = [welded(mesh.bits, mesh.positions >> shift, mesh.faces) for shift in shifts]
    parents = [_parents(fine, coarse) for fine, coarse in itertools.pairwise(levels)]
    encoder = LevelEncoder()
    number = len(levels) - 1
    base = encoder.base(levels[number].positions, levels[number].faces, mesh.bits - shifts[number])
    packets = [Packet(PacketKind.BASE, number, 0, base)]
    states = [LevelEntry(number, 1, len(levels[number].positions), len(levels[number].faces), *DISTANCES)]
    sent = frozenset(level for level in range(number) if rng.integers(4))
    for level in range(number - 1, -1, -1):
        packets.append(Packet(PacketKind.MAP_CONN, level, 0, encoder.map_conn(parents[level], levels[level].faces)))
        count = coefficient_count(spec)
        if count:
            coefficients = rng.normal(0.0, 0.3, (3, count)).astype(np.float32)
            coefficients[:, 0] += 1.0
            coefficients[:, spec.degree + 1 :] = abs(coefficients[:, spec.degree + 1 :])
            packets.append(Packet(PacketKind.PARAM, level, 0, encode_param(coefficients)))
        if level in sent:
            differences = rng.integers(-9, 10, levels[level].positions.shape)
            packets.append(Packet(PacketKind.DIFF, level, 0, encoder.diff(differences)))
        states.append(
            LevelEntry(level, len(packets), len(levels[level].positions), len(levels[level].faces), *DISTANCES)
        )
    options = ClassicHeader(shifts=tuple(shifts), filter=spec, levels_with_diff=sent)
    return _header(options, mesh.bits, states, packets), packets


def _parents(fine: GridMesh, coarse: GridMesh) -> NDArray[np.int32]:
    """For each vertex the one of the coarser level above it: cells of both are numbered in Morton order."""
    wider = next(
        shift
        for shift in range(fine.bits + 1)
        if len(np.unique(fine.positions >> shift, axis=0)) == len(coarse.positions)
        and np.array_equal(np.unique(fine.positions >> shift, axis=0), np.unique(coarse.positions, axis=0))
    )
    place = {tuple(position): number for number, position in enumerate(coarse.positions.tolist())}
    return np.array([place[tuple(cell)] for cell in (fine.positions >> wider).tolist()], np.int32)


def _header(
    options: CompactHeader | ClassicHeader, bits: int, states: list[LevelEntry], packets: list[Packet]
) -> StreamHeader:
    table, _ = packet_table(packets)
    return StreamHeader(options, bits, (0.5, -2.25, 1.0), 3.0, tuple(states), table)


def without_some_diffs(rng: np.random.Generator, packets: Sequence[Packet]) -> list[Packet]:
    """The packets but a third of the Diffs."""
    return [packet for packet in packets if packet.kind is not PacketKind.DIFF or rng.random() < 2 / 3]


def check_agreement(header: StreamHeader, packets: Sequence[Packet]) -> int:
    """Hold the reference decoder against the core: all levels that packets give, to the last bit.

    Returns how many levels there are; none if both refuse the packets, which are damaged then.

    Raises:
        AssertionError: the decoders do not agree.
    """
    payloads = {(int(packet.kind), packet.level, packet.slice): packet.payload for packet in packets}
    try:
        expected = _shown_by_the_core(header, packets)
    except StreamError as refused:
        try:
            reference_levels(read_header(header.to_bytes()), payloads)
        except StreamError:
            return 0
        raise AssertionError("only the core refuses the packets") from refused
    found = reference_levels(read_header(header.to_bytes()), payloads)
    if set(found) != set(expected):
        raise AssertionError(f"levels {sorted(found)} instead of {sorted(expected)}")
    for level, (positions, faces) in found.items():
        right_positions, right_faces = expected[level]
        if not np.array_equal(np.array(faces, np.int64).reshape(-1, 3), right_faces):
            raise AssertionError(f"other faces of level {level}")
        if not np.array_equal(np.array(positions).reshape(-1, 3), right_positions):
            raise AssertionError(f"other positions of level {level}")
    return len(found)


def _shown_by_the_core(
    header: StreamHeader, packets: Sequence[Packet]
) -> dict[int, tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Positions in finest steps, and faces, of all levels."""
    decoder = Decoder(header)
    for packet in packets:
        decoder.push(packet)
    levels = [level for level in range(64) if decoder.is_available(level)]
    return {level: (decoder.drawn_positions(level), decoder.mesh(level).faces) for level in levels}
