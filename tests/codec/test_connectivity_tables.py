"""The trained tables fit the code that reads them, and what is derived from numbers is what it says."""

from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.connectivity import decision_deep_kernels as deep
from meshtide_codec.connectivity import score_deep_kernels
from meshtide_codec.connectivity import shape_kernels as shapes
from meshtide_codec.connectivity.decision_kernels import CONTEXTS, ODDS_CLASS, ODDS_CLASSES
from meshtide_codec.connectivity.property_deep_kernels import PLACES
from meshtide_codec.connectivity.score_deep_kernels import SCORE_LIMIT
from meshtide_codec.connectivity.score_kernels import FULL_WEIGHT, LOWEST_WEIGHT, SCORES, WEIGHTS
from meshtide_codec.connectivity.tables import DEEP_PRIOR_LIMIT, PRIOR_LIMIT, deep_table_path, new_models, table_path
from meshtide_codec.entropy.deep_mixing_kernels import CORRECTION_STEPS, FAST_LIMIT, WEIGHT_LIMIT
from meshtide_codec.entropy.model_kernels import COUNT_LIMIT


@pytest.mark.parametrize("geometric", [False, True])
def test_a_table_has_the_size_and_range_that_the_kernels_rely_on(geometric: bool) -> None:
    with np.load(table_path(geometric=geometric)) as table:
        assert set(table.files) == {"scores", "probabilities", "counts", "meshes"}
        assert table["scores"].shape == (SCORES,)
        assert table["scores"].dtype == np.int16
        assert table["probabilities"].shape == table["counts"].shape == (CONTEXTS,)
        assert table["probabilities"].dtype == np.uint16
        assert int(table["counts"].max()) <= COUNT_LIMIT
        assert table["meshes"].tolist() == ["fandisk.obj", "homer.obj", "rocker-arm.obj", "spot.obj", "assembly 0"]
    assert table_path(geometric=geometric).stat().st_size < 20_000


def test_the_deep_table_has_the_size_and_range_that_the_kernels_rely_on() -> None:
    with np.load(deep_table_path()) as table:
        arrays = {name: table[name] for name in table.files if name != "meshes"}
        meshes = table["meshes"].tolist()
    assert {name: (array.dtype, array.shape) for name, array in arrays.items()} == {
        "scores": (np.int32, (PLACES,)),
        "score_counts": (np.uint8, (PLACES,)),
        "probabilities": (np.uint16, (deep.CONTEXTS,)),
        "counts": (np.uint8, (deep.CONTEXTS,)),
        "weights": (np.int32, (deep.NEURONS * deep.INPUTS,)),
        "final_weights": (np.int32, (deep.FINALS * deep.CHOSEN_NEURONS,)),
        "corrections": (np.int32, (deep.CORRECTIONS * CORRECTION_STEPS,)),
    }
    assert int(np.abs(arrays["scores"]).max()) <= SCORE_LIMIT
    assert int(np.abs(arrays["weights"]).max()) <= WEIGHT_LIMIT
    assert int(np.abs(arrays["final_weights"]).max()) <= WEIGHT_LIMIT
    assert int(arrays["corrections"].min()) >= 0
    assert int(arrays["corrections"].max()) < 65536 << 6
    assert meshes[:4] == ["fandisk.obj", "homer.obj", "rocker-arm.obj", "spot.obj"]
    assert deep_table_path().stat().st_size < 250_000


def test_deep_models_begin_as_the_table_says() -> None:
    models = new_models(geometric=True, deep=True)
    slow, fast = np.split(models.questions.mixer[0], 2)
    np.testing.assert_array_equal(slow >> 8, fast >> 8)
    assert int((slow & 255).max()) == int(models.table.counts.max()) == DEEP_PRIOR_LIMIT
    assert int((fast & 255).max()) == FAST_LIMIT


def test_deep_weights_fall_by_a_factor_e_every_64_steps_and_never_to_zero() -> None:
    weights = score_deep_kernels.WEIGHTS
    assert weights[[0, 64, 128, 1023]].tolist() == [1 << 20, 385750, 141909, 1]
    assert np.all(np.diff(weights) <= 0)
    assert score_deep_kernels.RATES[[0, 16, 255]].tolist() == [655 + 9830, 655 + 4915, 655 + 580]


def test_models_are_the_callers_own() -> None:
    models = new_models(geometric=True)
    untouched = new_models(geometric=True)
    models.scores[:] = 0
    models.contexts[:] = 0
    again = new_models(geometric=True)
    np.testing.assert_array_equal(again.scores, untouched.scores)
    np.testing.assert_array_equal(again.contexts, untouched.contexts)
    assert int((again.contexts & 255).max()) == PRIOR_LIMIT


def test_weights_fall_by_a_factor_e_every_256_scores() -> None:
    assert WEIGHTS[[0, 64, 128, LOWEST_WEIGHT]].tolist() == [FULL_WEIGHT, 1507, 554, 0]
    assert np.all(np.diff(WEIGHTS) <= 0)


def test_odds_classes_are_half_octaves() -> None:
    assert ODDS_CLASS[[0, 4, 8, 16, 256, 512, 4096]].tolist() == [0, 2, 4, 6, 14, 16, 22]
    assert int(ODDS_CLASS.max()) < ODDS_CLASSES


def test_angle_classes_divide_half_a_turn_evenly() -> None:
    for angle_class in range(shapes.ANGLES):
        angle = np.pi * (angle_class + 0.5) / shapes.ANGLES
        cosine = np.cos(angle)
        assert shapes.class_of_cosine.py_func(cosine * abs(cosine), 1.0) == angle_class
    assert shapes.class_of_cosine.py_func(1.0, 0.0) == 0
    assert shapes.class_of_cosine.py_func(1.0, 1.0) == 0
    assert shapes.class_of_cosine.py_func(-1.0, 1.0) == shapes.ANGLES - 1


def test_angles_of_a_right_triangle() -> None:
    half_turn = shapes.ANGLES
    assert shapes.angle_class.py_func(2.0, 1.0, 1.0) == half_turn // 2 - 1
    assert shapes.angle_class.py_func(2.1, 1.0, 1.0) == half_turn // 2
    assert shapes.angle_class.py_func(1.0, 1.01, 2.0) in {half_turn // 4 - 1, half_turn // 4}
    assert shapes.angle_class.py_func(1.0, 0.0, 1.0) == 0


def test_length_classes_are_two_for_each_doubling_of_the_square() -> None:
    classes = [shapes.length_class.py_func(ratio, 16.0) for ratio in (0.0, 1.0, 1.99, 2.0, 4.0, 8.0, 1e30)]
    assert classes == [0, 6, 7, 8, 10, 12, shapes.LENGTHS - 1]
    assert [shapes.short_length.py_func(squared) for squared in (0.0, 4.0, 9.0, 56.0, 1e30)] == [0, 1, 2, 14, 15]


def test_bend_of_flat_right_angled_and_folded_faces() -> None:
    vertices = np.zeros((6, 12), np.int32)
    vertices[:, :3] = [[0, 0, 0], [4, 0, 0], [2, -4, 0], [2, 4, 0], [2, 0, 4], [2, -3, 0]]
    gate = shapes.gate_shape.py_func(vertices, 0, 1, 2)
    assert gate.squared == 16.0
    flat, right_angle, folded = (shapes.position.py_func(vertices, apex) for apex in (3, 4, 5))
    assert shapes.bend_class.py_func(gate, flat) == 0
    assert shapes.bend_class.py_func(gate, right_angle) == shapes.ANGLES // 2 - 1
    assert shapes.bend_class.py_func(gate, folded) == shapes.ANGLES - 1
