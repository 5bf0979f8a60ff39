"""Rewrites the table of settings in docs/operate.md from the settings themselves: python tools/settings_table.py.

A test holds the table against them.
"""

from __future__ import annotations

import sys
import typing
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING

from pydantic import SecretStr

from meshtide_server.serve_options import option_names
from meshtide_server.settings import Settings

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

DOCUMENT = Path(__file__).parents[1] / "docs" / "operate.md"
BEGIN, END = "<!-- settings -->\n", "<!-- end of settings -->\n"


def table() -> str:
    """A Markdown table of every setting: variable, flag, default, meaning."""
    rows = ["| environment variable | option of `meshtide serve` | default | meaning |", "|---|---|---|---|"]
    options = option_names()
    for name, field in Settings.model_fields.items():
        meaning = " ".join((field.description or "").split()).replace("|", "\\|")
        option = f"`{options[name]}`" if name in options else ""
        rows.append(f"| `MESHTIDE_{name.upper()}` | {option} | {_default(field)} | {meaning} |")
    return "\n".join(rows) + "\n"


def _default(field: FieldInfo) -> str:
    value = field.get_default(call_default_factory=True)
    if value is None or value == () or _is_secret(field.annotation):
        return ""
    if isinstance(value, tuple):
        return f"`{','.join(map(str, value))}`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def _is_secret(annotation: object) -> bool:
    if annotation is SecretStr:
        return True
    union = typing.get_origin(annotation) in (typing.Union, UnionType, tuple)
    return union and any(_is_secret(part) for part in typing.get_args(annotation))


def replaced(document: str) -> str:
    """`document` with the table in its place."""
    before, rest = document.split(BEGIN)
    _, after = rest.split(END)
    return before + BEGIN + table() + END + after


def main() -> int:
    """Rewrite the document."""
    DOCUMENT.write_text(replaced(DOCUMENT.read_text()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
