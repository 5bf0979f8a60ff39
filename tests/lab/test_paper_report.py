from __future__ import annotations

import re

import pytest

from meshtide_lab.paper.report import report_page
from paper_results import invented_results

KINDS = ("levels", "predictions", "rates", "histograms", "errors")


@pytest.fixture(scope="module")
def text() -> str:
    results = invented_results()
    pictures = {mesh.name: {kind: f"{mesh.name} {kind}".encode() for kind in KINDS} for mesh in results.meshes}
    return report_page(results, pictures)


def test_the_page_needs_nothing_from_elsewhere(text: str) -> None:
    sources = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert all(source.startswith(("data:image/png;base64,", "#")) for source in sources)
    assert "http" not in text
    assert len([source for source in sources if source.startswith("data:")]) == 2 * len(KINDS)


def test_links_lead_to_places_on_the_page(text: str) -> None:
    anchors = set(re.findall(r'id="([^"]*)"', text))
    assert set(re.findall(r'href="#([^"]*)"', text)) <= anchors


def test_failures_are_listed(text: str) -> None:
    assert "&lt;broken&gt;" in text
    assert "no vertices" in text


def test_published_rows_stand_beside_the_sphere_only(text: str) -> None:
    patch, sphere = text.index('id="patch"'), text.index('id="sphere"')
    assert "published, table 15" not in text[patch:sphere]
    assert text[sphere:].count("published, table 15") == 4
    assert text[sphere:].count("published, table 16") == 1
    assert "23.96" in text[sphere:]
