"""Diffs: round trips over all depths, slices, symmetry, losses; what is known when some are missing."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.compact.diff_coder import SliceState, has_diff, known_positions, new_slice_state
from meshtide_codec.compact.mirror import Mirror, find_mirror
from meshtide_codec.compact.octree import Octree, build_octree
from meshtide_codec.compact.slices import Slices, even_slices
from meshtide_codec.errors import DiffError, OptionError
from octrees import lattice_soup, torus
from payloads import decode_diff, encode_diff

Packets = dict[tuple[int, int], bytes]


def fresh_states(octree: Octree, slices: Slices, *, deep: bool = False) -> list[SliceState]:
    return [new_slice_state(octree.levels[0], slices, index, deep=deep) for index in range(len(slices))]


def all_diffs(octree: Octree, slices: Slices, mirror: Mirror | None = None, *, deep: bool = False) -> Packets:
    packets = {}
    for index, state in enumerate(fresh_states(octree, slices, deep=deep)):
        for depth in range(1, octree.bits + 1):
            assert has_diff(octree.levels[depth], slices, index) == (len(state.cells) > 0)
            packets[depth, index] = encode_diff(octree, depth, state, slices, index, mirror)
    return packets


def decoded(
    octree: Octree, slices: Slices, packets: Packets, mirror: Mirror | None = None, *, deep: bool = False
) -> list[SliceState]:
    """States after all packets of each slice up to its first missing one."""
    states = fresh_states(octree, slices, deep=deep)
    for index, state in enumerate(states):
        for depth in range(1, octree.bits + 1):
            if (depth, index) not in packets:
                break
            decode_diff(packets[depth, index], octree.levels[depth], state, slices, index, mirror)
    return states


def finest(octree: Octree, states: list[SliceState], slices: Slices) -> bool:
    middles, depths = known_positions(octree.levels[-1], states, slices)
    return bool((middles == 2 * octree.positions + 1).all()) and bool((depths == octree.bits).all())


def size(packets: Packets) -> int:
    return sum(map(len, packets.values()))


def cut(octree: Octree, count: int) -> Slices:
    split = next(level for level in octree.levels if level.all_leaves)
    return even_slices(split, octree.bits, count)


def test_torus_round_trip_and_size() -> None:
    octree = torus(96, 48, 12)
    slices = Slices(12)
    packets = all_diffs(octree, slices)
    assert size(packets) * 8 < 8.5 * len(octree.positions)
    assert finest(octree, decoded(octree, slices, packets), slices)


def test_effort_high_pays() -> None:
    octree = torus(96, 48, 12)
    slices = Slices(12)
    packets = all_diffs(octree, slices, deep=True)
    assert finest(octree, decoded(octree, slices, packets, deep=True), slices)
    assert size(packets) < 0.97 * size(all_diffs(octree, slices))


@pytest.mark.parametrize("deep", [False, True])
def test_symmetry_pays(deep: bool) -> None:
    octree = torus(96, 48, 12)
    slices = Slices(12)
    mirror = find_mirror(octree.positions, 12)
    packets = all_diffs(octree, slices, mirror, deep=deep)
    assert finest(octree, decoded(octree, slices, packets, mirror, deep=deep), slices)
    assert size(packets) < 0.75 * size(all_diffs(octree, slices, deep=deep))


def test_slices_cost_little_and_cover_everything() -> None:
    octree = torus(96, 48, 12)
    slices = cut(octree, 4)
    assert len(slices) == 4
    for level in octree.levels:
        ranges = [slices.vertices(level, index) for index in range(4)]
        assert ranges[0].start == 0
        assert ranges[-1].stop == level.vertex_count
        assert all(a.stop == b.start for a, b in itertools.pairwise(ranges))
    packets = all_diffs(octree, slices)
    assert finest(octree, decoded(octree, slices, packets), slices)
    assert size(packets) < 1.25 * size(all_diffs(octree, Slices(12)))


@pytest.mark.parametrize("deep", [False, True])
def test_slices_decode_without_each_other(deep: bool) -> None:
    octree = torus(48, 24, 11)
    slices = cut(octree, 5)
    packets = all_diffs(octree, slices, deep=deep)
    whole = decoded(octree, slices, packets, deep=deep)
    for index in range(len(slices)):
        mine = {key: value for key, value in packets.items() if key[1] == index}
        alone = decoded(octree, slices, mine, deep=deep)
        assert np.array_equal(alone[index].cells, whole[index].cells)


@pytest.mark.parametrize("depth", [1, 6, 8, 11])
def test_what_a_missing_diff_leaves_behind(depth: int) -> None:
    octree = torus(48, 24, 11)
    slices = cut(octree, 3)
    packets = {key: value for key, value in all_diffs(octree, slices).items() if key != (depth, 1)}
    states = decoded(octree, slices, packets)
    assert [state.depth for state in states] == [11, depth - 1, 11]
    for level in octree.levels:
        middles, depths = known_positions(level, states, slices)
        leaves = np.flatnonzero(level.leaves)
        true = 2 * octree.positions[octree.first_vertices[level.depth][leaves]].astype(np.int64) + 1
        assert (np.abs(middles[leaves] - true) <= (1 << (11 - depths[leaves].astype(np.int64)))[:, None]).all()
    with pytest.raises(DiffError, match="needs those before it"):
        later = all_diffs(octree, slices)[11, 1] if depth < 11 else b""
        decode_diff(later, octree.levels[min(depth + 1, 11)] if depth < 11 else octree.levels[1], states[1], slices, 1)


def test_a_late_diff_goes_on_where_the_slice_stopped() -> None:
    octree = torus(48, 24, 11)
    slices = cut(octree, 2)
    packets = all_diffs(octree, slices)
    states = decoded(octree, slices, {key: value for key, value in packets.items() if key != (7, 0)})
    for depth in range(7, 12):
        decode_diff(packets[depth, 0], octree.levels[depth], states[0], slices, 0)
    assert finest(octree, states, slices)


def test_states_of_another_stream_are_refused() -> None:
    one, other = torus(24, 12, 10), torus(20, 12, 10)
    slices = Slices(10)
    state = decoded(one, slices, {key: value for key, value in all_diffs(one, slices).items() if key[0] < 10})[0]
    with pytest.raises(DiffError, match="different streams"):
        decode_diff(b"", other.levels[10], state, slices, 0)


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 60),
    st.integers(0, 80),
    st.integers(4, 9),
    st.integers(1, 4),
    st.booleans(),
    st.booleans(),
)
def test_any_triangle_soup_round_trips(
    seed: int, vertices: int, faces: int, bits: int, parts: int, mirrored: bool, deep: bool
) -> None:
    octree = lattice_soup(seed, vertices, faces, bits)
    mirror = Mirror(seed % 3, seed % (2 << bits), bits) if mirrored else None
    slices = cut(octree, parts)
    packets = all_diffs(octree, slices, mirror, deep=deep)
    assert finest(octree, decoded(octree, slices, packets, mirror, deep=deep), slices)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.binary(max_size=60), min_size=10, max_size=10), st.booleans(), st.booleans())
def test_random_bytes_stay_within_the_leaf_cells(payloads: list[bytes], mirrored: bool, deep: bool) -> None:
    octree = torus(12, 8, 10)
    slices = Slices(10)
    mirror = Mirror(2, 400, 10) if mirrored else None
    state = new_slice_state(octree.levels[0], slices, 0, deep=deep)
    for depth, payload in enumerate(payloads, 1):
        try:
            decode_diff(payload, octree.levels[depth], state, slices, 0, mirror)
        except DiffError:
            break
        level = octree.levels[depth]
        middles, _ = known_positions(level, [state], slices)
        shifts = 10 - level.cell_depths.astype(np.int64)
        assert (middles >> (shifts + 1)[:, None] == level.cells).all()


def test_one_vertex_is_all_diff() -> None:
    octree = build_octree(np.array([[5, 9, 14]], np.int32), np.zeros((0, 3), np.int32), 4)
    slices = Slices(4)
    packets = all_diffs(octree, slices)
    assert finest(octree, decoded(octree, slices, packets), slices)


@pytest.mark.parametrize("starts", [(), (1,), (0, 0), (0, 5, 3), (0, 1 << 12)])
def test_slices_that_do_not_cover_the_grid_in_order_are_refused(starts: tuple[int, ...]) -> None:
    with pytest.raises(OptionError):
        Slices(4, starts)


def test_there_is_at_least_one_slice() -> None:
    octree = torus(12, 8, 8)
    with pytest.raises(OptionError):
        even_slices(octree.levels[8], 8, 0)
    assert len(even_slices(octree.levels[0], 8, 7)) == 1
