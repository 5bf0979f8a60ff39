"""Faces to bytes and back: every triangle set round-trips, no payload does harm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.connectivity import new_models, read_faces
from meshtide_codec.entropy.codec import PayloadReader
from meshtide_codec.errors import MapConnError, MeshError
from payloads import decode_faces, encode_faces

if TYPE_CHECKING:
    from numpy.typing import NDArray

NO_FACES = np.zeros((0, 3), np.int32)


def canonical(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """The definition: no degenerate faces, smallest corner first, sorted, each once."""
    kept = set()
    for a, b, c in faces.tolist():
        if len({a, b, c}) == 3:
            kept.add(min((a, b, c), (b, c, a), (c, a, b)))
    return np.array(sorted(kept), np.int32).reshape(-1, 3)


def checked_round_trip(
    faces: NDArray[np.int32], parents: NDArray[np.int32], positions: NDArray[np.int32] | None = None
) -> bytes:
    faces = canonical(faces)
    coarse_faces = canonical(parents[faces])
    coarse_count = int(parents[-1]) + 1
    payload = encode_faces(faces, parents, coarse_faces, coarse_count, positions)
    reader = PayloadReader(payload)
    decoded = read_faces(reader, parents, coarse_faces, coarse_count, len(faces), positions)
    assert reader.finished
    assert decoded.dtype == np.int32
    np.testing.assert_array_equal(decoded, faces)
    return payload


def checked_deep_round_trip(
    faces: NDArray[np.int32], parents: NDArray[np.int32], positions: NDArray[np.int32]
) -> bytes:
    faces = canonical(faces)
    arguments = parents, canonical(parents[faces]), int(parents[-1]) + 1
    payload = encode_faces(faces, *arguments, positions, new_models(geometric=True, deep=True))
    np.testing.assert_array_equal(decoded_deeply(payload, *arguments, len(faces), positions), faces)
    return payload


def decoded_deeply(
    payload: bytes,
    parents: NDArray[np.int32],
    coarse_faces: NDArray[np.int32],
    coarse_count: int,
    face_count: int,
    positions: NDArray[np.int32],
) -> NDArray[np.int32]:
    models = new_models(geometric=True, deep=True)
    return decode_faces(payload, parents, coarse_faces, coarse_count, face_count, positions, models)


def families(sizes: list[int]) -> NDArray[np.int32]:
    return np.repeat(np.arange(len(sizes)), sizes).astype(np.int32)


def grid(rows: int, columns: int) -> NDArray[np.int32]:
    """A triangulated rectangle of rows * columns vertices."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + columns], axis=1)
    upper = np.stack([corner + 1, corner + columns + 1, corner + columns], axis=1)
    return np.concatenate([lower, upper]).astype(np.int32)


