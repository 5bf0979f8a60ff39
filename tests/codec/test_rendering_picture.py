from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.errors import OptionError
from meshtide_codec.rendering import picture
from meshtide_codec.rendering.colour_scale import ColourScale
from meshtide_codec.rendering.picture import TILE, Style, Subject, draw_subjects, levels_picture
from meshtide_codec.rendering.rasterizer import PAPER
from meshtide_codec.testing import grid, shapes
from pictures import unpacked

SCALE = ColourScale(0.0, 1.0, "height")


def test_levels_stand_side_by_side() -> None:
    image = unpacked(levels_picture([(f"level {i}", grid(6)) for i in range(4)]))
    height = TILE + picture._CAPTION
    assert image.shape == (2 * height, 3 * TILE, 3)
    tiles = [image[top : top + TILE, left : left + TILE] for top in (0, height) for left in (0, TILE, 2 * TILE)]
    for tile in tiles[1:4]:
        np.testing.assert_array_equal(tile, tiles[0])
    assert (tiles[4] == PAPER).all()
    captions = image[TILE:height]
    assert (captions[:, :TILE] != PAPER).any()
    assert (captions[:, :TILE] != captions[:, TILE : 2 * TILE]).any()


def test_all_are_drawn_in_the_scale_of_the_one_that_is_named() -> None:
    small, large = grid(3), grid(12)
    style = Style(size=64)
    own = draw_subjects([Subject("", small)], style=style)
    framed = draw_subjects([Subject("", small)], large, style=style)
    drawn = [(image[:64] != PAPER).any(axis=2).sum() for image in (own, framed)]
    assert drawn[1] < drawn[0] / 4


def test_a_legend_shows_the_colours_in_order() -> None:
    mesh = grid(6)
    subject = Subject("x", mesh, np.linspace(0.0, 1.0, len(mesh.vertices)))
    with_values = draw_subjects([subject], scale=SCALE, style=Style(size=200))
    assert with_values.shape == (200 + picture._CAPTION + picture._LEGEND, 200, 3)
    bar = with_values[200 + picture._CAPTION + 10, 50:150]
    np.testing.assert_array_equal(bar, np.rint(SCALE.colours(np.linspace(0, 1, 100))))


@pytest.mark.parametrize("name", sorted(shapes()))
def test_any_mesh_can_be_drawn(name: str) -> None:
    image = draw_subjects([Subject(name, shapes()[name]())], style=Style(size=60, edges=True))
    assert image.shape == (60 + picture._CAPTION, 60, 3)
    assert (image[:60] != PAPER).any() or name in {"all welded", "line"}


def test_what_does_not_fit_together_is_refused() -> None:
    mesh = grid(3)
    with pytest.raises(OptionError, match="no mesh"):
        draw_subjects([])
    with pytest.raises(OptionError, match="colour scale"):
        draw_subjects([Subject("x", mesh, np.zeros(9))])
    with pytest.raises(OptionError, match="one value per vertex"):
        draw_subjects([Subject("x", mesh, np.zeros(8))], scale=SCALE)
    with pytest.raises(OptionError, match="column"):
        Style(columns=0)
