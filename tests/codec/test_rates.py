from __future__ import annotations

import json
from math import inf

from meshtide_codec.classic.options import ClassicHeader, ClassicOptions
from meshtide_codec.encoder import encode
from meshtide_codec.filters import FilterSpec
from meshtide_codec.rates import bytes_by_kind, bytes_by_level, stream_report
from meshtide_codec.testing import grid
from streams import encoded_grid


def test_every_byte_of_the_file_is_counted_once() -> None:
    encoded = encoded_grid()
    length = len(encoded.header.to_bytes())
    report = stream_report(encoded.header, length)
    data = encoded.to_bytes()
    assert report["bytes"] == len(data)
    assert report["header_bytes"] + sum(bytes_by_kind(encoded.header).values()) == len(data)
    assert sum(sum(kinds.values()) for kinds in bytes_by_level(encoded.header).values()) == sum(
        map(len, encoded.packet_bytes)
    )
    assert report["levels"][-1]["cumulative_bytes"] == len(data)
    assert report["bits_per_vertex"] == 8 * len(data) / report["vertices"]
    assert json.loads(json.dumps(report)) == report


def test_options_can_become_json() -> None:
    encoded = encode(grid(12), ClassicOptions(bits=8, coarsest_vertices=12, filter=FilterSpec("polynomial", norm=inf)))
    told = encoded.header.options
    assert isinstance(told, ClassicHeader)
    options = told.plain()
    assert json.loads(json.dumps(options, allow_nan=False)) == options
    assert options["filter"]["norm"] == "inf"
    assert options["diffs"] == sorted(told.levels_with_diff)
