"""Half-edges: what a gate looks at is bounded, however many faces share its ends."""

from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity.half_edge_kernels import SCAN_LIMIT, FineMesh, attach_anywhere, write_corners

GATE = 7


def fan(count: int) -> FineMesh:
    """The half-edges of `count` triangles around vertex 0, as they stand when all are known."""
    vertices = np.zeros((count + 2, half_edges.VERTEX_COLUMNS), np.int32)
    vertices[:, half_edges.HEAD] = half_edges.NONE
    triangles = np.empty((count, half_edges.TRIANGLE_COLUMNS), np.int32)
    mesh = FineMesh(np.zeros(count + 2, np.int32), triangles, vertices)
    for triangle in range(count):
        write_corners(mesh, triangle, 0, triangle + 1, triangle + 2)
        attach_anywhere(mesh, triangle)
    return mesh


@pytest.mark.parametrize("count", [40, 1000, 20_000])
def test_a_gate_at_a_hub_marks_no_more_than_the_newest_surroundings(count: int) -> None:
    mesh = fan(count)
    half_edges.mark_surroundings(mesh, 0, count + 1, GATE)
    marked = 1 + np.flatnonzero(mesh.vertices[1:, half_edges.MARK] == GATE)  # besides the hub
    assert len(marked) == min(count, SCAN_LIMIT) + 1
    assert marked.min() == max(1, count + 1 - SCAN_LIMIT)


def test_neighbours_in_a_fan_are_twins_whatever_its_size() -> None:
    mesh = fan(5000)
    for triangle in range(1, 5000):
        before = 4 * (triangle - 1) + 2  # from the newer rim vertex of the triangle before to the hub
        assert half_edges.field(mesh.triangles, 4 * triangle, half_edges.TWIN) == before
