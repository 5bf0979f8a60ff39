"""The display filter: it stays in the cells, leaves exact vertices alone, and brings smooth surfaces nearer."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from meshtide_codec.compact.diff_coder import known_positions, new_slice_state
from meshtide_codec.compact.display_filter import (
    STRENGTH_UNIT,
    STRENGTHS,
    UNFILTERED,
    Strength,
    choose_strength,
    drawn_positions,
)
from meshtide_codec.compact.slices import Slices
from meshtide_codec.distortion import DistortionMeter
from meshtide_codec.errors import OptionError
from meshtide_codec.reference.display_filter import STRENGTHS as REFERENCE_STRENGTHS
from octrees import lattice_soup, torus


def distance_from_surface(points: npt.NDArray[np.float64]) -> float:
    """RMS distance of grid points from a dense sample of the surface that `torus` samples, in finest steps."""
    nearest, _ = cKDTree(torus(400, 200, 10).positions).query(points)
    return float(np.sqrt(np.square(nearest).mean()))


@pytest.mark.parametrize("depth", [5, 6])
def test_a_smooth_surface_is_drawn_nearer(depth: int) -> None:
    octree = torus(100, 50, 10)
    strength = choose_strength(octree, depth)
    assert strength.smoothing > STRENGTH_UNIT // 4
    level = octree.levels[depth]
    cells = octree.positions[octree.first_vertices[depth]].astype(np.int64) >> (10 - depth)
    middles = (2 * cells + 1) << (10 - depth)
    depths = np.full(level.vertex_count, depth, np.uint8)
    plain = distance_from_surface(drawn_positions(level, middles, depths, 10, UNFILTERED))
    filtered = distance_from_surface(drawn_positions(level, middles, depths, 10, strength))
    assert filtered < 0.8 * plain


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 60),
    st.integers(0, 80),
    st.builds(Strength, st.integers(0, 255), st.integers(0, 255)),
)
def test_drawn_points_stay_in_their_cells(seed: int, vertices: int, faces: int, strength: Strength) -> None:
    octree = lattice_soup(seed, vertices, faces, 6)
    slices = Slices(6)
    states = [new_slice_state(octree.levels[0], slices, 0)]
    for level in octree.levels:
        middles, depths = known_positions(level, states, slices)
        drawn = 2.0 * drawn_positions(level, middles, depths, 6, strength) + 1.0
        assert (np.abs(drawn - middles) <= (1 << (6 - depths.astype(np.int64)))[:, None]).all()


def test_exact_vertices_and_strength_zero_stay_in_the_middle() -> None:
    octree = torus(24, 12, 8)
    level = octree.levels[8]
    depths = np.full(level.vertex_count, 8, np.uint8)
    middles = 2 * octree.positions.astype(np.int64) + 1
    assert np.array_equal(drawn_positions(level, middles, depths, 8, Strength(200, 100)), octree.positions)
    blurred = np.full(level.vertex_count, 4, np.uint8)
    assert np.array_equal(drawn_positions(level, middles, blurred, 8, UNFILTERED), octree.positions)


def test_meshes_without_faces_are_left_alone() -> None:
    octree = lattice_soup(3, 40, 0, 6)
    assert choose_strength(octree, 3) == UNFILTERED


@pytest.mark.parametrize("strength", [Strength(-1, 0), Strength(256, 0), Strength(0, -1), Strength(0, 256)])
def test_strengths_are_bytes(strength: Strength) -> None:
    level = torus(12, 8, 6).levels[6]
    with pytest.raises(OptionError):
        drawn_positions(level, np.zeros((1, 3), np.int64), np.zeros(1, np.uint8), 6, strength)


def test_a_header_can_tell_each_strength_once() -> None:
    assert STRENGTHS[0] == UNFILTERED
    assert len(set(STRENGTHS)) == len(STRENGTHS) == 16
    assert tuple(sorted(STRENGTHS)) == STRENGTHS
    assert list(STRENGTHS) == REFERENCE_STRENGTHS


@pytest.mark.parametrize("depth", [5, 6, 7, 8, 9])
def test_the_chosen_strength_shows_a_level_about_as_near_as_any(depth: int) -> None:
    octree = torus(200, 100, 10)
    meter = DistortionMeter(octree.positions.astype(float), octree.levels[10].faces, samples=2000)
    level = octree.levels[depth]
    middles = (2 * (octree.positions[octree.first_vertices[depth]].astype(np.int64) >> (10 - depth)) + 1) << (
        10 - depth
    )
    depths = np.full(level.vertex_count, depth, np.uint8)

    def distance(strength: Strength) -> float:
        return meter.measure(drawn_positions(level, middles, depths, 10, strength), level.faces).rms

    assert distance(choose_strength(octree, depth)) <= 1.1 * min(map(distance, STRENGTHS))


def test_the_second_step_gives_back_what_the_first_has_shrunk() -> None:
    octree = torus(100, 50, 10)
    level = octree.levels[4]
    middles = (2 * (octree.positions[octree.first_vertices[4]].astype(np.int64) >> 6) + 1) << 6
    depths = np.full(level.vertex_count, 4, np.uint8)
    spread = {
        strength: float(np.std(drawn_positions(level, middles, depths, 10, strength), axis=0).sum())
        for strength in (UNFILTERED, Strength(64, 0), Strength(64, 64))
    }
    assert spread[Strength(64, 0)] < spread[Strength(64, 64)] < spread[UNFILTERED] * 1.02
