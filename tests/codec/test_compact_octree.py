"""The octree of a quantized mesh: groups, leaves, faces per depth; rings; checks of what comes in."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.compact.level import root_level
from meshtide_codec.compact.octree import build_octree
from meshtide_codec.compact.ring_kernels import RING_LIMIT, order_rings
from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.mesh import canonical_faces
from meshtide_codec.quantize import morton_codes

Integers = npt.NDArray[np.int32]


def random_soup(seed: int, vertices: int, faces: int, bits: int) -> tuple[Integers, Integers]:
    generator = np.random.default_rng(seed)
    positions = generator.integers(0, 1 << bits, (vertices, 3)).astype(np.int32)
    _, first = np.unique(morton_codes(positions), return_index=True)
    positions = positions[first]
    return positions, generator.integers(0, len(positions), (faces, 3)).astype(np.int32)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.integers(0, 60), st.integers(1, 7))
def test_levels_group_the_finest_vertices_by_their_uppermost_bits(
    seed: int, vertices: int, faces: int, bits: int
) -> None:
    positions, triangles = random_soup(seed, vertices, faces, bits)
    levels = build_octree(positions, triangles, bits).levels
    assert [level.depth for level in levels] == list(range(bits + 1))
    owners = np.arange(len(positions))
    for depth in range(bits, -1, -1):
        level = levels[depth]
        groups, members = np.unique(positions >> (bits - depth), axis=0, return_inverse=True)
        assert level.vertex_count == len(groups)
        sizes = np.bincount(members.ravel())
        assert (level.leaves[owners] == (sizes[members.ravel()] == 1)).all()
        low = level.cells[owners]
        assert (positions >> (bits - level.cell_depths[owners].astype(np.int64))[:, None] == low).all()
        assert (np.diff(level.codes) > 0).all()
        assert (level.faces == canonical_faces(owners[triangles].astype(np.int32))).all()
        distance = np.abs(2 * positions + 1 - (level.centres[owners].astype(np.int64) << (bits - depth)))
        assert (distance <= (1 << (bits - level.cell_depths[owners].astype(np.int64)))[:, None]).all()
        owners = level.parents[owners]
    assert levels[bits].all_leaves
    assert (levels[bits].cells[levels[bits].cell_depths == bits] == positions[levels[bits].cell_depths == bits]).all()


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 60), st.integers(1, 6))
def test_a_leaf_stays_as_it_is(seed: int, vertices: int, bits: int) -> None:
    positions, triangles = random_soup(seed, vertices, 30, bits)
    levels = build_octree(positions, triangles, bits).levels
    for coarse, fine in itertools.pairwise(levels):
        kept = coarse.leaves[fine.parents]
        assert (fine.leaves[kept]).all()
        assert (fine.cells[kept] == coarse.cells[fine.parents[kept]]).all()
        assert (fine.cell_depths[kept] == coarse.cell_depths[fine.parents[kept]]).all()
        assert (fine.cell_depths[~kept] == fine.depth).all()


def test_a_single_vertex_is_a_leaf_at_once() -> None:
    levels = build_octree(np.array([[5, 0, 7]], np.int32), np.zeros((0, 3), np.int32), 3).levels
    assert all(level.all_leaves for level in levels)
    assert levels[3].cell_depths.tolist() == [0]
    assert levels[3].centres.tolist() == [[8, 8, 8]]


def test_levels_above_which_nothing_splits_share_their_rings() -> None:
    positions = np.array([[0, 0, 0], [0, 0, 15], [0, 15, 0]], np.int32)
    levels = build_octree(positions, np.array([[0, 1, 2]], np.int32), 4).levels
    assert levels[1].all_leaves
    assert levels[4].rings[1] is levels[1].rings[1]


@pytest.mark.parametrize(
    ("positions", "faces", "bits", "error"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3)), 4, MeshError),
        (np.zeros((1, 2)), np.zeros((0, 3)), 4, MeshError),
        (np.zeros((1, 3)), np.zeros((1, 2)), 4, MeshError),
        ([[0, 0, 16]], np.zeros((0, 3)), 4, MeshError),
        ([[0, 0, -1]], np.zeros((0, 3)), 4, MeshError),
        ([[0, 0, 1], [0, 0, 0]], np.zeros((0, 3)), 4, MeshError),
        ([[0, 0, 1], [0, 0, 1]], np.zeros((0, 3)), 4, MeshError),
        ([[0, 0, 1]], [[0, 0, 1]], 4, MeshError),
        ([[0, 0, 1]], [[0, -1, 0]], 4, MeshError),
        ([[0, 0, 1]], np.zeros((0, 3)), 0, OptionError),
        ([[0, 0, 1]], np.zeros((0, 3)), 21, OptionError),
    ],
)
def test_unusable_input_is_refused(positions: Any, faces: Any, bits: int, error: type[Exception]) -> None:
    with pytest.raises(error):
        build_octree(np.asarray(positions, np.int32), np.asarray(faces, np.int32), bits)


def test_faces_and_rings_are_checked() -> None:
    root = root_level(3)
    with pytest.raises(MeshError, match="outside"):
        root.with_faces(np.array([[0, 0, 1]], np.int32))
    with pytest.raises(MeshError, match="Map"):
        root.deepened()
    positions = np.array([[0, 0, 0], [0, 0, 1]], np.int32)
    level = build_octree(positions, np.zeros((0, 3), np.int32), 1).levels[1]
    bare = type(level)(level.depth, level.cells, level.cell_depths, level.leaves, level.parents)
    with pytest.raises(MeshError, match="not known yet"):
        _ = bare.rings


def ring_of(triangles: list[list[int]], vertex: int) -> tuple[list[int], bool]:
    faces = np.asarray(triangles, np.int32)
    starts, members, closed = order_rings(faces, int(faces.max()) + 1)
    return members[starts[vertex] : starts[vertex + 1]].tolist(), bool(closed[vertex])


def test_closed_ring_turns_around_the_vertex() -> None:
    ring, closed = ring_of([[0, 3, 4], [0, 1, 2], [0, 4, 1], [0, 2, 3]], 0)
    assert closed
    assert ring[ring.index(1) :] + ring[: ring.index(1)] == [1, 2, 3, 4]


def test_open_ring_runs_from_border_to_border() -> None:
    assert ring_of([[0, 2, 3], [0, 3, 4], [0, 1, 2]], 0) == ([1, 2, 3, 4], False)


def test_two_fans_stand_one_after_the_other() -> None:
    ring, closed = ring_of([[0, 1, 2], [0, 5, 6], [0, 6, 7]], 0)
    assert not closed
    assert ring == [1, 2, 5, 6, 7]


def test_crowded_vertices_keep_their_wedges_unsorted() -> None:
    count = RING_LIMIT + 1
    faces = [[0, 1 + i, 1 + (i + 1) % count] for i in range(count)]
    ring, closed = ring_of(faces, 0)
    assert not closed
    assert ring == list(range(1, count + 1))


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 12), st.integers(0, 60))
def test_rings_hold_every_neighbour_of_any_triangle_soup(seed: int, vertices: int, count: int) -> None:
    generator = np.random.default_rng(seed)
    faces = canonical_faces(generator.integers(0, vertices, (count, 3)).astype(np.int32))
    starts, members, _ = order_rings(np.ascontiguousarray(faces), vertices)
    for vertex in range(vertices):
        touching = faces[(faces == vertex).any(axis=1)]
        ring = members[starts[vertex] : starts[vertex + 1]]
        assert set(ring.tolist()) == set(touching.ravel().tolist()) - {vertex}
        assert len(ring) <= 2 * len(touching)
