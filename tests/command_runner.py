"""The commands of codec and laboratory, run inside of the test process."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer
from typer.testing import CliRunner

from meshtide_codec.commands import register as register_codec
from meshtide_lab.comparison.commands import register as register_comparison

if TYPE_CHECKING:
    from click.testing import Result


def meshtide(*arguments: object, given: bytes | None = None) -> Result:
    """What a command answers; an error that it raises is its `exception`; `given` stands on its standard input."""
    app = typer.Typer()
    register_codec(app)
    register_comparison(app)
    return CliRunner().invoke(app, [str(argument) for argument in arguments], input=given, catch_exceptions=True)
