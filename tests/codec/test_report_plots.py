from __future__ import annotations

import pytest

from comparisons import curve
from meshtide_codec.report.layers import LayerBytes
from meshtide_codec.report.plots import stream_plot
from pictures import png_size

pytest.importorskip("matplotlib", reason="plots come with the extra bench")


def test_a_stream_whose_states_are_all_exact_can_be_drawn() -> None:
    assert png_size(stream_plot("point", [LayerBytes(None, "Header", 90)], curve((100, 0.0)))) == (1440, 600)


def test_layers_and_states_are_drawn() -> None:
    rows = [
        LayerBytes(None, "Header", 90),
        LayerBytes(1, "Map", 30),
        LayerBytes(1, "Conn", 40),
        LayerBytes(0, "Diff", 9),
    ]
    data = stream_plot("spot", rows, curve((90, 0.1), (160, 0.2), (169, 0.0)))
    assert data != stream_plot("spot", rows[:-1], curve((90, 0.1), (160, 0.2), (169, 0.0)))
