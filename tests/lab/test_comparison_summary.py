from __future__ import annotations

import pytest

from comparisons import comparison
from meshtide_codec.report.states import TARGETS
from meshtide_lab.comparison.mesh_comparison import LADDER
from meshtide_lab.comparison.summary import LADDERS, ladder_bytes, summarize


def test_means_are_geometric_and_the_worst_has_a_name() -> None:
    (summary,) = summarize([comparison("a", bare=500), comparison("b", bare=2000), comparison("c", draco=None)])
    assert (summary.bits, summary.meshes) == (12, 3)
    assert summary.ratio == pytest.approx(1.0)
    assert (summary.worst, summary.worst_mesh) == (2.0, "b")
    assert summary.ratio_with_previews == pytest.approx((0.6 * 2.1) ** 0.5)
    assert summary.preview_bits_per_vertex == pytest.approx(1.0)
    assert summary.encode_speed == pytest.approx(2000)
    assert summary.decode_speed == pytest.approx(20_000)
    assert summary.draco_decode_speed == pytest.approx(800_000)


def test_the_better_ladder_counts_for_each_distance() -> None:
    item = comparison("a")
    assert [ladder_bytes(item, target) for target in TARGETS] == [150, 300, 300, 1300, 1300]
    assert ladder_bytes(item, 1e-2) == 150
    assert ladder_bytes(item, 1e-2, LADDER) == ladder_bytes(item, 5.5e-3) == 200
    assert ladder_bytes(item, 1e-6) is None
    assert ladder_bytes(comparison("b", draco=None), 1e-2) is None
    (summary,) = summarize([item, comparison("b", bare=500), comparison("c", draco=None)])
    assert [(row.target, row.ladder) for row in summary.targets] == [
        (target, ladder) for target in TARGETS for ladder in LADDERS
    ]
    first, better, *_, last = summary.targets
    assert (first.target, first.meshes, first.fewer) == (1e-2, 2, 2)
    assert first.ratio == pytest.approx(100 / 200)
    assert better.ratio == pytest.approx(100 / 150)
    assert last.worst == pytest.approx(1000 / 1300)


def test_each_quantization_has_its_summary() -> None:
    found = summarize([comparison("a", bits=bits, draco=None) for bits in (10, 12)])
    assert [summary.bits for summary in found] == [10, 12]
    assert (found[0].ratio, found[0].worst, found[0].worst_mesh, found[0].draco_encode_speed) == (None,) * 4
    assert found[0].targets == ()
    assert summarize([]) == []
