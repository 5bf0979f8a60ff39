from __future__ import annotations

import struct

import pytest

from comparisons import comparison, curve
from meshtide_codec.comparison.layers import LayerBytes
from meshtide_codec.comparison.plots import comparison_plot, stream_plot

pytest.importorskip("matplotlib", reason="plots come with the extra bench")


def size_of(data: bytes) -> tuple[int, int]:
    assert data.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", data[16:24])
    return width, height


def test_a_comparison_is_drawn_in_the_same_bytes_each_time() -> None:
    item = comparison("spot")
    data = comparison_plot("spot", item.curves, 1000)
    assert size_of(data) == (1440, 600)
    assert data == comparison_plot("spot", item.curves, 1000)
    assert data != comparison_plot("spot", item.curves, None)


def test_a_stream_whose_states_are_all_exact_can_be_drawn() -> None:
    assert size_of(stream_plot("point", [LayerBytes(None, "Header", 90)], curve((100, 0.0)))) == (1440, 600)


def test_layers_and_states_are_drawn() -> None:
    rows = [
        LayerBytes(None, "Header", 90),
        LayerBytes(1, "Map", 30),
        LayerBytes(1, "Conn", 40),
        LayerBytes(0, "Diff", 9),
    ]
    data = stream_plot("spot", rows, curve((90, 0.1), (160, 0.2), (169, 0.0)))
    assert data != stream_plot("spot", rows[:-1], curve((90, 0.1), (160, 0.2), (169, 0.0)))
