"""`python -m meshtide_server`: the command `serve` by itself."""

from __future__ import annotations

import typer

from meshtide_codec.command_line import run
from meshtide_server.commands import serve

app = typer.Typer(add_completion=False)
app.command()(serve)

if __name__ == "__main__":
    run(app)
