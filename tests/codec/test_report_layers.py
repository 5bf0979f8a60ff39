from __future__ import annotations

import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.mesh import Mesh
from meshtide_codec.profile import Profile
from meshtide_codec.rates import bytes_by_kind
from meshtide_codec.report.layers import (
    CELLS,
    CONN,
    DIFF,
    HEADER,
    LAYERS,
    MAP,
    ORDER,
    PARAM,
    layer_bytes,
    totals,
)
from meshtide_codec.testing import grid, shapes


@pytest.mark.parametrize("name", shapes())
@pytest.mark.parametrize(
    "options",
    [
        CompactOptions(bits=9, slices=2),
        CompactOptions(bits=9, slices=2, effort=Effort.HIGH),
        ClassicOptions(bits=9, coarsest_vertices=12),
    ],
    ids=["compact", "high", "classic"],
)
def test_every_byte_belongs_to_one_layer(name: str, options: Profile) -> None:
    encoded = encode(shapes()[name](), options)
    rows = layer_bytes(encoded.header, encoded.packets)
    assert sum(row.size for row in rows) == sum(totals(rows).values()) == len(encoded.to_bytes())
    assert {row.layer for row in rows} <= set(LAYERS)
    assert [row.level for row in rows if row.layer == HEADER] == [None]


@pytest.mark.parametrize("effort", Effort)
def test_a_compact_stream_has_maps_faces_and_diffs(effort: Effort) -> None:
    encoded = encode(grid(24), CompactOptions(bits=10, previews=(), effort=effort))
    rows = layer_bytes(encoded.header, encoded.packets)
    assert list(totals(rows)) == [HEADER, MAP, CONN, DIFF]
    by_kind = {entry.kind.label: 0 for entry in encoded.header.packets}
    for entry in encoded.header.packets:
        by_kind[entry.kind.label] += entry.length
    assert totals(rows)[DIFF] == by_kind["Diff"]
    assert totals(rows)[MAP] + totals(rows)[CONN] == by_kind["Base"] + by_kind["Map&Conn"]


@pytest.mark.parametrize("effort", Effort)
def test_a_stream_without_faces_has_nothing_but_maps_and_diffs(effort: Effort) -> None:
    points = Mesh.checked(grid(24).vertices, [])
    encoded = encode(points, CompactOptions(bits=10, previews=(), effort=effort))
    rows = layer_bytes(encoded.header, encoded.packets)
    assert totals(rows)[DIFF] == bytes_by_kind(encoded.header)["Diff"]
    assert max(row.size for row in rows if row.layer == CONN) <= 8  # counts, and the last digits of the range coder


def test_a_classic_stream_has_cells_and_filters() -> None:
    encoded = encode(grid(24), ClassicOptions(bits=10, coarsest_vertices=12), store_order=True)
    assert list(totals(layer_bytes(encoded.header, encoded.packets))) == [
        HEADER, CELLS, MAP, CONN, PARAM, DIFF, ORDER,
    ]  # fmt: skip
