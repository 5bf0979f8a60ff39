"""What is measured of candidates is what the names say, seen on small meshes laid out by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity import property_deep_kernels as kernels
from meshtide_codec.connectivity.candidate_kernels import CORNERS, SIBLING, new_candidates
from meshtide_codec.connectivity.coarse_kernels import build_coarse_mesh
from meshtide_codec.connectivity.half_edge_kernels import FineMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

FIRST, SECOND, KNOWN = 0, 1, 2


def measured(points: list[tuple[int, int, int]], coarse_faces: list[list[int]] | None = None) -> NDArray[np.int32]:
    """Properties of the points from the fourth on, at the gate from the first to the second, before the third.

    All are children of one coarse vertex, or of one each if there are coarse faces.
    """
    count = len(points)
    faces = np.array(coarse_faces or [], np.int32).reshape(-1, 3)
    parents = np.arange(count, dtype=np.int32) if coarse_faces else np.zeros(count, np.int32)
    coarse = build_coarse_mesh(parents, faces, count if coarse_faces else 1)
    vertices = np.zeros((count, half_edges.VERTEX_COLUMNS), np.int32)
    vertices[:, half_edges.HEAD] = half_edges.NONE
    vertices[:, :3] = points
    fine = FineMesh(parents, np.zeros((1, half_edges.TRIANGLE_COLUMNS), np.int32), vertices)
    candidates = new_candidates(len(coarse.activity))
    listed = count - 3
    candidates.vertex[:listed] = np.arange(3, count)
    candidates.kind[:listed] = SIBLING
    candidates.flags[:listed] = candidates.corner[:listed] = 0
    properties = np.zeros((listed, kernels.PROPERTIES), np.int32)
    kernels.measure_candidates(properties, candidates, listed, coarse, fine, FIRST, SECOND, KNOWN)
    return properties


def sphere(properties: NDArray[np.int32]) -> tuple[int, int, int]:
    """Others inside, others near, margin."""
    inside, near = divmod((int(properties[17]) - kernels.SPHERE) // 6, kernels.MOST_NEAR + 1)
    return inside, near, (int(properties[18]) - kernels.MARGIN) // (4 * CORNERS)


GATE = [(0, 0, 0), (8, 0, 0), (4, -8, 0)]


def test_every_place_lies_in_its_own_section() -> None:
    generator = np.random.default_rng(3)
    starts = [
        kernels.KIND, kernels.VALENCE, kernels.BOTH_ENDS, kernels.END_FAMILY, kernels.END_FAMILY, kernels.APEX_FAMILY,
        kernels.LENGTH, kernels.SHORT_LENGTH, kernels.ACROSS, kernels.ANGLE_SUM, kernels.END_ANGLE_SUM,
        kernels.END_ANGLE_SUM, kernels.BEND, kernels.CLOSED_BEND, kernels.CLOSED_BEND, kernels.PARALLELOGRAM,
        kernels.BEND_AND_ANGLE, kernels.SPHERE, kernels.MARGIN,
    ]  # fmt: skip
    bounds = sorted({*starts, kernels.PLACES})
    for spread in (1, 3, 50, 1 << 21):
        points = generator.integers(-spread, spread + 1, (40, 3)).tolist()
        properties = measured(points)
        for index, start in enumerate(starts):
            stop = bounds[bounds.index(start) + 1]
            assert properties[:, index].min() >= start
            assert properties[:, index].max() < stop


def test_a_candidate_that_another_one_is_nearer_than_has_it_in_its_sphere() -> None:
    far, near = measured([*GATE, (4, 40, 0), (4, 6, 0)])
    assert sphere(far)[:2] == (1, 0)
    assert sphere(near)[:2] == (0, 0)
    assert sphere(far)[2] < 8 <= sphere(near)[2]


def test_the_corners_of_a_square_lie_on_one_sphere() -> None:
    one, other = measured([*GATE, (0, 8, 0), (8, 8, 0)])
    assert sphere(one)[:2] == sphere(other)[:2] == (0, 1)


@pytest.mark.parametrize("apex", [(4, 0, 0), (0, 0, 0), (8, 0, 0)])
def test_a_face_without_area_has_everything_inside(apex: tuple[int, int, int]) -> None:
    (properties,) = measured([*GATE, apex])
    assert sphere(properties) == (kernels.MOST_INSIDE, 0, 0)


def test_the_fourth_corner_of_a_parallelogram_is_at_its_place_and_does_not_bend() -> None:
    (properties,) = measured([*GATE, (4, 8, 0)])
    assert properties[15] - kernels.PARALLELOGRAM == 0
    folded = measured([*GATE, (4, -8, 1)])[0]
    assert (folded[15] - kernels.PARALLELOGRAM) % 32 > 16


def test_families_that_lack_faces_are_told_from_those_that_do_not() -> None:
    points = [*GATE, (0, 8, 0)]
    nothing_lacks = measured(points, [[0, 1, 3]])[0]
    assert nothing_lacks[3] == nothing_lacks[4] == kernels.END_FAMILY
    assert nothing_lacks[5] == kernels.APEX_FAMILY
