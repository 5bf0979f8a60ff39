"""Every reason for which the core refuses a header: each has a header of its own, and no reason has none."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import pytest

from meshtide_codec.errors import ContainerError
from meshtide_codec.packets import PacketKind
from meshtide_codec.stream.header import FORMAT_VERSION, StreamHeader

SOURCES = Path(__file__).parents[2] / "codec" / "core" / "src" / "stream"
CLASSIC, COMPACT = 0, 1
NOTHING, OWN, MORE = 0, 1, 2  # states that a packet completes
BASE, MAP, PARAM, DIFF, PREVIEW = (kind.value for kind in list(PacketKind)[:5])


def number(value: int) -> bytes:
    digits = []
    while value >= 128:
        digits.append(value & 127 | 128)
        value >>= 7
    return bytes([*digits, value])


def signed(value: int) -> bytes:
    return number(2 * value if value >= 0 else -2 * value - 1)


def decimal(value: int) -> bytes:
    """A coordinate without decimals."""
    return b"\0" + signed(value)


def double(value: float) -> bytes:
    return b"\x40" + struct.pack("<d", value)


def state(vertices: int, surplus: int = -4) -> bytes:
    """What a state has more than the one before: vertices, and faces beyond two for each of them."""
    return signed(vertices) + signed(surplus) + b"\0\0"


def packet(kind: int, level: int, states: bytes = b"", completes: int = NOTHING) -> bytes:
    return number(kind + 8 * 3 + 32 * completes) + number(level) + number(0) + number(100) + bytes(4) + states


def compact(
    *more: bytes,
    first: bytes = packet(BASE, 0, state(10), OWN),
    options: bytes = number(0),
    profile: int = COMPACT,
    bits: int = 8,
    origin: bytes = 3 * decimal(0),
    extent: bytes = decimal(255),
    count: bytes | None = None,
) -> bytes:
    """A header of one level that decodes, but for what is given."""
    packets = [*([first] if first else []), *more]
    start = bytes([FORMAT_VERSION, profile, bits]) + origin + extent
    return start + (number(len(packets)) if count is None else count) + b"".join(packets) + options


TWO_LEVELS = packet(BASE, 1, state(10), OWN), packet(MAP, 0, state(30, 0), OWN)


def classic(options: bytes, packets: tuple[bytes, bytes] = TWO_LEVELS) -> bytes:
    """A header of two levels that decodes, but for what is given."""
    return compact(*packets, first=b"", options=options, profile=CLASSIC)


ZEROTH = b"\0"
PLAIN = b"\2\1" + number(0)  # two levels, one bit dropped, no Diffs

REFUSED = {
    "it ends early": compact()[:-3],
    "a number of more than nine bytes": compact(count=9 * b"\x80"),
    "a coordinate of no known form": compact(origin=b"\x1f" + bytes(20)),
    "a decimal number of more digits than a double holds": compact(origin=b"\0" + number((1 << 54) + 1) + bytes(8)),
    "an unknown profile; a newer meshtide may read it": compact(profile=2),
    "B is not 4..20": compact(bits=3),
    "the grid's extent is less than nothing": compact(extent=decimal(-1)),
    "the grid reaches beyond the largest number": compact(extent=double(float("inf"))),
    "the packet table is empty": compact(count=number(0)),
    "the row of a packet begins as none does": compact(packet(7, 0)),
    "a packet of no level or slice": compact(packet(DIFF, 64)),
    "a level above 63": compact(first=packet(BASE, 0, number(1) + number(64) + state(10), MORE)),
    "a size that no mesh has": compact(first=packet(BASE, 0, state(1 << 41), OWN)),
    "a level without vertices, or with less than no faces": compact(first=packet(BASE, 0, state(0), OWN)),
    "the table of states does not end with level 0": compact(first=packet(BASE, 1, state(10), OWN)),
    "a grid of one point for several vertices": compact(extent=decimal(0)),
    "a Base packet of a level above B": compact(packet(MAP, 0, state(10), OWN), first=packet(BASE, 9)),
    "a Diff packet of a level above B": compact(packet(DIFF, 9)),
    "the table of states lacks a level": compact(packet(MAP, 1)),
    "a compact stream has no Param packets": compact(packet(PARAM, 0)),
    "not one Base packet": compact(packet(BASE, 0)),
    "a Diff before the base depth": compact(packet(DIFF, 1)),
    "more than 8 previews": compact(*9 * [packet(PREVIEW, 1)]),
    "options of a compact stream that there are not": compact(options=number(8)),
    "a mirror plane outside of the grid": compact(options=number(2) + b"\3" + number(0)),
    "more slices than there can be": compact(options=number(4) + number(0)),
    "slices that do not ascend in the cube": compact(options=number(4) + number(1) + number(0)),
    "more strengths of the display filter than depths": compact(options=number(0) + b"\1\1"),
    "not as many levels as B allows": classic(b"\0"),
    "dropped bits that do not ascend up to B": classic(b"\2\0"),
    "a Diff of a level that is not predicted": classic(b"\2\1" + number(2)),
    "a filter of no known kind": classic(PLAIN + b"\5"),
    "a factor of Taubin's filter outside of 0..2": classic(PLAIN + b"\2" + decimal(3) + decimal(0)),
    "a filter of another degree, basis or norm than there are": classic(PLAIN + b"\3\x10\0" + decimal(2)),
    "a denominator of another degree than 1..4": classic(PLAIN + b"\4\1\0" + decimal(2) + b"\0"),
    "bytes follow the options": classic(PLAIN + ZEROTH + b"\0"),
    "not one state for each level": classic(b"\1" + number(0) + ZEROTH),
    "levels out of order": classic(PLAIN + ZEROTH, (packet(BASE, 0, state(10), OWN), TWO_LEVELS[1])),
    "a level with fewer vertices than the coarser one": classic(
        PLAIN + ZEROTH, (TWO_LEVELS[0], packet(MAP, 0, state(-1, 0), OWN))
    ),
}


def test_what_they_differ_from_is_read() -> None:
    assert StreamHeader.from_bytes(compact()).vertices == 10
    assert StreamHeader.from_bytes(classic(PLAIN + ZEROTH)).vertices == 40


@pytest.mark.parametrize("reason", REFUSED)
def test_headers_are_refused_for_the_reason_that_there_is(reason: str) -> None:
    with pytest.raises(ContainerError, match=re.escape(f"damaged stream header: {reason}") + "($|;)") as caught:
        StreamHeader.from_bytes(REFUSED[reason])
    assert caught.value.offset is not None


def test_no_reason_is_without_a_header() -> None:
    text = "".join((SOURCES / name).read_text() for name in ("header.cpp", "numbers.cpp"))
    assert set(re.findall(r'fail_here\(\s*"([^"]+)"', text)) == set(REFUSED)
