"""Profile compact: levels, Diffs and previews from their packets, and what is drawn (docs/format.md, section 10).

An encoder decides the base depth, previews, and for each depth the strength of the display filter that brings what is
drawn nearest to the finest mesh.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import BaseError, PacketError
from meshtide_codec.reference import candidates, diff
from meshtide_codec.reference.coding import RangeDecoder, trained
from meshtide_codec.reference.diff import Slice
from meshtide_codec.reference.faces import FacesDecoder
from meshtide_codec.reference.header import BASE, DIFF, MAP_CONN, PREVIEW, ByteReader, CompactHeader, Key
from meshtide_codec.reference.levels import Level, Point, root
from meshtide_codec.reference.map import DEFAULT_SHAPE, HIGH_SHAPE, MapDecoder

if TYPE_CHECKING:
    from meshtide_codec.reference.header import Header

    Positions = list[list[float]]
    Drawn = tuple[Positions, list[Point]]
    """Positions in finest steps, and faces."""

DEFAULT_SHAPES = (DEFAULT_SHAPE, candidates.DEFAULT_SHAPE, diff.DEFAULT_SHAPE)
HIGH_SHAPES = (HIGH_SHAPE, candidates.HIGH_SHAPE, diff.HIGH_SHAPE)
NO_MIRROR = (-1, 0)
LONGEST_RING = 64
STRENGTH_UNIT = 128
STRENGTHS = [
    (0, 0), (13, 13), (26, 26), (38, 26), (51, 0), (64, 26), (64, 38), (64, 51),
    (64, 64), (77, 51), (77, 64), (96, 0), (96, 51), (96, 64), (115, 0), (115, 64),
]  # fmt: skip
"""Of the display filter: the steps towards the mean, and away from it, that four bits stand for."""


class Hierarchy:
    """The levels of one mesh and the Diffs of its slices.

    Args:
        bits: of the grid.
        vertices: of the finest level.
        most_faces: of any level.
        slices: the first Morton code of each.
        mirror: axis and sum, or an axis of -1.
        high: effort high.
    """

    def __init__(
        self, bits: int, vertices: int, most_faces: int, *, slices: list[int], mirror: tuple[int, int], high: bool
    ) -> None:
        self.bits = bits
        self._vertices, self._most_faces = vertices, most_faces
        self._mirror, self._high = mirror, high
        map_layer, faces_layer, diff_layer = (
            trained("high", HIGH_SHAPES) if high else trained("default", DEFAULT_SHAPES)
        )
        self._map_layer, self._faces_layer = map_layer.copy(), faces_layer.copy()
        self.levels = [root(vertices, bits)]
        ends = [*slices[1:], None]
        self.slices = [
            Slice(bits, first, end, diff_layer.copy().mixer, mirror, high=high)
            for first, end in zip(slices, ends, strict=True)
        ]
        for each in self.slices:
            each.enter(self.levels[0])

    @property
    def complete(self) -> bool:
        """Whether all cells are leaves, so that the levels of greater depths are the same."""
        return all(self.levels[-1].leaves)

    @property
    def known_depth(self) -> int:
        """The depth down to which levels are known."""
        return self.bits if self.complete else self.levels[-1].depth

    def level(self, depth: int) -> Level:
        """That of a depth that is known."""
        return self.levels[min(depth, len(self.levels) - 1)]

    def decode_level(self, decoder: RangeDecoder) -> None:
        """The next level: a Map, then faces."""
        coarse = self.levels[-1]
        if self.complete:
            raise PacketError("nothing is left to split")
        fine = MapDecoder(
            decoder,
            coarse,
            self._map_layer.mixer,
            bits=self.bits,
            vertices=self._vertices,
            mirror=self._mirror,
            high=self._high,
        ).decode()
        FacesDecoder(
            decoder,
            coarse,
            fine,
            self._faces_layer,
            bits=self.bits,
            most_faces=self._most_faces,
            positions=True,
            high=self._high,
        ).decode()
        self.levels.append(fine)

    def decode_planes(self, decoder: RangeDecoder, number: int, depth: int) -> None:
        """The bit planes of a slice from the one after the last that is known to that of a depth."""
        each = self.slices[number]
        for plane in range(each.known_depth + 1, depth + 1):
            if self.level(plane).depth == plane:
                each.enter(self.level(plane))
            each.decode_plane(decoder, plane)

    def known_cells(self, level: Level) -> list[tuple[Point, int]]:
        """For each vertex the smallest cell known to hold it: its middle, in half finest steps, and its depth."""
        known = list(zip(level.centres, level.cell_depths, strict=True))
        for each in self.slices:
            for vertex, position in each.known_cells(level).items():
                x, y, z, depth = (int(value) for value in position)
                known[vertex] = (x, y, z), depth
        return known


def decode_compact(header: Header, payloads: dict[Key, bytes]) -> dict[int, Drawn]:
    """All levels and previews that packets give; Diffs may be missing, and everything that follows something else."""
    options = header.compact
    assert options is not None  # noqa: S101 - headers have the options of their profile
    drawn = {}
    coarsest = header.bits - options.base_depth
    for (kind, level, part), payload in payloads.items():
        known_slice = part < len(options.slices) if kind == DIFF else part == 0
        if not known_slice or (kind == MAP_CONN and level >= coarsest):
            raise PacketError("this stream has no such packet", level=level)
        if kind == PREVIEW:
            drawn[level] = _decode_preview(header, options, level, payload)
    if (BASE, coarsest, 0) not in payloads:
        return drawn
    hierarchy = _decode_levels(header, options, payloads)
    for number in range(len(options.slices)):
        for depth in filter(None, options.diff_depths):  # there is no bit plane of depth 0
            planes = payloads.get((DIFF, header.bits - depth, number))
            if planes is None or depth > hierarchy.known_depth:
                break
            with RangeDecoder(planes) as decoder:
                hierarchy.decode_planes(decoder, number, depth)
    for depth in range(options.base_depth, hierarchy.known_depth + 1):
        cells = hierarchy.level(depth)
        strength = STRENGTHS[options.strengths[depth - options.base_depth]]
        drawn[header.bits - depth] = draw(hierarchy.known_cells(cells), header.bits, cells.faces(), strength)
    return drawn


def _decode_levels(header: Header, options: CompactHeader, payloads: dict[Key, bytes]) -> Hierarchy:
    """The levels of Base and Map&Conn packets, as far as they go."""
    hierarchy = Hierarchy(
        header.bits,
        header.states[-1].vertices,
        max(state.faces for state in header.states),
        slices=options.slices,
        mirror=(options.mirror_axis, options.mirror_sum),
        high=options.high,
    )
    with RangeDecoder(payloads[BASE, header.bits - options.base_depth, 0]) as decoder:
        while hierarchy.known_depth < options.base_depth:
            hierarchy.decode_level(decoder)
    while not hierarchy.complete:
        planes = payloads.get((MAP_CONN, header.bits - hierarchy.known_depth - 1, 0))
        if planes is None:
            break
        with RangeDecoder(planes) as decoder:
            hierarchy.decode_level(decoder)
    return hierarchy


def _decode_preview(header: Header, options: CompactHeader, level: int, payload: bytes) -> Drawn:
    """A mesh of its own, in a cube of its own bits, in one payload."""
    if not 0 < level - (header.bits - options.base_depth) <= options.previews:
        raise PacketError("this stream has no such packet", level=level)
    state = header.state_of(level)
    reader = ByteReader(payload)
    leaf_depth, bits = reader.number(), 0
    while leaf_depth > bits:
        bits += 1
        leaf_depth -= bits
    if not 4 <= bits <= header.bits:
        raise PacketError("a preview of more than B bits", level=level)
    hierarchy = Hierarchy(bits, state.vertices, state.faces, slices=[0], mirror=NO_MIRROR, high=False)
    with RangeDecoder(reader.rest()) as decoder:
        while hierarchy.known_depth < leaf_depth:
            hierarchy.decode_level(decoder)
        if not hierarchy.complete:
            raise BaseError("a preview that has cells to split", level=level)
        hierarchy.decode_planes(decoder, 0, bits)
    scale = ((1 << header.bits) - 1) / ((1 << bits) - 1)
    known = hierarchy.known_cells(hierarchy.levels[-1])
    positions = [[0.5 * (coordinate - 1.0) * scale for coordinate in middle] for middle, _ in known]
    return positions, hierarchy.levels[-1].faces()


# ---- What is drawn


def draw(known: list[tuple[Point, int]], bits: int, triangles: list[Point], strength: tuple[int, int]) -> Drawn:
    """Positions in finest steps: each middle is drawn towards its ring's mean, then away from it."""
    positions = [[float(coordinate) for coordinate in middle] for middle, _ in known]
    smoothing, sharpening = strength
    rings = drawing_rings(triangles, len(known))
    for factor in (smoothing / STRENGTH_UNIT, -sharpening / STRENGTH_UNIT):
        if factor:
            positions = _moved(positions, rings, known, bits, factor)
    return [[0.5 * (coordinate - 1.0) for coordinate in position] for position in positions], triangles


