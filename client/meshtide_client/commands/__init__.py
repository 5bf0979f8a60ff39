"""The client's part of the command `meshtide`: one module a command, with what it shows on a screen beside it.

Commands read options and print; what they do is done in the rooms below, all of which they may import. Imports of
anything heavy wait inside of a command until it is called, so that `meshtide --help` answers at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import typer


def register(app: typer.Typer) -> None:
    """Add the client's commands to `app`."""
    from meshtide_client.commands.curate import delete, edit, tags
    from meshtide_client.commands.demo import demo
    from meshtide_client.commands.export import export
    from meshtide_client.commands.fetch import fetch
    from meshtide_client.commands.ingest import ingest
    from meshtide_client.commands.meshes import meshes
    from meshtide_client.commands.render import render

    for command in (fetch, meshes, ingest, export, demo, edit, delete, tags, render):
        app.command()(command)
