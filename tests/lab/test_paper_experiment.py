from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import encode
from meshtide_codec.filters import FilterSpec
from meshtide_codec.packets import PacketKind
from meshtide_codec.quantize import quantize
from meshtide_codec.samples import load_sample, sample_names
from meshtide_codec.sphere import PAPER_FILTERS
from meshtide_codec.testing import grid
from meshtide_lab.paper.experiment import SCHEMES, SINGLE_RESOLUTION, lost_diff, run_filter, run_scheme
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS

OPTIONS = ClassicOptions(bits=8, coarsest_vertices=30, filter=FilterSpec("polynomial", degree=2))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_prediction_is_what_a_decoder_shows_without_the_last_diff(scheme: str) -> None:
    mesh = grid(24)
    found, arrays = run_scheme(quantize(mesh, OPTIONS.bits), OPTIONS, scheme)
    options = replace(OPTIONS, variable_from=SINGLE_RESOLUTION if scheme == "single" else None)
    encoded = encode(mesh, options)
    decoder = Decoder(encoded.header)
    for packet in encoded.packets:
        if (packet.kind, packet.level) != (PacketKind.DIFF, 0):
            decoder.push(packet)
    true = encoded.quantized.mesh().vertices
    error = (decoder.mesh(0).vertices - true) / encoded.quantized.extent
    np.testing.assert_allclose(arrays.prediction - encoded.quantized.positions, error * 255, atol=1e-9)
    assert found.lost.largest_coordinate == pytest.approx(np.abs(error).max())
    assert found.lost.rms == pytest.approx(np.sqrt((error**2).mean()))


def test_sizes_are_those_of_the_packets() -> None:
    mesh = grid(24)
    found, _ = run_scheme(quantize(mesh, OPTIONS.bits), OPTIONS, "multi")
    sizes = dict.fromkeys(PacketKind, 0)
    for packet in encode(mesh, OPTIONS).packets:
        sizes[packet.kind] += len(packet.payload)
    assert found.sizes.coefficients == sizes[PacketKind.PARAM]
    assert found.sizes.differences == sizes[PacketKind.DIFF]


def test_diffs_in_finest_steps_take_no_more_for_the_zeroth_order_filter() -> None:
    quantized = quantize(grid(24), OPTIONS.bits)
    zeroth, _ = run_scheme(quantized, replace(OPTIONS, filter=FilterSpec("zeroth")), "multi")
    filtered, _ = run_scheme(quantized, OPTIONS, "multi")
    assert zeroth.fine_shannon_rate <= zeroth.shannon_rate
    assert filtered.fine_shannon_rate > filtered.shannon_rate


def test_measures_of_errors() -> None:
    lost = lost_diff(np.ones((2, 3)), np.array([[3.0, 1.0, 1.0], [1.0, -2.0, 5.0]]), 10)
    assert lost.mean == pytest.approx(0.15)
    assert lost.rms == pytest.approx(0.1 * np.sqrt(29 / 6))
    assert lost.largest_coordinate == pytest.approx(0.4)
    assert lost.largest_vertex == pytest.approx(0.5)


def test_arrays_are_kept_where_they_are_asked_for() -> None:
    quantized = quantize(grid(12), OPTIONS.bits)
    spec = FilterSpec("gaussian")
    assert run_filter(quantized, OPTIONS, "gaussian", spec).arrays is None
    found = run_filter(quantized, OPTIONS, "gaussian", spec, keep_arrays=True)
    assert found.arrays is not None
    assert found.arrays.differences.shape == quantized.positions.shape


@pytest.mark.parametrize("name", sample_names())
def test_accuracy_grows_with_the_order_of_the_filter_on_real_meshes(name: str) -> None:
    """Section 4.1: the single resolution's only Diff is lost."""
    quantized = quantize(load_sample(name), 10)
    options = ClassicOptions(bits=10)
    errors = [
        run_scheme(quantized, replace(options, filter=PAPER_FILTERS[each]), "single")[0].lost.rms
        for each in PICTURED_FILTERS
    ]
    assert errors == sorted(errors, reverse=True)
