"""The command `demo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from meshtide_codec.shared_options import OverwriteOption


def demo(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the levels.")] = Path("demo-output"),
    mesh: Annotated[str, typer.Option(help="Sample mesh: stanford-bunny or spot.")] = "stanford-bunny",
    rate: Annotated[float | None, typer.Option(help="Limit to this many bytes a second, as on a slow link.")] = None,
    wait: Annotated[float, typer.Option(help="Seconds to wait for the server to start and to encode.")] = 600.0,
    picture: Annotated[bool, typer.Option(help="Draw the levels side by side in levels.png.")] = True,
    overwrite: OverwriteOption = False,
) -> None:
    """Start a server with the sample meshes, fetch one of them level by level, and check the result.

    Example: meshtide demo --rate 20000
    """
    from meshtide_client.commands.demonstration import run_demo

    run_demo(output, mesh, rate=rate, wait=wait, draw=picture, overwrite=overwrite)
