"""Rewrites the table of settings in docs/operate.md from the settings themselves: python tools/settings_table.py.

A test holds the table against them.
"""

from __future__ import annotations

import sys
import typing
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any

from pydantic import SecretStr

from meshtide_server.settings import Settings

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

DOCUMENT = Path(__file__).parents[1] / "docs" / "operate.md"
BEGIN, END = "<!-- settings -->\n", "<!-- end of settings -->\n"


def table() -> str:
    """A Markdown table of every setting: variable, flag, default, meaning."""
    rows = ["| environment variable | option of `meshtide serve` | default | meaning |", "|---|---|---|---|"]
    options = serve_options()
    for name, field in Settings.model_fields.items():
        meaning = " ".join((field.description or "").split()).replace("|", "\\|")
        option = f"`{options[name]}`" if name in options else ""
        rows.append(f"| `MESHTIDE_{name.upper()}` | {option} | {_default(field)} | {meaning} |")
    return "\n".join(rows) + "\n"


def serve_options() -> dict[str, str]:
    """The option of `meshtide serve` for each setting that has one."""
    import typer  # noqa: PLC0415 - slow, and only for this

    from meshtide_server.commands import register  # noqa: PLC0415 - the same

    app = typer.Typer()
    register(app)
    app.command("unused")(lambda: None)
    group: Any = typer.main.get_command(app)
    command = group.commands["serve"]
    names = {
        "allow_origin": "allowed_origins",
        "allow_method": "allowed_methods",
        "allow_header": "allowed_headers",
        "unlimited_client": "unlimited_clients",
        "trusted_proxy": "trusted_proxies",
    }
    found = {}
    for parameter in command.params:
        setting = names.get(parameter.name, parameter.name)
        if setting in Settings.model_fields:
            is_option = parameter.param_type_name == "option"
            found[setting] = max(parameter.opts, key=len) if is_option else (parameter.name or "").upper()
    return found


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
