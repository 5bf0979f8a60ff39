"""The parts of an HTML page that stands by itself: tables of formatted cells, pictures as data, a quiet style."""

from __future__ import annotations

import base64
import html
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

STYLE = """
:root { color-scheme: light; --ink: #23262b; --faint: #6a7078; --line: #d9dbdf; --paper: #faf9f6; --mark: #1c5d8c; }
body { font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; color: var(--ink); background: var(--paper);
       margin: 0 auto; max-width: 72rem; padding: 1.5rem 2rem 4rem; }
h1 { font-size: 1.9rem; line-height: 1.2; }
h2 { margin-top: 3rem; border-top: 2px solid var(--line); padding-top: 1rem; }
h3 { margin: 2rem 0 .4rem; }
p { max-width: 48rem; }
a { color: var(--mark); }
nav ul { columns: 2; padding-left: 1.2rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: .5rem 0 1rem; font-variant-numeric: tabular-nums; }
th, td { padding: .22rem .7rem; border-bottom: 1px solid var(--line); text-align: right; white-space: nowrap; }
th { font-weight: 600; vertical-align: bottom; white-space: normal; max-width: 9rem; border-color: var(--ink); }
th.text, td.text { text-align: left; white-space: normal; min-width: 12rem; }
th.name, td.name { text-align: left; }
td.published { color: var(--faint); }
td.best { font-weight: 700; }
td.yes, td.no { text-align: center; }
td.yes::before { content: "\\2713 "; color: #2a7d3f; }
td.no::before { content: "\\2717 "; color: #b03a2e; }
figure { margin: 1rem 0 2rem; }
figure img { max-width: 100%; height: auto; border: 1px solid var(--line); }
figcaption, .note { color: var(--faint); font-size: .9rem; max-width: 48rem; }
"""


def page(title: str, body: Iterable[str]) -> str:
    """A whole page around blocks of HTML."""
    head = (
        f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{html.escape(title)}</title>'
    )
    text = "\n".join(body)
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head>{head}<style>{STYLE}</style></head>\n<body>\n{text}\n</body></html>\n'
    )


def heading(text: str, rank: int, anchor: str | None = None) -> str:
    """A heading; `anchor` is what links name."""
    place = f' id="{html.escape(anchor)}"' if anchor else ""
    return f"<h{rank}{place}>{html.escape(text)}</h{rank}>"


def paragraph(text: str, *, note: bool = False) -> str:
    """A paragraph of plain text; a note is smaller."""
    return f'<p class="note">{html.escape(text)}</p>' if note else f"<p>{html.escape(text)}</p>"


def contents(entries: Sequence[tuple[str, str]]) -> str:
    """A list of links from anchors and texts."""
    links = "".join(f'<li><a href="#{html.escape(anchor)}">{html.escape(text)}</a></li>' for anchor, text in entries)
    return f"<nav><ul>{links}</ul></nav>"


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], classes: Sequence[Sequence[str]] | None = None) -> str:
    """A table of cells of plain text; its first column holds names.

    Args:
        columns: heads.
        rows: cells.
        classes: a class of the style for each cell, or an empty text.
    """
    kinds = classes or [["name", *[""] * (len(columns) - 1)]] * len(rows)
    first = kinds[0] if kinds else [""] * len(columns)
    heads = "".join(
        f'<th class="{_column_class(kind)}">{html.escape(column)}</th>'
        for kind, column in zip(first, columns, strict=True)
    )
    body = "\n".join(
        "<tr>"
        + "".join(f'<td class="{kind}">{html.escape(cell)}</td>' for cell, kind in zip(row, kinds_of_row, strict=True))
        + "</tr>"
        for row, kinds_of_row in zip(rows, kinds, strict=True)
    )
    return f'<div class="wide"><table><tr>{heads}</tr>\n{body}\n</table></div>'


def _column_class(kind: str) -> str:
    """The class of a head, from that of the first cell below: texts and names stand left, figures right."""
    return next((word for word in kind.split() if word in {"text", "name"}), "")


def figure(picture: bytes, caption: str) -> str:
    """A PNG picture inside of the page."""
    data = base64.b64encode(picture).decode()
    text = html.escape(caption)
    return f'<figure><img src="data:image/png;base64,{data}" alt="{text}"/><figcaption>{text}</figcaption></figure>'
