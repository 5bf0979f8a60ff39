"""Maps: round trips over all depths, with and without symmetry; damaged and hostile payloads."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.compact.level import Level, root_level
from meshtide_codec.compact.map_coder import read_map
from meshtide_codec.compact.mirror import Mirror, find_mirror
from meshtide_codec.compact.models import Models, new_deep_map_models, new_map_models
from meshtide_codec.compact.octree import Octree, build_octree
from meshtide_codec.entropy.codec import PayloadReader
from meshtide_codec.errors import MapConnError
from meshtide_codec.quantize import morton_codes
from octrees import lattice_soup, torus
from payloads import decode_map, encode_map


def models_of(*, deep: bool) -> Models:
    return new_deep_map_models() if deep else new_map_models()


def all_maps(octree: Octree, mirror: Mirror | None, *, deep: bool = False) -> list[bytes]:
    models = models_of(deep=deep)
    pairs = zip(octree.levels, octree.levels[1:], strict=False)
    return [encode_map(a, b, octree.bits, models, mirror) for a, b in pairs if not a.all_leaves]


def check_round_trip(octree: Octree, mirror: Mirror | None, *, deep: bool = False) -> int:
    maps = all_maps(octree, mirror, deep=deep)
    models = models_of(deep=deep)
    count = len(octree.positions)
    level = root_level(count)
    for payload, true in zip(maps, octree.levels[1:], strict=False):
        reader = PayloadReader(payload)
        level = read_map(reader, level, octree.bits, models, count, mirror)
        assert reader.finished
        assert same(level, true)
        assert true.faces is not None
        level = level.with_faces(true.faces)
    assert level.all_leaves
    return sum(map(len, maps))


def same(one: Level, other: Level) -> bool:
    pairs = (
        (one.cells, other.cells),
        (one.cell_depths, other.cell_depths),
        (one.leaves, other.leaves),
        (one.parents, other.parents),
    )
    return one.depth == other.depth and all(np.array_equal(a, b) for a, b in pairs)


def test_torus_round_trip_and_size() -> None:
    octree = torus(96, 48, 10)
    size = check_round_trip(octree, None)
    assert size * 8 < 4.5 * len(octree.positions)


def test_effort_high_pays() -> None:
    octree = torus(96, 48, 10)
    assert check_round_trip(octree, None, deep=True) < 0.97 * check_round_trip(octree, None)


@pytest.mark.parametrize("deep", [False, True])
def test_symmetry_pays(deep: bool) -> None:
    octree = torus(96, 48, 10)
    mirror = find_mirror(octree.positions, 10)
    assert mirror is not None
    assert check_round_trip(octree, mirror, deep=deep) < 0.95 * check_round_trip(octree, None, deep=deep)


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 80),
    st.integers(0, 80),
    st.integers(4, 8),
    st.booleans(),
    st.booleans(),
)
def test_any_triangle_soup_round_trips(
    seed: int, vertices: int, faces: int, bits: int, mirrored: bool, deep: bool
) -> None:
    octree = lattice_soup(seed, vertices, faces, bits)
    mirror = Mirror(seed % 3, seed % (2 << octree.bits), octree.bits) if mirrored else None
    check_round_trip(octree, mirror, deep=deep)


@pytest.mark.parametrize("deep", [False, True])
@pytest.mark.parametrize("bits", [1, 2, 3])
def test_every_cell_of_a_full_grid(bits: int, deep: bool) -> None:
    grid = np.stack(np.meshgrid(*[np.arange(1 << bits)] * 3, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.int32)
    order = np.argsort(morton_codes(grid), kind="stable")
    octree = build_octree(grid[order], np.zeros((0, 3), np.int32), bits)
    check_round_trip(octree, Mirror(1, (1 << bits) - 1, bits), deep=deep)


def test_encoding_is_deterministic_and_leaves_its_input_alone() -> None:
    octree = torus(24, 12, 8)
    before = [level.cells.copy() for level in octree.levels]
    assert all_maps(octree, None) == all_maps(octree, None)
    assert all(np.array_equal(a, level.cells) for a, level in zip(before, octree.levels, strict=True))


@pytest.mark.parametrize("deep", [False, True])
def test_a_map_that_claims_too_many_vertices_stops(deep: bool) -> None:
    octree = torus(48, 24, 9)
    payload = all_maps(octree, None, deep=deep)[0]
    fine = octree.levels[1]
    needed = 2 * fine.vertex_count - int(fine.leaves.sum())
    with pytest.raises(MapConnError, match="claims more than"):
        decode_map(payload, root_level(needed), 9, models_of(deep=deep), needed - 1)


def test_leaves_must_add_up_to_the_promised_vertices() -> None:
    octree = lattice_soup(1, 4, 0, 4)
    maps = all_maps(octree, None)
    level, models, count = root_level(5), new_map_models(), len(octree.positions) + 1
    with pytest.raises(MapConnError, match="promises"):
        for payload in maps:
            level = decode_map(payload, level, octree.bits, models, count).with_faces(np.zeros((0, 3), np.int32))


def test_a_map_without_anything_to_split_is_out_of_place() -> None:
    with pytest.raises(MapConnError, match="out of place"):
        decode_map(b"", root_level(1), 8, new_map_models(), 1)


@settings(deadline=None, max_examples=90)
@given(st.binary(max_size=200), st.integers(2, 3000), st.integers(1, 20), st.booleans(), st.booleans())
def test_random_bytes_end_in_a_level_or_an_error(
    payload: bytes, count: int, bits: int, mirrored: bool, deep: bool
) -> None:
    level, models = root_level(count), models_of(deep=deep)
    mirror = Mirror(0, (1 << bits) - 1, bits) if mirrored else None
    try:
        while not level.all_leaves:
            level = decode_map(payload, level, bits, models, count, mirror)
            assert level.vertex_count <= count
            assert (np.diff(level.codes) > 0).all()
            fan = np.arange(level.vertex_count, dtype=np.int32)
            level = level.with_faces(np.stack([fan, np.roll(fan, 1), np.roll(fan, 2)], axis=1))
    except MapConnError:
        return
    assert level.vertex_count == count
