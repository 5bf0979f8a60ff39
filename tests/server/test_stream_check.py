import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.decoder import decode
from meshtide_codec.errors import LimitError, MeshtideError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.container import read_container, write_container
from meshtide_codec.stream.header import LevelEntry, StreamHeader
from meshtide_server.stream_check import STAGE, check_stream

from .conftest import make_stream, real_stream

GOLDEN = Path(__file__).parents[1] / "golden"
MANY_STATES = (GOLDEN / "version-3" / "compact-dome-previews.tide").read_bytes()
Change = Callable[[StreamHeader], StreamHeader]


def quiet(_stage: str, _fraction: float) -> None:
    pass


@pytest.mark.parametrize(
    "path", sorted(GOLDEN.rglob("*.tide"))[::6], ids=lambda path: f"{path.parent.name}/{path.stem}"
)
def test_what_this_program_writes_and_ever_wrote_is_what_it_says(path: Path) -> None:
    told: list[float] = []
    mesh = check_stream(path.read_bytes(), Limits(), lambda stage, fraction: told.append(fraction * (stage == STAGE)))
    assert told == sorted(told)
    assert 0 < told[-1] <= 1
    expected = decode(path.read_bytes())
    assert np.array_equal(mesh.vertices, expected.vertices)
    assert np.array_equal(mesh.faces, expected.faces)


def changed(change: Change, data: bytes | None = None) -> bytes:
    header, packets = read_container(data or MANY_STATES)
    return write_container(change(header), [packet.payload for packet in packets])


def row(place: int, **changes: float) -> Change:
    def change(header: StreamHeader) -> StreamHeader:
        levels: list[LevelEntry] = list(header.levels)
        levels[place] = replace(levels[place], **{n: getattr(levels[place], n) + by for n, by in changes.items()})
        return replace(header, levels=tuple(levels))

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (row(-1, vertices=1), None),
        (row(-1, faces=1), None),
        (row(0, vertices=-1), None),
        (row(0, packet_count=-1), None),
        (row(-1, packet_count=-1), None),
        (row(-1, rms=0.25, maximum=0.5), "from itself"),
        (lambda header: replace(header, profile="brotli"), "unknown profile"),
        (lambda header: replace(header, options={**header.options, "other": 1}), None),
        (lambda header: replace(header, options={}), None),
        (lambda header: replace(header, origin=(1.7e308, 0.0, 0.0), extent=1.7e308), "beyond the largest number"),
    ],
)
def test_claims_that_do_not_hold_are_refused(change: Change, words: str | None) -> None:
    check_stream(changed(lambda header: header), Limits(), quiet)
    with pytest.raises(MeshtideError, match=words), np.errstate(over="ignore", invalid="ignore"):
        check_stream(changed(change), Limits(), quiet)


def test_a_maximum_below_the_mean_is_refused() -> None:
    """Only streams of the versions before the third can say so."""
    data = (GOLDEN / "version-2" / "compact-bowl.tide").read_bytes()
    with pytest.raises(MeshtideError, match="which is larger"):
        check_stream(changed(row(0, rms=0.5), data), Limits(), quiet)


def test_a_stream_with_right_checksums_and_wrong_packets_is_refused() -> None:
    with pytest.raises(MeshtideError):
        check_stream(make_stream(), Limits(), quiet)


def test_limits_hold() -> None:
    with pytest.raises(LimitError, match="vertices"):
        check_stream(real_stream(1), Limits(vertices=5), quiet)


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(1, 255))
def test_a_changed_byte_with_a_right_checksum_is_no_bare_error(place: int, flip: int) -> None:
    header, packets = read_container(real_stream(1))
    payloads = [bytearray(packet.payload) for packet in packets]
    flat = [(number, at) for number, payload in enumerate(payloads) for at in range(len(payload))]
    number, at = flat[place % len(flat)]
    payloads[number][at] ^= flip
    table = [
        replace(entry, checksum=zlib.crc32(payload)) for entry, payload in zip(header.packets, payloads, strict=True)
    ]
    data = write_container(replace(header, packets=tuple(table)), [bytes(payload) for payload in payloads])
    try:
        mesh = check_stream(data, Limits(), quiet)
    except MeshtideError:
        return
    assert np.isfinite(mesh.vertices).all()
