from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshtide_codec.rendering.picture import Style
from meshtide_codec.rendering.rasterizer import PAPER
from meshtide_lab.paper import pictures
from meshtide_lab.paper.experiment import Arrays
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS
from paper_results import OPTIONS, invented_mesh
from pictures import unpacked

SIZE = 64


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "STYLE", Style(size=SIZE, columns=2))


def test_levels_stand_side_by_side() -> None:
    image = unpacked(pictures.levels_picture(invented_mesh(), OPTIONS))
    finest, coarsest = image[:SIZE, :SIZE], image[:SIZE, SIZE:]
    assert (finest != PAPER).any()
    assert (coarsest != PAPER).any()
    assert (finest != coarsest).any()


def test_predictions_are_those_of_the_filters() -> None:
    mesh = invented_mesh()
    true = mesh.quantized.positions.astype(np.float64)
    for place, name in enumerate(PICTURED_FILTERS):
        moved = true if place < 2 else true * [1.0, 1.0, 0.0]
        mesh.filters[name] = replace(mesh.filters[name], arrays=Arrays(np.zeros(true.shape, np.int64), moved))
    image = unpacked(pictures.predictions_picture(mesh))
    row = len(image) // 2
    np.testing.assert_array_equal(image[:SIZE, :SIZE], image[:SIZE, SIZE:])
    assert (image[row : row + SIZE, :SIZE] != image[:SIZE, :SIZE]).any()


def test_errors_have_light_colours_where_they_are_large() -> None:
    mesh = invented_mesh()
    left = mesh.quantized.positions[:, 0] < 128
    for name in PICTURED_FILTERS:
        differences = np.zeros((len(left), 3), np.int64)
        differences[left if name == "zeroth" else ~left] = 9
        arrays = Arrays(differences, np.zeros((len(left), 3)))
        mesh.filters[name] = replace(mesh.filters[name], arrays=arrays)
    image = unpacked(pictures.errors_picture(mesh)).astype(int)
    zeroth, gaussian = image[:SIZE, :SIZE].sum(axis=2), image[:SIZE, SIZE : 2 * SIZE].sum(axis=2)
    drawn = (image[:SIZE, :SIZE] != PAPER).any(axis=2)
    brighter = (zeroth > gaussian)[drawn]
    assert 0.2 < brighter.mean() < 0.8


def test_no_errors_can_be_drawn() -> None:
    mesh = invented_mesh()
    for name in PICTURED_FILTERS:
        arrays = Arrays(np.zeros((400, 3), np.int64), np.zeros((400, 3)))
        mesh.filters[name] = replace(mesh.filters[name], arrays=arrays)
    assert unpacked(pictures.errors_picture(mesh)).shape[1] == 2 * SIZE
