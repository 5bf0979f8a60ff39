from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING

from rich.console import Console

from comparisons import comparison
from meshtide_lab.comparison import tables
from meshtide_lab.comparison.summary import summarize

if TYPE_CHECKING:
    from rich.table import Table

ITEMS = [comparison("spot"), comparison("cow", bits=14, draco=None)]


def printed(table: Table) -> str:
    console = Console(width=160, file=io.StringIO(), record=True)
    console.print(table)
    return console.export_text()


def test_rows_of_sizes() -> None:
    spot, cow = tables.size_rows(ITEMS)
    assert (spot["meshtide_bytes"], spot["meshtide_bytes_without_previews"], spot["draco_bytes"]) == (1000, 900, 1000)
    assert (spot["meshtide_bits_per_vertex"], spot["draco_bits_per_vertex"]) == (10.0, 10.0)
    assert (spot["ratio"], spot["ratio_without_previews"]) == (1.0, 0.9)
    assert (cow["draco_bytes"], cow["ratio"], cow["problems"]) == (None, None, "Draco cannot encode the mesh")


def test_rows_of_targets_and_states() -> None:
    rows = tables.target_rows(ITEMS)
    assert len(rows) == 10
    assert rows[1] == {
        "mesh": "spot", "bits": 12, "rms": 3e-3, "meshtide_bytes": 450, "ladder_bytes": 300, "fitted_ladder_bytes": 400
    }  # fmt: skip
    assert rows[9]["ladder_bytes"] is None
    states = tables.state_rows(ITEMS)
    assert len(states) == 12
    assert (states[3]["candidate"], states[3]["size"], states[3]["maximum"]) == ("ladder", 200, 1e-2)


def test_csv_and_json_hold_every_row() -> None:
    rows = tables.size_rows(ITEMS)
    read = list(csv.DictReader(io.StringIO(tables.csv_text(rows))))
    assert [row["mesh"] for row in read] == ["spot", "cow"]
    assert float(read[0]["ratio_without_previews"]) == 0.9
    assert read[1]["draco_bytes"] == ""
    assert tables.csv_text([]) == "\n"
    plain = tables.plain_comparison(ITEMS)
    assert json.loads(json.dumps(plain))["meshes"] == rows
    assert [summary["bits"] for summary in plain["summaries"]] == [12, 14]


def test_tables_show_the_figures() -> None:
    sizes = printed(tables.size_table(ITEMS))
    assert "9.00" in sizes
    assert "0.900" in sizes
    targets = printed(tables.target_table(ITEMS))
    assert "450/300/400" in targets
    assert "100/-/-" in targets
    summary = printed(tables.summary_table(summarize(ITEMS)))
    assert "0.900 (spot)" in summary
    assert "800,000" in summary
    assert "- (none)" in summary
    lines = [" ".join(line.split()) for line in printed(tables.target_summary_table(summarize(ITEMS))).splitlines()]
    assert "12 3.0e-03 1.50 1.50 0 of 1 1.50 1.50 0 of 1" in lines
    assert "14 1.2e-04 - - - - - -" in lines
