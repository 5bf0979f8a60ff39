from __future__ import annotations

import numpy as np
import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.distortion import DistortionMeter
from meshtide_codec.encoder import encode
from meshtide_codec.mesh import Mesh
from meshtide_codec.profile import Profile
from meshtide_codec.quantize import quantize
from meshtide_codec.report.states import StreamState, bytes_for, grid_points, improving, stream_states
from meshtide_codec.stream.distances import stored_distances
from meshtide_codec.testing import grid


def state(size: int, rms: float) -> StreamState:
    return StreamState("", size, 4, 4, rms, 2 * rms)


def test_bytes_for_takes_the_first_state_within_the_target() -> None:
    states = [state(10, 0.1), state(20, 0.01), state(30, 0.05), state(40, 0.0)]
    assert bytes_for(states, 0.05) == 20
    assert bytes_for(states, 0.01) == 20
    assert bytes_for(states, 0.001) == 40
    assert bytes_for(states[:3], 0.001) is None
    assert bytes_for([], 1.0) is None


def test_states_that_are_worse_than_earlier_ones_are_not_shown() -> None:
    states = [state(10, 0.1), state(20, 0.01), state(30, 0.05), state(35, 0.01), state(40, 0.0)]
    assert improving(states) == [states[0], states[1], states[4]]
    assert improving([]) == []


@pytest.mark.parametrize("options", [CompactOptions(bits=9), ClassicOptions(bits=9, coarsest_vertices=12)], ids=str)
def test_measured_states_are_what_the_header_says(options: Profile) -> None:
    encoded = encode(grid(24), options)
    quantized = encoded.quantized
    states = stream_states(encoded, DistortionMeter(quantized.positions.astype(np.float64), quantized.faces))
    assert len(states) == len(encoded.header.levels)
    for found, row in zip(states, encoded.header.levels, strict=True):
        assert (found.name, found.vertices, found.faces) == (f"level {row.level}", row.vertices, row.faces)
        assert (row.rms, row.maximum) == pytest.approx(stored_distances(found.rms, found.maximum), rel=0.3)
        assert row.rms * (32 / 33) * 0.99 <= found.rms <= row.rms * 1.01 + 1e-12
    assert states[-1].size == len(encoded.to_bytes())
    assert (states[-1].rms, states[-1].maximum) == (0.0, 0.0)


def test_grid_points_undo_the_input_unit() -> None:
    quantized = quantize(grid(9), 10)
    np.testing.assert_allclose(grid_points(quantized.mesh().vertices, quantized), quantized.positions, atol=1e-9)
    point = quantize(Mesh.checked([[3.0, 4.0, 5.0]], []), 10)
    assert grid_points(point.mesh().vertices, point).tolist() == [[0.0, 0.0, 0.0]]
