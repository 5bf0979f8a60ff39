from __future__ import annotations

from dataclasses import replace

import numpy as np

from meshtide_lab.paper.experiment import Arrays
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS
from meshtide_lab.paper.plots import histogram_plot, rate_plot
from paper_results import invented_mesh

PNG = b"\x89PNG\r\n\x1a\n"


def test_plots_are_pictures_and_the_same_each_time() -> None:
    for plot in (histogram_plot, rate_plot):
        one, other = plot(invented_mesh("sphere")), plot(invented_mesh("sphere"))
        assert one.startswith(PNG)
        assert one == other


def test_published_rates_are_drawn_for_the_sphere() -> None:
    assert rate_plot(invented_mesh("sphere")) != rate_plot(invented_mesh("patch"))


def test_diffs_that_are_all_zero_have_a_histogram() -> None:
    mesh = invented_mesh()
    for name in PICTURED_FILTERS:
        zeros = Arrays(np.zeros((400, 3), np.int64), np.zeros((400, 3)))
        mesh.filters[name] = replace(mesh.filters[name], a=np.inf, arrays=zeros)
    assert histogram_plot(mesh).startswith(PNG)


def test_wide_diffs_have_wide_bins() -> None:
    mesh = invented_mesh()
    for name in PICTURED_FILTERS:
        wide = Arrays(np.random.default_rng(0).integers(-5000, 5000, (400, 3)), np.zeros((400, 3)))
        mesh.filters[name] = replace(mesh.filters[name], arrays=wide)
    assert histogram_plot(mesh).startswith(PNG)
