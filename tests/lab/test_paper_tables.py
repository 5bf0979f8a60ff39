from __future__ import annotations

import csv
import io

import pytest

from meshtide_codec.sphere import PAPER_FILTERS, PUBLISHED_MULTI
from meshtide_lab.paper import tables
from meshtide_lab.paper.conclusions import SENTENCES
from paper_results import invented_mesh, invented_results


def test_rates_have_a_row_for_each_scheme_and_filter() -> None:
    rows = tables.rate_rows(invented_mesh())
    assert [(row["scheme"], row["filter"]) for row in rows] == [
        (scheme, name) for scheme in ("multi", "single") for name in PAPER_FILTERS
    ]
    assert all(row["total"] == row["coarsest"] + row["coefficients"] + row["differences"] for row in rows)
    assert {row["published_rate"] for row in rows} == {None}


def test_published_figures_stand_beside_the_sphere_only() -> None:
    rows = {(row["scheme"], row["filter"]): row for row in tables.rate_rows(invented_mesh("sphere"))}
    assert {name: rows["multi", name]["published_rate"] for name in PAPER_FILTERS} == PUBLISHED_MULTI
    assert rows["multi", "degree 3"]["published_total"] == 14440
    assert rows["multi", "degree 2"]["published_total"] is None
    assert rows["single", "degree 2"]["published_rate"] is None
    errors = {row["filter"]: row["published_l2_error"] for row in tables.difference_rows(invented_mesh("sphere"))}
    assert errors["degree 1"] == pytest.approx(1.81e-4)
    assert errors["degree 2"] is None


def test_histograms_count_every_diff() -> None:
    rows = tables.histogram_rows(invented_mesh())
    for name in ("zeroth", "degree 3"):
        chosen = [row for row in rows if row["filter"] == name]
        assert sum(row["count"] for row in chosen) == 3 * 400
        assert [row["difference"] for row in chosen] == sorted(row["difference"] for row in chosen)


def test_a_csv_file_holds_the_rows() -> None:
    rows = tables.norm_rows(invented_mesh())
    read = list(csv.DictReader(io.StringIO(tables.csv_text(rows))))
    assert [row["norm"] for row in read] == [row["norm"] for row in rows]
    assert [float(row["rms"]) for row in read] == [row["rms"] for row in rows]
    assert tables.csv_text([]).strip() == ""


def test_every_sentence_has_a_row() -> None:
    rows = tables.conclusion_rows(invented_mesh())
    assert [row["number"] for row in rows] == list(range(1, len(SENTENCES) + 1))


def test_meshes_tell_their_levels() -> None:
    row = tables.mesh_rows(invented_results().meshes)[0]
    assert row["vertices"] == 400
    assert len(row["level_vertices"].split()) == row["levels"] == len(row["level_bits"].split())
