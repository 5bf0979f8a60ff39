from __future__ import annotations

import math

import numpy as np
import pytest

from meshtide_codec.errors import OptionError
from meshtide_codec.rendering.colour_scale import ANCHORS, ColourScale

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def test_larger_values_are_lighter_so_grey_prints_keep_the_order() -> None:
    grey = ColourScale(2.0, 5.0, "x").colours(np.linspace(2.0, 5.0, 200)) @ LUMINANCE
    assert (np.diff(grey) > 0).all()


def test_values_outside_look_like_the_ends() -> None:
    colours = ColourScale(0.0, 1.0, "x").colours(np.array([-9.0, 9.0]))
    np.testing.assert_array_equal(colours, ANCHORS[[0, -1]])


@pytest.mark.parametrize(("low", "high"), [(1.0, 1.0), (2.0, 1.0), (math.nan, 1.0), (0.0, math.inf)])
def test_ends_out_of_order_are_refused(low: float, high: float) -> None:
    with pytest.raises(OptionError, match="ascending"):
        ColourScale(low, high, "x")
