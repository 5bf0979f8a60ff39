"""Scores move towards what is chosen, the less the oftener they have moved, and stay within their limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.connectivity import score_deep_kernels as kernels
from meshtide_codec.connectivity.coarse_kernels import build_coarse_mesh
from meshtide_codec.connectivity.codec import new_level
from meshtide_codec.connectivity.property_deep_kernels import PLACES, PROPERTIES
from meshtide_codec.connectivity.truth_kernels import empty_truth

if TYPE_CHECKING:
    from meshtide_codec.connectivity.level_kernels import Level

POINTS = np.array([(0, 0, 0), (8, 0, 0), (4, -8, 0), (4, 7, 0), (4, 9, 1), (3, 30, 9)], np.int32)
LISTED = 3


def level() -> Level:
    """Six vertices without faces, the last three of which are listed as candidates of one kind."""
    parents = np.zeros(len(POINTS), np.int32)
    coarse = build_coarse_mesh(parents, np.zeros((0, 3), np.int32), 1)
    made = new_level(coarse, empty_truth(), parents, 1, POINTS)
    made.candidates.vertex[:LISTED] = np.arange(3, 6)
    for column in (made.candidates.kind, made.candidates.flags, made.candidates.corner):
        column[:LISTED] = 0
    return made


def fresh() -> kernels.Scores:
    return kernels.Scores(np.zeros(PLACES, np.int32), np.zeros(PLACES, np.int32), np.zeros((256, PROPERTIES), np.int32))


def test_without_scores_all_are_alike() -> None:
    here, table = level(), fresh()
    assert kernels.weigh_candidates(table, here, LISTED, 0, 1, 2) == (0, LISTED * kernels.FULL_WEIGHT)
    assert here.candidates.weight[:LISTED].tolist() == [kernels.FULL_WEIGHT] * LISTED


def test_what_is_chosen_is_expected_the_next_time() -> None:
    here, table = level(), fresh()
    shares = []
    for _ in range(20):
        _, total = kernels.weigh_candidates(table, here, LISTED, 0, 1, 2)
        shares.append(here.candidates.weight[1] / total)
        kernels.learn_choice(table, here, LISTED, 1, total)
    assert shares == sorted(shares)
    assert shares[-1] > 0.9
    best, _ = kernels.weigh_candidates(table, here, LISTED, 0, 1, 2)
    assert best == 1


def test_refused_candidates_count_with_the_weight_that_they_had() -> None:
    here, table, other = level(), fresh(), fresh()
    _, total = kernels.weigh_candidates(other, here, LISTED, 0, 1, 2)
    kernels.learn_choice(other, here, LISTED, 2, total)
    kernels.weigh_candidates(table, here, LISTED, 0, 1, 2)
    here.candidates.weight[:2] = -1 - here.candidates.weight[:2]
    kernels.learn_choice(table, here, LISTED, 2, total)
    np.testing.assert_array_equal(table.scores, other.scores)


def test_a_single_candidate_teaches_nothing() -> None:
    here, table = level(), fresh()
    best, total = kernels.weigh_candidates(table, here, 1, 0, 1, 2)
    assert (best, total) == (0, kernels.FULL_WEIGHT)
    kernels.learn_choice(table, here, 1, 0, total)
    assert not table.scores.any()
    assert not table.counts.any()


def test_scores_that_have_moved_often_move_less_and_none_leaves_its_limits() -> None:
    here, young, old = level(), fresh(), fresh()
    old.counts[:] = kernels.COUNT_LIMIT
    for table in (young, old):
        _, total = kernels.weigh_candidates(table, here, LISTED, 0, 1, 2)
        kernels.learn_choice(table, here, LISTED, 0, total)
    assert 0 < np.abs(old.scores).max() < np.abs(young.scores).max() / 5
    assert old.counts.max() == kernels.COUNT_LIMIT
    _, total = kernels.weigh_candidates(young, here, LISTED, 0, 1, 2)
    young.scores[:] = kernels.SCORE_LIMIT
    kernels.learn_choice(young, here, LISTED, 0, total)
    assert young.scores.max() == kernels.SCORE_LIMIT