@st.composite
def levels(draw: st.DrawFn) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Any triangles over any families, with any positions."""
    sizes = draw(st.lists(st.sampled_from([1, 1, 1, 2, 3, 8]), min_size=1, max_size=12))
    parents = families(sizes)
    corner = st.integers(0, len(parents) - 1)
    faces = draw(st.lists(st.tuples(corner, corner, corner), max_size=60))
    coordinate = st.integers(-4, 4) if draw(st.booleans()) else st.integers(-(1 << 21), 1 << 21)
    triples = st.tuples(coordinate, coordinate, coordinate)
    positions = draw(st.lists(triples, min_size=len(parents), max_size=len(parents)))
    return canonical(np.array(faces, np.int32).reshape(-1, 3)), parents, np.array(positions, np.int32)


@given(levels(), st.booleans())
@settings(max_examples=150, deadline=None)
def test_any_triangle_set_round_trips(
    level: tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]], geometric: bool
) -> None:
    faces, parents, positions = level
    checked_round_trip(faces, parents, positions if geometric else None)


@given(levels())
@settings(max_examples=80, deadline=None)
def test_any_triangle_set_round_trips_deeply(
    level: tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]],
) -> None:
    checked_deep_round_trip(*level)


@pytest.mark.parametrize("geometric", [False, True])
@pytest.mark.parametrize(
    ("faces", "sizes"),
    [
        pytest.param([], [1], id="one vertex"),
        pytest.param([], [3, 1, 2], id="isolated vertices"),
        pytest.param([[0, 1, 2]], [3], id="one triangle"),
        pytest.param([[0, 1, 2], [0, 2, 1]], [3], id="opposite faces over a point"),
        pytest.param([[0, 1, 2], [0, 2, 1]], [1, 1, 1], id="opposite faces, nothing split"),
        pytest.param([[0, 1, 2], [0, 2, 1]], [2, 1], id="opposite faces over an edge"),
        pytest.param([[0, 1, 2], [0, 1, 3], [0, 1, 4], [1, 0, 5]], [1, 1, 4], id="four faces at an edge"),
        pytest.param([[0, 1, 2], [2, 3, 4]], [1, 2, 1, 1], id="two triangles at a vertex"),
        pytest.param([[0, 1, 2], [3, 4, 5]], [1, 1, 2, 1, 1], id="two components"),
        pytest.param([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], [1, 1, 1, 1], id="tetrahedron, nothing split"),
        pytest.param([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], [2, 2], id="tetrahedron over an edge"),
    ],
)
def test_small_cases(faces: list[list[int]], sizes: list[int], geometric: bool) -> None:
    parents = families(sizes)
    positions = np.random.default_rng(1).integers(0, 9, (len(parents), 3)).astype(np.int32)
    checked_round_trip(np.array(faces, np.int32).reshape(-1, 3), parents, positions if geometric else None)
    checked_deep_round_trip(np.array(faces, np.int32).reshape(-1, 3), parents, positions)


def test_faces_without_split_corners_cost_nothing() -> None:
    faces = grid(20, 20)
    assert checked_round_trip(faces, np.arange(400, dtype=np.int32)) == b""


def test_input_order_and_rotation_do_not_matter() -> None:
    faces = canonical(grid(9, 9))
    parents = families([1, 2] * 27)
    coarse_faces = canonical(parents[faces])
    payload = encode_faces(faces, parents, coarse_faces, 54)
    shuffled = np.roll(faces[np.random.default_rng(3).permutation(len(faces))], 1, axis=1)
    again = encode_faces(shuffled, parents, coarse_faces, 54)
    decoded = decode_faces(again, parents, coarse_faces, 54, len(faces))
    np.testing.assert_array_equal(decoded, faces)
    assert payload == again


def test_positions_help() -> None:
    rows = columns = 40
    faces = grid(rows, columns)
    place = np.stack([np.arange(1600) // columns * 4, np.arange(1600) % columns * 4], axis=1)
    cells = place // 16
    order = np.lexsort((cells[:, 1], cells[:, 0]))
    rank = np.argsort(order)
    faces = rank[faces].astype(np.int32)
    parents = np.unique(cells[order], axis=0, return_inverse=True)[1].ravel().astype(np.int32)
    positions = np.column_stack([place[order], np.zeros(1600, int)]).astype(np.int32)
    with_positions = checked_round_trip(faces, parents, positions)
    without = checked_round_trip(faces, parents)
    assert len(with_positions) < 0.6 * len(without)


@pytest.mark.parametrize("geometric", [False, True])
def test_huge_family_and_huge_valence(geometric: bool) -> None:
    """A fan of 20000 triangles at one vertex, all in one family: linear work, still exact."""
    count = 20000
    rim = np.arange(1, count)
    faces = np.stack([np.zeros(count - 1, int), rim, np.roll(rim, -1)], axis=1).astype(np.int32)
    parents = np.zeros(count, np.int32)
    angles = np.arange(count)
    positions = np.stack([angles, angles**2 % 1000, angles % 7], axis=1).astype(np.int32)
    checked_round_trip(faces, parents, positions if geometric else None)


def test_huge_family_deeply() -> None:
    """As above; spheres are looked into up to a limit only."""
    count = 4000
    rim = np.arange(1, count)
    faces = np.stack([np.zeros(count - 1, int), rim, np.roll(rim, -1)], axis=1).astype(np.int32)
    angles = np.arange(count)
    positions = np.stack([angles, angles**2 % 1000, angles % 7], axis=1).astype(np.int32)
    payload = checked_deep_round_trip(faces, np.zeros(count, np.int32), positions)
    assert len(payload) < len(checked_round_trip(faces, np.zeros(count, np.int32), positions))


def test_huge_fan_over_a_fan() -> None:
    """A coarse vertex with 20000 faces and two children: look-ups must not scan its faces."""
    count = 20000
    rim = np.arange(2, count)
    faces = np.stack([rim % 2, rim, np.roll(rim, -1)], axis=1).astype(np.int32)
    checked_round_trip(faces, families([2, *[1] * (count - 2)]))


def test_many_faces_at_one_edge() -> None:
    count = 3000
    apexes = np.arange(2, count)
    faces = np.stack([np.zeros_like(apexes), np.ones_like(apexes), apexes], axis=1).astype(np.int32)
    checked_round_trip(faces, np.zeros(count, np.int32))
    checked_round_trip(faces, families([1, 1, *[2] * ((count - 2) // 2)]))


def sample() -> tuple[bytes, NDArray[np.int32], NDArray[np.int32], int, int]:
    faces = canonical(grid(12, 12))
    parents = families([3] * 48)
    coarse_faces = canonical(parents[faces])
    return encode_faces(faces, parents, coarse_faces, 48), parents, coarse_faces, 48, len(faces)


@given(st.binary(max_size=200), st.integers(0, 300))
@settings(max_examples=150, deadline=None)
def test_hostile_payloads_only_raise(payload: bytes, face_count: int) -> None:
    _, parents, coarse_faces, coarse_count, _ = sample()
    try:
        faces = decode_faces(payload, parents, coarse_faces, coarse_count, face_count)
    except MapConnError:
        return
    assert faces.shape == (face_count, 3)
    np.testing.assert_array_equal(faces, canonical(faces))
    assert face_count == 0 or (faces.min() >= 0 and faces.max() < len(parents))


def test_truncated_and_changed_payloads_never_pass_for_the_original() -> None:
    payload, parents, coarse_faces, coarse_count, face_count = sample()
    original = decode_faces(payload, parents, coarse_faces, coarse_count, face_count)
    damaged = [payload[:length] for length in range(len(payload))]
    damaged += [payload[:i] + bytes([payload[i] ^ 0x41]) + payload[i + 1 :] for i in range(len(payload))]
    for candidate in damaged:
        try:
            faces = decode_faces(candidate, parents, coarse_faces, coarse_count, face_count)
        except MapConnError:
            continue
        assert faces.shape == original.shape
        np.testing.assert_array_equal(faces, canonical(faces))


def deep_sample() -> tuple[bytes, NDArray[np.int32], NDArray[np.int32], int, int, NDArray[np.int32]]:
    faces = canonical(grid(12, 12))
    parents = families([3] * 48)
    coarse_faces = canonical(parents[faces])
    places = np.arange(144)
    positions = np.stack([places // 12 * 4, places % 12 * 4, places % 5], axis=1).astype(np.int32)
    payload = encode_faces(faces, parents, coarse_faces, 48, positions, new_models(geometric=True, deep=True))
    return payload, parents, coarse_faces, 48, len(faces), positions


@given(st.binary(max_size=200), st.integers(0, 300))
@settings(max_examples=80, deadline=None)
def test_hostile_deep_payloads_only_raise(payload: bytes, face_count: int) -> None:
    _, parents, coarse_faces, coarse_count, _, positions = deep_sample()
    try:
        faces = decoded_deeply(payload, parents, coarse_faces, coarse_count, face_count, positions)
    except MapConnError:
        return
    assert faces.shape == (face_count, 3)
    np.testing.assert_array_equal(faces, canonical(faces))
    assert face_count == 0 or (faces.min() >= 0 and faces.max() < len(parents))


def test_truncated_and_changed_deep_payloads_never_pass_for_the_original() -> None:
    payload, *arguments = deep_sample()
    original = decoded_deeply(payload, *arguments)
    damaged = [payload[:length] for length in range(len(payload))]
    damaged += [payload[:i] + bytes([payload[i] ^ 0x41]) + payload[i + 1 :] for i in range(len(payload))]
    different = 0
    for candidate in damaged:
        try:
            faces = decoded_deeply(candidate, *arguments)
        except MapConnError:
            different += 1
            continue
        assert faces.shape == original.shape
        np.testing.assert_array_equal(faces, canonical(faces))
        different += not np.array_equal(faces, original)
    assert different > len(payload)


def test_wrong_face_counts_are_refused() -> None:
    _, _, coarse_faces, coarse_count, _ = sample()
    unsplit = np.arange(48, dtype=np.int32)
    with pytest.raises(MapConnError, match="more faces are copied"):
        decode_faces(b"", unsplit, coarse_faces, coarse_count, len(coarse_faces) - 1)
    with pytest.raises(MapConnError, match="fewer faces than announced|faces are missing"):
        decode_faces(b"", unsplit, coarse_faces, coarse_count, len(coarse_faces) + 1)


@pytest.mark.parametrize(
    ("parents", "coarse_faces", "coarse_count", "positions", "message"),
    [
        pytest.param([], [], 1, None, "0 fine vertices", id="no vertices"),
        pytest.param([0, 1], [], 3, None, "2 fine vertices", id="fewer children than parents"),
        pytest.param([0], [], 0, None, "1 fine vertices", id="no parents"),
        pytest.param([0, 2], [], 2, None, "without gaps", id="gap"),
        pytest.param([1, 0], [], 2, None, "without gaps", id="falling"),
        pytest.param([0, 0, 1], [], 1, None, "without gaps", id="beyond the last parent"),
        pytest.param([0, 1, 2], [[0, 1, 3]], 3, None, "coarse faces", id="coarse index too large"),
        pytest.param([0, 1, 2], [[0, 1, -1]], 3, None, "coarse faces", id="coarse index negative"),
        pytest.param([0, 1, 2], [[0, 1]], 3, None, "coarse faces", id="coarse edges"),
        pytest.param([0, 1, 2], [], 3, [[0, 0, 0]], "positions", id="too few positions"),
    ],
)
def test_arguments_are_checked(
    parents: list[int],
    coarse_faces: list[list[int]],
    coarse_count: int,
    positions: list[list[int]] | None,
    message: str,
) -> None:
    fine_parents = np.array(parents, np.int32)
    faces_above = np.array(coarse_faces, np.int32) if coarse_faces else NO_FACES
    places = None if positions is None else np.array(positions, np.int32)
    with pytest.raises(MapConnError, match=message):
        decode_faces(b"\0", fine_parents, faces_above, coarse_count, 1, places)
    with pytest.raises(MeshError, match=message):
        encode_faces(NO_FACES, fine_parents, faces_above, coarse_count, places)


@pytest.mark.parametrize(
    "faces",
    [
        pytest.param([[0, 1, 4]], id="index too large"),
        pytest.param([[0, 1, 1]], id="repeated corner"),
        pytest.param([[0, 1, 2], [1, 2, 0]], id="repeated face"),
    ],
)
def test_encoder_refuses_bad_faces(faces: list[list[int]]) -> None:
    with pytest.raises(MeshError, match="connectivity cannot be coded"):
        encode_faces(np.array(faces, np.int32), np.zeros(4, np.int32), NO_FACES, 1)


def test_encoder_refuses_foreign_coarse_faces() -> None:
    parents = families([1, 1, 2])
    with pytest.raises(MeshError, match="not what the fine ones collapse to"):
        encode_faces(np.array([[0, 2, 3]], np.int32), parents, np.array([[0, 1, 2]], np.int32), 3)
    with pytest.raises(MeshError, match="not what the fine ones collapse to"):
        encode_faces(np.array([[0, 2, 1]], np.int32), np.arange(3, dtype=np.int32), np.array([[0, 1, 2]], np.int32), 3)


GOLDEN_FACES = canonical(grid(6, 6)[:-3])


@pytest.mark.parametrize(
    ("geometric", "expected"),
    [(False, "f3aa101b6e8a6cad7f642033468485e02e8c3c40"), (True, "f3a1ffacbbd0cc409af83a9be8870980")],
)
def test_exact_bytes(geometric: bool, expected: str) -> None:
    """The payload is part of the format: if this changes, old streams cannot be read."""
    places = np.arange(36)
    positions = np.stack([places // 6 * 4, places % 6 * 4, places % 5], axis=1).astype(np.int32)
    payload = checked_round_trip(GOLDEN_FACES, families([3] * 12), positions if geometric else None)
    assert payload.hex() == expected


def test_exact_deep_bytes() -> None:
    """The same for faces that are coded deeply."""
    places = np.arange(36)
    positions = np.stack([places // 6 * 4, places % 6 * 4, places % 5], axis=1).astype(np.int32)
    payload = checked_deep_round_trip(GOLDEN_FACES, families([3] * 12), positions)
    assert payload.hex() == "efaa774a323740"
