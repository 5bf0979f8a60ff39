from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.quantize import quantize
from meshtide_codec.sphere import PAPER_FILTERS
from meshtide_lab.paper.experiment import SCHEMES, run_scheme
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS
from meshtide_lab.paper.published import published
from meshtide_lab.paper.run import named_mesh

DOCUMENT = Path(__file__).parents[2] / "docs" / "paper.md"


def rate_table() -> dict[str, list[str]]:
    """The document's rates by mesh: two of each filter, written as one cell."""
    text = DOCUMENT.read_text(encoding="utf-8").partition("## Rates")[2].partition("## Section 5")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if "|" in line]
    return {name: cells for name, _, *cells in rows[2:]}


@pytest.mark.parametrize("name", ["sphere", "round-table", "spot"])
def test_the_documents_rates_are_those_that_are_found(name: str) -> None:
    quantized = quantize(named_mesh(name, [])[2], 10)
    found = []
    for filter_name in PICTURED_FILTERS:
        options = replace(ClassicOptions(bits=10), filter=PAPER_FILTERS[filter_name])
        rates = [run_scheme(quantized, options, scheme)[0].sizes.rate for scheme in SCHEMES]
        found.append(" / ".join(f"{rate:.2f}" for rate in rates))
    assert rate_table()[name] == found


def test_the_documents_published_rates_are_those_of_the_data_file() -> None:
    table = rate_table()
    for name, mesh in published().meshes.items():
        expected = [f"{mesh.multi[each].rate:.2f} / {mesh.single[each].rate:.2f}" for each in PICTURED_FILTERS]
        assert table[f"{name}, published"] == expected
