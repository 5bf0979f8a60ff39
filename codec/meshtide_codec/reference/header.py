"""The file: preamble, header, packets (docs/format.md, section 1).

An encoder decides B and the cube (the longest side of the bounding box), which packets there are and what each state
needs; it writes coordinates in the shortest form that gives the double, and distances rounded up.
"""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass, field
from typing import NoReturn

from meshtide_codec.errors import ContainerError, PacketError, VersionError

MAGIC = b"\x89TIDE\r\n\x1a"
PREAMBLE = struct.Struct("<8sHII")
VERSION = 4
CLASSIC, COMPACT = range(2)
BASE, MAP_CONN, PARAM, DIFF, PREVIEW, ORDER = range(6)
ZEROTH, GAUSSIAN, TAUBIN, POLYNOMIAL, RATIONAL = range(5)

LEAST_BITS, MOST_BITS = 4, 20
MOST_LEVEL, MOST_SLICE, MOST_PREVIEWS, MOST_SLICES = 63, 65535, 8, 4096
MOST_DEGREE, MOST_DENOMINATOR_DEGREE = 15, 4
MOST_DIGITS = 9  # of a number in base 128
MOST_DECIMALS, SINGLE, DOUBLE = 22, 32, 64  # first bytes of coordinates
LARGEST_DISTANCE = 127 / 64

Key = tuple[int, int, int]
"""Kind, level and slice of a packet."""


