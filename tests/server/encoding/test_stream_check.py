import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.errors import LimitError, MeshtideError
from meshtide_codec.grid import Grid
from meshtide_codec.limits import Limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.profile import Profile
from meshtide_codec.stream.container import read_container, write_container
from meshtide_codec.stream.distances import stored_distances
from meshtide_codec.stream.header import LevelEntry, StreamHeader
from meshtide_server.encoding.stream_check import STAGE, check_stream

from ..made_streams import make_stream, real_stream

GOLDEN = Path(__file__).parents[2] / "golden"
MANY_STATES = (GOLDEN / "compact-dome-previews.tide").read_bytes()
Change = Callable[[StreamHeader], StreamHeader]


def quiet(_stage: str, _fraction: float) -> None:
    pass


@pytest.mark.parametrize("path", sorted(GOLDEN.glob("*.tide")), ids=lambda path: path.stem)
def test_what_this_program_writes_is_what_it_says(path: Path) -> None:
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


def told(**changes: object) -> Change:
    """A change of what the decoder of profile compact is told."""
    return lambda header: replace(header, options=replace(header.options, **changes))


def claim(place: int, rms: float, maximum: float) -> Change:
    def change(header: StreamHeader) -> StreamHeader:
        levels = list(header.levels)
        levels[place] = replace(levels[place], rms=rms, maximum=maximum)
        return replace(header, levels=tuple(levels))

    return change


def flat() -> Mesh:
    """A plane, whose coarser levels are the same surface."""
    u, v = np.meshgrid(np.arange(20), np.arange(20), indexing="ij")
    corner = (u * 20 + v)[:-1, :-1].reshape(-1)
    faces = [[corner, corner + 20, corner + 1], [corner + 1, corner + 20, corner + 21]]
    vertices = np.stack([u, v, 0 * u], axis=-1).reshape(-1, 3)
    return Mesh.checked(vertices, np.concatenate([np.stack(part, axis=1) for part in faces]))


def single_vertex() -> Mesh:
    """A point."""
    return Mesh.checked([[3, 4, 5]], np.zeros((0, 3), np.int64))


def far_vertex() -> Mesh:
    """A vertex far from all others, which no face has."""
    plane = flat()
    return Mesh.checked(np.concatenate([plane.vertices, [[0, 0, 1000]]]), plane.faces)


def points() -> Mesh:
    """A cloud of points."""
    place = np.arange(200)
    return Mesh.checked(np.stack([place * 37 % 61, place * 23 % 59, place], axis=1), np.zeros((0, 3), np.int64))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (row(-1, vertices=1), None),
        (row(-1, faces=1), None),
        (row(0, vertices=-1), None),
        (row(0, packet_count=-1), None),
        (row(-1, packet_count=-1), None),
        (row(-1, rms=0.25, maximum=0.5), "from itself"),
        (told(slices=(0, 0)), "slices that do not ascend"),
        (told(effort=Effort.HIGH), None),
        (told(mirror=None), None),
        (told(strengths=(0, 11, 15, 15, 15)), "from the finest mesh"),
        (lambda header: replace(header, origin=(1.7e308, 0.0, 0.0), extent=1.7e308), "beyond the largest number"),
    ],
)
def test_claims_that_do_not_hold_are_refused(change: Change, words: str | None) -> None:
    check_stream(changed(lambda header: header), Limits(), quiet)
    with pytest.raises(MeshtideError, match=words), np.errstate(over="ignore", invalid="ignore"):
        check_stream(changed(change), Limits(), quiet)


COARSE = range(len(read_container(MANY_STATES)[0].levels) - 1)


@pytest.mark.parametrize("place", COARSE)
@pytest.mark.parametrize(
    ("rms", "maximum"),
    [(0.0, 0.0), (1e-6, 1e-6), (0.9, 1.0), (1.0, 1.5)],
    ids=["the finest mesh", "almost the finest mesh", "far away", "farther away"],
)
def test_false_distances_are_refused(place: int, rms: float, maximum: float) -> None:
    """Clients that look for a bound on the error would stop too early, or show a worse state, or none."""
    with pytest.raises(MeshtideError, match="from the finest mesh"):
        check_stream(changed(claim(place, rms, maximum)), Limits(), quiet)


@pytest.mark.parametrize("place", COARSE)
@pytest.mark.parametrize("factor", [0.7, 1.4])
def test_distances_that_are_a_little_false_are_refused(place: int, factor: float) -> None:
    row = read_container(MANY_STATES)[0].levels[place]
    with pytest.raises(MeshtideError, match="a mean distance from the finest mesh"):
        check_stream(changed(claim(place, row.rms * factor, row.maximum)), Limits(), quiet)
    with pytest.raises(MeshtideError, match="distance from the finest mesh"):
        check_stream(changed(claim(place, row.rms, row.rms if factor < 1 else 2 * row.maximum)), Limits(), quiet)


@pytest.mark.parametrize("place", COARSE)
@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_what_other_samples_may_tell_is_believed(place: int, factor: float) -> None:
    row = read_container(MANY_STATES)[0].levels[place]
    check_stream(changed(claim(place, *stored_distances(row.rms * factor, row.maximum))), Limits(), quiet)


def test_a_preview_as_near_as_the_mesh_itself_is_refused() -> None:
    with pytest.raises(MeshtideError, match="a mean distance from the finest mesh of 0 of"):
        check_stream(changed(claim(0, 0.0, 0.0)), Limits(), quiet)


@pytest.mark.parametrize("options", [CompactOptions(), CompactOptions(effort="high"), ClassicOptions()])
@pytest.mark.parametrize("make", [flat, single_vertex, far_vertex, points], ids=lambda make: make.__name__)
def test_what_the_encoder_writes_of_odd_meshes_is_believed(make: Callable[[], Mesh], options: Profile) -> None:
    check_stream(encode(make(), options).to_bytes(), Limits(), quiet)


def test_of_a_mesh_much_smaller_than_its_grid_the_encoder_is_believed() -> None:
    """Coarse levels are drawn farther away than distances can be stored."""
    mesh = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2], [1, 2, 3]])
    encoded = encode(mesh, grid=Grid(origin=(-1e3, -1e3, -1e3), extent=1e5))
    check_stream(encoded.to_bytes(), Limits(), quiet)


@pytest.mark.parametrize(("origin", "extent"), [((0.0, 0.0, 0.0), 0.0), ((1e9, -1e9, 1e9), 1e-9)])
def test_vertices_that_are_all_one_point_are_refused(origin: tuple[float, float, float], extent: float) -> None:
    with pytest.raises(MeshtideError, match="a grid of one point for several vertices"):
        check_stream(changed(lambda header: replace(header, origin=origin, extent=extent)), Limits(), quiet)


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
