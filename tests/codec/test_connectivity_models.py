"""Models are copied whole, taken over whole, and learn from level to level."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from meshtide_codec.connectivity import decision_deep_kernels as deep
from meshtide_codec.connectivity import new_models, read_faces, write_faces
from meshtide_codec.connectivity.models import adopt, copied, is_deep, untrained_deep_models
from meshtide_codec.connectivity.property_deep_kernels import PLACES
from meshtide_codec.entropy.codec import PayloadReader, PayloadWriter
from meshtide_codec.errors import MapConnError, MeshError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.choice_kernels import Models

Level = tuple["NDArray[np.int32]", "NDArray[np.int32]", "NDArray[np.int32]"]


def learning(models: Models) -> list[NDArray[np.int32]]:
    return [models.contexts, models.scores, models.weights, *models.table[:2], *models.questions.mixer]


def strip(count: int) -> Level:
    """Faces, parents and positions of a strip of triangles, two vertices to a cell."""
    first = np.arange(count - 2, dtype=np.int32)
    turned = (first % 2)[:, None] == 1
    faces = np.where(turned, np.stack([first, first + 2, first + 1], 1), np.stack([first, first + 1, first + 2], 1))
    places = np.arange(count)
    positions = np.stack([4 * (places // 2), 4 * (places % 2) + places // 4, places % 3], axis=1).astype(np.int32)
    return faces.astype(np.int32), (places // 2).astype(np.int32), positions


def written(models: Models, level: Level) -> bytes:
    faces, parents, positions = level
    writer = PayloadWriter()
    write_faces(writer, faces, parents, np.zeros((0, 3), np.int32), int(parents[-1]) + 1, positions, models)
    return writer.payload()


def read(models: Models, payload: bytes, level: Level) -> NDArray[np.int32]:
    faces, parents, positions = level
    reader = PayloadReader(payload)
    nothing = np.zeros((0, 3), np.int32)
    return read_faces(reader, parents, nothing, int(parents[-1]) + 1, len(faces), positions, models)


@pytest.mark.parametrize("deeply", [False, True])
def test_a_copy_learns_for_itself_until_it_is_adopted(deeply: bool) -> None:
    models = new_models(geometric=True, deep=deeply)
    assert is_deep(models) == deeply
    before = [array.copy() for array in learning(models)]
    copy = copied(models)
    written(copy, strip(40))
    assert all(np.array_equal(array, old) for array, old in zip(learning(models), before, strict=True))
    adopt(models, copy)
    assert any(not np.array_equal(array, old) for array, old in zip(learning(models), before, strict=True))
    for array, learnt in zip(learning(models), learning(copy), strict=True):
        np.testing.assert_array_equal(array, learnt)


def test_both_sides_learn_the_same_and_later_levels_gain() -> None:
    writing, reading = new_models(geometric=True, deep=True), new_models(geometric=True, deep=True)
    sizes = []
    for _ in range(3):
        payload = written(writing, strip(300))
        read(reading, payload, strip(300))
        sizes.append(len(payload))
        for one, other in zip(learning(writing), learning(reading), strict=True):
            np.testing.assert_array_equal(one, other)
    assert sizes[2] < sizes[0]


def test_a_damaged_payload_teaches_nothing() -> None:
    models = new_models(geometric=True, deep=True)
    payload = written(copied(models), strip(60))
    before = [array.copy() for array in learning(models)]
    refused = 0
    for place in range(len(payload)):
        damaged = payload[:place] + bytes([payload[place] ^ 0x55]) + payload[place + 1 :]
        attempt = copied(models)
        try:
            read(attempt, damaged, strip(60))
        except MapConnError:
            refused += 1
            assert all(np.array_equal(array, old) for array, old in zip(learning(attempt), before, strict=True))
    assert refused > 0
    read(models, payload, strip(60))


def test_untrained_models_know_nothing_and_round_trip() -> None:
    models = untrained_deep_models(new_models(geometric=True))
    assert is_deep(models)
    assert models.table.scores.shape == models.table.counts.shape == (PLACES,)
    assert not models.table.scores.any()
    contexts, weights, final_weights, _ = models.questions.mixer
    assert contexts.shape == (2 * deep.CONTEXTS,)
    assert len(np.unique(contexts)) == 1
    assert weights.shape == (deep.NEURONS * deep.INPUTS,)
    assert final_weights.shape == (deep.FINALS * deep.CHOSEN_NEURONS,)
    fresh = untrained_deep_models(new_models(geometric=True))
    payload = written(models, strip(60))
    assert len(read(fresh, payload, strip(60))) == 58
    assert len(payload) > len(written(new_models(geometric=True, deep=True), strip(60)))


def test_deep_models_need_positions() -> None:
    faces, parents, _ = strip(10)
    nothing = np.zeros((0, 3), np.int32)
    models = new_models(geometric=True, deep=True)
    with pytest.raises(MeshError, match="deep models need positions"):
        write_faces(PayloadWriter(), faces, parents, nothing, 5, None, models)
    with pytest.raises(MapConnError, match="deep models need positions"):
        read_faces(PayloadReader(b"\1"), parents, nothing, 5, len(faces), None, models)
