"""The codec's part of the command `meshtide`: one module a command, with what they share beside them.

Imports of anything heavy happen inside the commands, so that `meshtide --help` answers at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import typer


def register(app: typer.Typer) -> None:
    """Add the codec's commands to `app`."""
    from meshtide_codec.commands.decode import decode
    from meshtide_codec.commands.encode import encode
    from meshtide_codec.commands.info import info
    from meshtide_codec.commands.sphere import sphere

    for command in (encode, decode, info, sphere):
        app.command()(command)
