from __future__ import annotations

import base64
from xml.etree import ElementTree as ET

import pytest

from meshtide_lab.paper import page


def test_text_is_escaped_everywhere() -> None:
    nasty = '<script>&"'
    blocks = [
        page.heading(nasty, 2, nasty),
        page.paragraph(nasty),
        page.contents([(nasty, nasty)]),
        page.table([nasty], [[nasty]]),
        page.figure(b"x", nasty),
    ]
    assert "<script>" not in page.page(nasty, blocks)
    for block in blocks:
        ET.fromstring(block)  # noqa: S314 - our own text, held to be well-formed


def test_a_table_has_its_cells_and_classes() -> None:
    root = ET.fromstring(page.table(["a", "b"], [["x", "1"], ["y", "2"]], [["text", "best"], ["text", ""]]))  # noqa: S314
    assert [cell.text for cell in root.iter("td")] == ["x", "1", "y", "2"]
    assert [cell.get("class") for cell in root.iter("td")] == ["text", "best", "text", ""]


def test_rows_of_another_length_are_refused() -> None:
    with pytest.raises(ValueError, match="shorter|longer"):
        page.table(["a", "b"], [["x"]])


def test_a_picture_stands_in_the_page() -> None:
    assert base64.b64encode(b"picture").decode() in page.figure(b"picture", "what it shows")
