"""The vertex graph against sets of edges, and K against its dense matrix."""

from __future__ import annotations

import tracemalloc
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.errors import MeshError
from meshtide_codec.graph import Adjacency, apply_k, build_adjacency

if TYPE_CHECKING:
    from collections.abc import Sequence
    from random import Random

    from numpy.typing import NDArray


def faces_of(rows: Sequence[Sequence[int]]) -> NDArray[np.int32]:
    return np.array(rows, np.int32).reshape(-1, 3)


def dense_k(adjacency: Adjacency) -> NDArray[np.float64]:
    """I - D^-1 M, with rows of zeros for isolated vertices."""
    count = adjacency.vertex_count
    matrix = np.zeros((count, count))
    for vertex in range(count):
        ring = adjacency.neighbours[adjacency.offsets[vertex] : adjacency.offsets[vertex + 1]]
        if len(ring):
            matrix[vertex, vertex] = 1
            matrix[vertex, ring] = -1 / len(ring)
    return matrix


VERTEX_COUNT = 12
face_lists = st.lists(st.tuples(*[st.integers(0, VERTEX_COUNT - 1)] * 3), max_size=40).map(faces_of)


@given(face_lists)
def test_neighbours_are_the_ends_of_unique_edges_in_order(faces: NDArray[np.int32]) -> None:
    rings = [set() for _ in range(VERTEX_COUNT)]
    for face in faces.tolist():
        for first in face:
            rings[first].update(second for second in face if second != first)
    adjacency = build_adjacency(faces, VERTEX_COUNT)
    assert adjacency.neighbours.dtype == np.int32
    assert adjacency.offsets.dtype == np.int64
    assert adjacency.degree.tolist() == [len(ring) for ring in rings]
    for vertex, ring in enumerate(rings):
        found = adjacency.neighbours[adjacency.offsets[vertex] : adjacency.offsets[vertex + 1]]
        assert found.tolist() == sorted(ring)


@given(face_lists, st.randoms(use_true_random=False))
def test_order_and_orientation_of_faces_do_not_matter(faces: NDArray[np.int32], random: Random) -> None:
    shuffled = [random.sample(face, 3) for face in faces.tolist()]
    random.shuffle(shuffled)
    first, second = build_adjacency(faces, VERTEX_COUNT), build_adjacency(faces_of(shuffled), VERTEX_COUNT)
    assert np.array_equal(first.offsets, second.offsets)
    assert np.array_equal(first.neighbours, second.neighbours)


@given(face_lists, st.integers(0, 2**32 - 1))
def test_k_is_its_dense_matrix(faces: NDArray[np.int32], seed: int) -> None:
    adjacency = build_adjacency(faces, VERTEX_COUNT)
    points = np.random.default_rng(seed).uniform(-4096, 4096, (VERTEX_COUNT, 3))
    result = apply_k(adjacency, points)
    np.testing.assert_allclose(result, dense_k(adjacency) @ points, atol=1e-9)
    for axis in range(3):
        assert np.array_equal(apply_k(adjacency, points[:, axis]), result[:, axis])
    assert not result[adjacency.degree == 0].any()


def test_k_is_the_same_bits_as_a_plain_loop() -> None:
    random = np.random.default_rng(3)
    adjacency = build_adjacency(random.integers(0, 300, (400, 3), dtype=np.int32), 310)
    values = random.uniform(-4096, 4096, 310)
    expected = []
    for vertex in range(310):
        ring = adjacency.neighbours[adjacency.offsets[vertex] : adjacency.offsets[vertex + 1]].tolist()
        total = 0.0
        for neighbour in ring:
            total += float(values[neighbour])
        expected.append(float(values[vertex]) - total / len(ring) if ring else 0.0)
    assert apply_k(adjacency, values).tolist() == expected


@given(face_lists)
def test_spectrum_of_k_lies_between_0_and_2(faces: NDArray[np.int32]) -> None:
    eigenvalues = np.linalg.eigvals(dense_k(build_adjacency(faces, VERTEX_COUNT)))
    assert np.abs(eigenvalues.imag).max() < 1e-6
    assert eigenvalues.real.min() > -1e-6
    assert eigenvalues.real.max() < 2 + 1e-6


def test_k_takes_integer_constants_to_exactly_zero() -> None:
    adjacency = build_adjacency(faces_of([[0, 1, 2], [0, 2, 3], [0, 3, 4]]), 6)
    assert not apply_k(adjacency, np.full((6, 3), 1048575.0)).any()


def test_no_faces_and_no_vertices() -> None:
    assert build_adjacency(faces_of([]), 3).degree.tolist() == [0, 0, 0]
    empty = build_adjacency(faces_of([]), 0)
    assert apply_k(empty, np.empty((0, 3))).shape == (0, 3)


def test_a_hub_of_many_faces_and_repeated_faces_take_linear_time_and_memory() -> None:
    count = 100_000
    rim = np.arange(1, count, dtype=np.int32)
    faces = np.stack([np.zeros_like(rim), rim, np.roll(rim, 1)], axis=1)
    faces = np.concatenate([faces, faces])
    build_adjacency(faces[:1], count)
    tracemalloc.start()
    adjacency = build_adjacency(faces, count)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert adjacency.degree[0] == count - 1
    assert (adjacency.degree[1:] == 3).all()
    assert peak < 60 * len(faces) + 48 * count


@pytest.mark.parametrize(
    ("faces", "count", "message"),
    [
        (np.zeros((2, 4), np.int32), 4, r"\(m, 3\)"),
        (np.zeros(6, np.int32), 4, r"\(m, 3\)"),
        (np.zeros((2, 3), np.int64), 4, "int64"),
        (faces_of([[0, 1, 2], [0, 1, 4]]), 4, r"face 1 is \[0, 1, 4\]"),
        (faces_of([[0, -1, 2]]), 4, "face 0"),
        (faces_of([[0, 0, 0]]), 0, "there are 0 vertices"),
        (faces_of([]), -1, "vertex count -1"),
        (faces_of([]), 2**31, "vertex count"),
    ],
)
def test_bad_faces_are_named(faces: NDArray[np.int32], count: int, message: str) -> None:
    with pytest.raises(MeshError, match=message):
        build_adjacency(faces, count)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.zeros(3), "shape"),
        (np.zeros((4, 2)), "shape"),
        (np.zeros(4, np.float32), "float64"),
        (np.array([0, 1, np.nan, 3]), "row 2 is nan"),
        (np.array([[0, 0, 0], [0, 0, np.inf], [0, 0, 0], [0, 0, 0]]), "row 1"),
    ],
)
def test_bad_values_are_named(values: NDArray[np.float64], message: str) -> None:
    with pytest.raises(MeshError, match=message):
        apply_k(build_adjacency(faces_of([[0, 1, 2]]), 4), values)
