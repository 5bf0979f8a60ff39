"""Noise of the Diffs' own size (paper, section 4.2): what it leaves of each level, in both profiles, on a real mesh."""

from __future__ import annotations

import math

import numpy as np
import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.filters import FilterSpec
from meshtide_codec.report.difference_statistics import difference_statistics
from meshtide_codec.samples import load_sample
from meshtide_lab.link.fidelity import StreamMeter
from meshtide_lab.link.lossy_link import LossyLink, receive

GAUSSIAN_NOISE = "noise:kind=gaussian,relative=1"


def errors(encoded: EncodedMesh, text: str, seed: int = 1) -> dict[int, float]:
    """Root mean square error of a coordinate by level, in units of the cube."""
    received = receive(LossyLink.parse(text, seed), encoded.header, encoded.packets)
    metrics = StreamMeter(encoded.header, encoded.packets, samples=50).measure(received.decoder, surfaces=False)
    return {row.level: row.vertex.rms for row in metrics.levels}


@pytest.mark.parametrize("degree", [1, 3])
def test_classic_levels_have_their_own_noise_and_what_coarser_ones_hand_on(degree: int) -> None:
    encoded = encode(load_sample("spot"), ClassicOptions(filter=FilterSpec("polynomial", degree=degree)))
    found = errors(encoded, GAUSSIAN_NOISE)
    own = {
        row.level: row.l2_error_per_vertex * math.sqrt(row.vertices / 3)
        for row in difference_statistics(encoded.header, encoded.packets)
    }
    coarsest = max(own)
    assert found[coarsest] == pytest.approx(own[coarsest], rel=0.1)
    for level in range(coarsest):
        assert 0.9 * own[level] < found[level] < 1.1 * math.hypot(own[level], found[level + 1])
        alone = errors(encoded, f"{GAUSSIAN_NOISE},level={level}")
        assert alone[level] == pytest.approx(own[level], rel=0.1)
        assert alone[level + 1] == 0.0


def test_compact_noise_grows_with_its_size_until_the_leaf_cells_end_it() -> None:
    encoded = encode(load_sample("spot"), CompactOptions(slices=4))
    sizes = [errors(encoded, f"noise:relative={size}")[0] for size in (0.01, 0.1, 1.0, 1e3, 1e6)]
    assert sizes[0] < sizes[1] < sizes[2] < sizes[3]
    assert sizes[1] == pytest.approx(10 * sizes[0], rel=0.2)
    assert sizes[4] == pytest.approx(sizes[3], rel=0.02)  # every vertex is at its cell's border


def test_seeds_differ_and_repeat() -> None:
    encoded = encode(load_sample("spot"), CompactOptions())
    first, again, other = (errors(encoded, GAUSSIAN_NOISE, seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert np.isclose(first[0], other[0], rtol=0.2)
