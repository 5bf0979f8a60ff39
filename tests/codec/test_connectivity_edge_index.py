"""Look-ups of directed edges agree with a plain search, for short lists and for long ones."""

from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.connectivity.edge_index_kernels import find_entry, first_entry, index_edges, sorted_faces


def plain_entries(faces: np.ndarray) -> list[tuple[int, int, int, int]]:
    return sorted(
        (face[corner], face[(corner + 1) % 3], face[(corner + 2) % 3], row)
        for row, face in enumerate(faces.tolist())
        for corner in range(3)
    )


@pytest.mark.parametrize(("vertex_count", "face_count"), [(1, 0), (6, 40), (40, 300), (9, 2000)])
def test_entries_and_look_ups_match_a_plain_search(vertex_count: int, face_count: int) -> None:
    random = np.random.default_rng(vertex_count)
    faces = random.integers(0, vertex_count, (face_count, 3)).astype(np.int32)
    index = index_edges(faces, vertex_count, np.ones(face_count, np.int8))
    expected = plain_entries(faces)
    origins = np.repeat(np.arange(vertex_count), np.diff(index.start))
    found = list(zip(origins.tolist(), index.target.tolist(), index.apex.tolist(), strict=True))
    assert found == [entry[:3] for entry in expected]
    for origin, target, apex in random.integers(0, vertex_count, (200, 3)).tolist():
        first = next((i for i, entry in enumerate(found) if entry >= (origin, target, apex)), len(found))
        assert first_entry.py_func(index, origin, target, apex) == min(first, index.start[origin + 1])
        entry = find_entry.py_func(index, origin, target, apex)
        assert (entry >= 0) == ((origin, target, apex) in found)
        if entry >= 0:
            assert {origin, target, apex} == set(faces[index.face[entry]].tolist())


def test_faces_that_are_not_included_are_not_found() -> None:
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    index = index_edges(faces, 4, np.array([0, 1], np.int8))
    assert find_entry.py_func(index, 0, 1, 2) == -1
    assert find_entry.py_func(index, 3, 0, 2) >= 0


def test_sorted_faces_are_rotated_and_in_order() -> None:
    triangles = np.array([[3, 1, 2, 9], [2, 0, 1, 9], [0, 3, 1, 9], [1, 3, 2, 9]], np.int32)
    assert sorted_faces(triangles, 4).tolist() == [[0, 1, 2], [0, 3, 1], [1, 2, 3], [1, 3, 2]]