class ByteReader:
    """Bytes that are read from front to end.

    >>> reader = ByteReader(bytes([0xAC, 0x02, 3, 5, 0xAF, 0x82, 0x1E]))
    >>> reader.number(), reader.signed_number(), reader.coordinate()
    (300, -2, -2.45912)
    """

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.position = 0

    def fail(self, text: str) -> NoReturn:
        """Say that the bytes are damaged."""
        raise ContainerError(text, offset=self.position)

    def take(self, count: int) -> bytes:
        """The next bytes."""
        if self.position + count > len(self.data):
            self.fail("it ends early")
        self.position += count
        return self.data[self.position - count : self.position]

    def rest(self) -> bytes:
        """All bytes that are left."""
        return self.take(len(self.data) - self.position)

    def byte(self) -> int:
        """The next byte."""
        return self.take(1)[0]

    def number(self) -> int:
        """A number in base 128, lowest digits first; the high bit says that another digit follows."""
        value = 0
        for digit in range(MOST_DIGITS):
            byte = self.byte()
            value |= (byte & 127) << (7 * digit)
            if byte < 128:
                return value
        return self.fail("a number of more than nine bytes")

    def signed_number(self) -> int:
        """A folded number: 0, -1, 1, -2, ... are written as 0, 1, 2, 3, ..."""
        value = self.number()
        return -(value + 1) // 2 if value % 2 == 1 else value // 2

    def coordinate(self) -> float:
        """A decimal number, a float32 or a double, by its first byte."""
        form = self.byte()
        if form in {SINGLE, DOUBLE}:
            return float(*struct.unpack("<f" if form == SINGLE else "<d", self.take(form // 8)))
        if form > MOST_DECIMALS:
            self.fail("a coordinate of no known form")
        digits = self.signed_number()
        if not -(2**53) <= digits <= 2**53:
            self.fail("a decimal number of more digits than a double holds")
        return float(digits) / 10.0**form


@dataclass(frozen=True)
class PacketEntry:
    """A row of the packet table."""

    kind: int
    level: int
    slice: int
    length: int
    checksum: int


@dataclass(frozen=True)
class LevelEntry:
    """A row of the level table: what can be shown with the first packets; distances are fractions of the diagonal."""

    level: int
    packet_count: int
    vertices: int
    faces: int
    rms: float
    maximum: float


@dataclass
class CompactHeader:
    """What profile compact says of itself.

    Attributes:
        high: effort high.
        mirror_axis: 0 to 2; -1 without a mirror.
        mirror_sum: of a coordinate and its mirrored one, in finest steps.
        slices: the first Morton code of each slice.
        strengths: of the display filter, from the base depth on.
        base_depth, diff_depths, previews: by the packet table.
    """

    base_depth: int
    diff_depths: list[int]
    previews: int
    high: bool = False
    mirror_axis: int = -1
    mirror_sum: int = 0
    slices: list[int] = field(default_factory=lambda: [0])
    strengths: list[int] = field(default_factory=list)


@dataclass
class ClassicHeader:
    """What profile classic says of itself.

    Attributes:
        shifts: bits that each level has dropped, level 0 first.
        diffs: the levels that send a Diff.
        filter: ZEROTH to RATIONAL.
        norm: what the encoder has minimised; 0 for l-infinity.
    """

    shifts: list[int]
    diffs: list[int]
    filter: int
    degree: int = 0
    denominator_degree: int = 0
    chebyshev: bool = False
    norm: float = 2.0
    taubin_lambda: float = 0.0
    taubin_mu: float = 0.0

    @property
    def coefficient_count(self) -> int:
        """Coefficients that a Param holds for each coordinate."""
        if self.filter == POLYNOMIAL:
            return self.degree + 1
        return self.degree + 1 + self.denominator_degree if self.filter == RATIONAL else 0


@dataclass
class Header:
    """What a header says."""

    profile: int
    bits: int
    origin: list[float]
    extent: float
    packets: list[PacketEntry]
    states: list[LevelEntry]
    compact: CompactHeader | None = None
    classic: ClassicHeader | None = None

    def state_of(self, level: int) -> LevelEntry:
        """The last state of a level.

        Raises:
            ContainerError: there is none.
        """
        for state in reversed(self.states):
            if state.level == level:
                return state
        raise ContainerError(f"the table of states lacks level {level}")

    def packets_for(self, level: int) -> int:
        """How many packets show a level best: those of its last state, or of the first state of a finer level.

        Raises:
            KeyError: the stream has no such level.
        """
        if not 0 <= level <= self.states[0].level:
            raise KeyError(f"the stream has levels 0..{self.states[0].level}, not {level}")
        own = [state for state in self.states if state.level == level]
        finer = [state for state in self.states if state.level < level]
        return (own[-1] if own else finer[0]).packet_count


@dataclass
class Stream:
    """A header, and payloads in transmission order."""

    header: Header
    payloads: dict[Key, bytes]


def read_stream(data: bytes) -> Stream:
    """Take a whole file apart.

    Raises:
        StreamError: it is damaged.
    """
    if len(data) < PREAMBLE.size:
        raise ContainerError("the file ends inside its preamble", offset=0)
    magic, version, length, checksum = PREAMBLE.unpack_from(data)
    if magic != MAGIC:
        raise ContainerError("not a meshtide stream", offset=0)
    if version != VERSION:
        raise VersionError(f"the stream is of format {version}; this is a decoder of format {VERSION}", offset=8)
    header_bytes = data[PREAMBLE.size : PREAMBLE.size + length]
    if zlib.crc32(header_bytes) != checksum:
        raise ContainerError("the header is damaged", offset=PREAMBLE.size)
    header = read_header(header_bytes)
    position = PREAMBLE.size + length
    payloads: dict[Key, bytes] = {}
    for packet in header.packets:
        payload = data[position : position + packet.length]
        if len(payload) != packet.length or zlib.crc32(payload) != packet.checksum:
            raise PacketError("it is damaged", level=packet.level, offset=position)
        payloads[packet.kind, packet.level, packet.slice] = payload
        position += packet.length
    if position != len(data):
        raise ContainerError("bytes follow the last packet", offset=position)
    return Stream(header, payloads)


def read_header(data: bytes) -> Header:
    """Read a header from its first byte, which is the version, to its options.

    Raises:
        ContainerError: it is damaged.
    """
    reader = ByteReader(data)
    version = reader.byte()
    if version != VERSION:
        raise VersionError(f"the header is of format {version}; this is a decoder of format {VERSION}", offset=0)
    profile, bits = reader.byte(), reader.byte()
    if profile not in {CLASSIC, COMPACT} or not LEAST_BITS <= bits <= MOST_BITS:
        reader.fail("an unknown profile, or B is not 4..20")
    origin = [reader.coordinate() for _ in range(3)]
    extent = reader.coordinate()
    if not extent >= 0 or not all(math.isfinite(abs(coordinate) + 1.125 * extent) for coordinate in origin):
        reader.fail("a grid of no extent, or beyond the largest number")
    header = Header(profile, bits, origin, extent, [], [])
    _read_packets(reader, header)
    if header.states[-1].vertices > 1 and all(coordinate + extent == coordinate for coordinate in origin):
        reader.fail("a grid of one point for several vertices")
    if profile == COMPACT:
        header.compact = _read_compact(reader, header)
    else:
        header.classic = _read_classic(reader, header)
    return header


def _read_packets(reader: ByteReader, header: Header) -> None:
    """The packet table, and the states between its rows."""
    level = part = 0
    seen: set[Key] = set()
    for _ in range(reader.number()):
        row = reader.number()
        kind, step, completes = row % 8, row // 8 % 4, row // 32
        if kind > ORDER or completes > 3:
            reader.fail("the row of a packet begins as none does")
        if step == 3:
            level, part = reader.number(), reader.number()
        else:
            level, part = [(level, 0), (level, part + 1), (level - 1, 0)][step]
        if not 0 <= level <= MOST_LEVEL or part > MOST_SLICE or (kind, level, part) in seen:
            reader.fail("a packet of no level or slice, or one that is there twice")
        seen.add((kind, level, part))
        length = reader.number()
        (checksum,) = struct.unpack("<I", reader.take(4))
        header.packets.append(PacketEntry(kind, level, part, length, checksum))
        if completes == 2:
            for _ in range(reader.number()):
                _read_state(reader, header, reader.number(), same_size=False)
        elif completes:
            _read_state(reader, header, level, same_size=completes == 3)
    if not header.states or header.states[-1].level != 0:
        reader.fail("the table of states does not end with level 0")


def _read_state(reader: ByteReader, header: Header, level: int, *, same_size: bool) -> None:
    vertices, faces = (header.states[-1].vertices, header.states[-1].faces) if header.states else (0, 0)
    if not same_size:
        growth, surplus_growth = reader.signed_number(), reader.signed_number()
        surplus = faces - 2 * vertices + surplus_growth
        vertices += growth
        faces = 2 * vertices + surplus
    if level > MOST_LEVEL or vertices < 1 or faces < 0:
        reader.fail("a state of no level, or of a size that no mesh has")
    rms, maximum = distances(reader.take(2))
    header.states.append(LevelEntry(level, len(header.packets), vertices, faces, rms, maximum))


def distances(stored: bytes) -> tuple[float, float]:
    """Root mean square and maximum of a state, from its two bytes.

    >>> distances(bytes([0, 0])), distances(bytes([216, 12]))
    ((0.0, 0.0), (0.0625, 0.5))
    """
    word = stored[0] * 256 + stored[1]
    r, q = word // 32, word % 32
    rms = 0.0 if r == 0 else (64 + r % 64) * 2.0 ** (r // 64 - 37)
    return rms, LARGEST_DISTANCE if q == 31 else min(rms * ((4 + q % 4) * 2.0 ** (q // 4 - 2)), LARGEST_DISTANCE)


def _read_compact(reader: ByteReader, header: Header) -> CompactHeader:
    bases = [header.bits - packet.level for packet in header.packets if packet.kind == BASE]
    diffs = sorted({header.bits - packet.level for packet in header.packets if packet.kind == DIFF})
    previews = sum(packet.kind == PREVIEW for packet in header.packets)
    if len(bases) != 1 or bases[0] < 0 or (diffs and diffs[0] < bases[0]) or previews > MOST_PREVIEWS:
        reader.fail("Base, Diff or Preview packets that no stream has")
    for packet in header.packets:
        if packet.kind == PARAM:
            reader.fail("a compact stream has no Param packets")
        if packet.kind == MAP_CONN:
            header.state_of(packet.level)
    options = CompactHeader(bases[0], diffs, previews)
    flags = reader.number()
    if flags > 7:
        reader.fail("options of a compact stream that there are not")
    options.high = flags & 1 != 0
    if flags & 2:
        options.mirror_axis, options.mirror_sum = reader.byte(), reader.number()
        if options.mirror_axis > 2 or options.mirror_sum >= 2 << header.bits:
            reader.fail("a mirror plane outside of the grid")
    if flags & 4:
        _read_slices(reader, header, options.slices)
    packed = reader.rest()
    depths = header.bits - options.base_depth + 1
    if len(packed) > (depths + 1) // 2:
        reader.fail("more strengths of the display filter than depths")
    options.strengths = [half for byte in packed for half in (byte >> 4, byte & 15)]
    options.strengths += [0] * depths
    return options


def _read_slices(reader: ByteReader, header: Header, slices: list[int]) -> None:
    more = reader.number()
    if not 0 < more < MOST_SLICES or more > header.states[-1].vertices:
        reader.fail("more slices than there can be")
    for _ in range(more):
        step = reader.number()
        slices.append(slices[-1] + step)
        if step == 0 or slices[-1] >> (3 * header.bits):
            reader.fail("slices that do not ascend in the cube")


def _read_classic(reader: ByteReader, header: Header) -> ClassicHeader:
    levels = reader.byte()
    if not 1 <= levels <= header.bits + 1:
        reader.fail("not as many levels as B allows")
    shifts = [0, *(reader.byte() for _ in range(levels - 1))]
    if sorted(set(shifts)) != shifts or shifts[-1] > header.bits:
        reader.fail("dropped bits that do not ascend up to B")
    diffs = reader.number()
    if diffs >> (levels - 1):
        reader.fail("a Diff of a level that is not predicted")
    options = ClassicHeader(shifts, [level for level in range(levels) if diffs >> level & 1], reader.byte())
    _read_filter(reader, options)
    if reader.position != len(reader.data):
        reader.fail("bytes follow the options")
    if [state.level for state in header.states] != list(range(levels - 1, -1, -1)):
        reader.fail("not one state for each level, in their order")
    if any(fine.vertices < coarse.vertices for coarse, fine in zip(header.states, header.states[1:], strict=False)):
        reader.fail("a level with fewer vertices than the coarser one")
    return options


def _read_filter(reader: ByteReader, options: ClassicHeader) -> None:
    if options.filter > RATIONAL:
        reader.fail("a filter of no known kind")
    if options.filter == TAUBIN:
        options.taubin_lambda, options.taubin_mu = reader.coordinate(), reader.coordinate()
        if not (0 <= options.taubin_lambda <= 2 and 0 <= options.taubin_mu <= 2):
            reader.fail("a factor of Taubin's filter outside of 0..2")
    if options.filter in {POLYNOMIAL, RATIONAL}:
        options.degree = reader.byte()
        basis = reader.byte()
        options.chebyshev = basis == 1
        options.norm = reader.coordinate()
        norm_is_known = options.norm == 0 or 1 <= options.norm <= 2
        if options.degree > MOST_DEGREE or basis > 1 or not norm_is_known:
            reader.fail("a filter of another degree, basis or norm than there are")
    if options.filter == RATIONAL:
        options.denominator_degree = reader.byte()
        if not 1 <= options.denominator_degree <= MOST_DENOMINATOR_DEGREE:
            reader.fail("a denominator of another degree than 1..4")
