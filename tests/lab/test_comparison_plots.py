from __future__ import annotations

import pytest

from comparisons import comparison
from meshtide_lab.comparison.plots import comparison_plot
from pictures import png_size

pytest.importorskip("matplotlib", reason="plots come with the extra bench")


def test_a_comparison_is_drawn_in_the_same_bytes_each_time() -> None:
    item = comparison("spot")
    data = comparison_plot("spot", item.curves, 1000)
    assert png_size(data) == (1440, 600)
    assert data == comparison_plot("spot", item.curves, 1000)
    assert data != comparison_plot("spot", item.curves, None)
