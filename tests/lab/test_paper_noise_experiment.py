from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.filters import FilterSpec
from meshtide_codec.quantize import quantize
from meshtide_codec.samples import load_sample
from meshtide_codec.sphere import PAPER_FILTERS
from meshtide_codec.testing import grid
from meshtide_lab.link.damage import Noise
from meshtide_lab.link.lossy_link import LossyLink
from meshtide_lab.paper import noise_experiment
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS
from meshtide_lab.paper.noise_experiment import run_noise

OPTIONS = ClassicOptions(bits=8, coarsest_vertices=30)
ZEROTH = FilterSpec("zeroth")


def test_noise_has_the_size_of_the_diffs() -> None:
    found = run_noise(quantize(load_sample("spot"), 10), ClassicOptions(bits=10), "zeroth", ZEROTH)
    np.testing.assert_allclose(found.injected, found.differences, rtol=0.05)


def test_without_noise_the_levels_are_true(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(noise_experiment, "LINK", LossyLink((Noise(relative=0.0),)))
    found = run_noise(quantize(grid(24), OPTIONS.bits), OPTIONS, "degree 1", PAPER_FILTERS["degree 1"])
    np.testing.assert_allclose(found.reconstructed, 0.0, atol=1e-12)


def test_the_zeroth_order_filter_adds_up_the_noise_of_all_levels() -> None:
    """It moves nothing, so a vertex has its own noise and its ancestors': energies add up but for the border."""
    quantized = quantize(load_sample("spot"), 10)
    found = run_noise(quantized, ClassicOptions(bits=10), "zeroth", ZEROTH)
    energies = np.square(found.reconstructed)
    assert found.reconstructed[-1] == pytest.approx(found.injected[-1], rel=0.02)
    own = np.square(found.injected[:-1])
    assert (energies[:-1] > own).all()
    assert energies[0] == pytest.approx(np.square(found.injected).sum(), rel=0.25)


def test_the_same_noise_comes_each_time() -> None:
    quantized = quantize(grid(24), OPTIONS.bits)
    one, other = (run_noise(quantized, OPTIONS, "gaussian", FilterSpec("gaussian")) for _ in range(2))
    assert one == other


@pytest.mark.parametrize("name", PICTURED_FILTERS)
def test_a_mesh_of_one_level_has_no_diffs(name: str) -> None:
    options = replace(OPTIONS, coarsest_vertices=100)
    assert run_noise(quantize(grid(5), 8), options, name, PAPER_FILTERS[name]).reconstructed == ()
