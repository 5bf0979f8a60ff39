from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.rendering.png import png
from pictures import unpacked


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32 - 1), st.sampled_from([2, 40, 256]))
def test_a_png_holds_its_pixels(height: int, width: int, seed: int, shades: int) -> None:
    image = np.random.default_rng(seed).integers(0, shades, (height, width, 3)).astype(np.uint8)
    np.testing.assert_array_equal(unpacked(png(image)), image)


def test_smooth_pictures_become_smaller_by_their_differences() -> None:
    x, y = np.meshgrid(np.arange(128), np.arange(128))
    smooth = np.stack([x + y, 2 * x, 255 - y], axis=2).astype(np.uint8)
    data = png(smooth)
    np.testing.assert_array_equal(unpacked(data), smooth)
    assert len(data) < smooth.size / 50