def _moved(
    before: Positions, rings: list[list[int]], known: list[tuple[Point, int]], bits: int, factor: float
) -> Positions:
    """Positions moved along their offset from the ring's mean, kept inside the cells."""
    positions = []
    for vertex, (ring, (middle, depth)) in enumerate(zip(rings, known, strict=True)):
        position = list(before[vertex])
        side = 1 << (bits - depth)
        if ring and side > 1:
            for axis in range(3):
                total = 0.0
                for member in ring:
                    total += before[member][axis]
                to = position[axis] - factor * (position[axis] - total / len(ring))
                position[axis] = min(max(to, float(middle[axis] - side)), float(middle[axis] + side))
        positions.append(position)
    return positions


def drawing_rings(triangles: list[Point], vertices: int) -> list[list[int]]:
    """For each vertex its neighbours in the order in which its triangles turn around it; all chains of them."""
    wedges: list[list[tuple[int, int]]] = [[] for _ in range(vertices)]
    for a, b, c in triangles:
        wedges[a].append((b, c))
        wedges[b].append((c, a))
        wedges[c].append((a, b))
    return [_drawing_ring(around) for around in wedges]


def _drawing_ring(wedges: list[tuple[int, int]]) -> list[int]:
    """Chain the wedges of a vertex head to tail."""
    if len(wedges) > LONGEST_RING:
        return [start for start, _ in wedges]
    ring: list[int] = []
    while wedges:
        head, tail = wedges.pop(0)
        chain = [head]
        while tail != head:
            chain.append(tail)
            wedge = _taken(wedges, 0, tail)
            if wedge is None:
                break
            tail = wedge[1]
        while tail != head:
            wedge = _taken(wedges, 1, head)
            if wedge is None:
                break
            head = wedge[0]
            chain.insert(0, head)
        ring += chain
    return ring


def _taken(wedges: list[tuple[int, int]], end: int, vertex: int) -> tuple[int, int] | None:
    """Take out the first wedge that has the vertex at an end; the first of all moves to its place."""
    place = next((place for place, wedge in enumerate(wedges) if wedge[end] == vertex), None)
    if place is None:
        return None
    taken = wedges[place]
    wedges[place] = wedges[0]
    wedges.pop(0)
    return taken
