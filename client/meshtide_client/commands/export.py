"""The command `export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from meshtide_client.commands.options import CaFileOption, TimeoutOption, TokenFileOption
from meshtide_codec.printable import printable, shown
from meshtide_codec.shared_options import JsonOption, OverwriteOption, bits_option, effort_option, profile_option


def export(
    sources: Annotated[
        list[str],
        typer.Argument(help="Mesh files, .tide files, folders of these, or URLs of servers, meshes or .tide files."),
    ],
    static: Annotated[Path, typer.Option(help="Folder to write.")],
    bits: Annotated[int, bits_option()] = 12,
    profile: Annotated[str, profile_option()] = "compact",
    effort: Annotated[str | None, effort_option()] = None,
    timeout: TimeoutOption = 30.0,
    token_file: TokenFileOption = None,
    ca_file: CaFileOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a folder of .tide files, with a list of them, that any web server can host.

    Meshes that an earlier export wrote from the same source are replaced; others in the folder stay. -B, --profile
    and --effort apply to mesh files, which are encoded here. A mesh that fails is reported and leaves nothing; the
    others are still exported, and the exit code is 1.

    Example: meshtide export scans/ http://localhost:8000 --static site; python -m http.server --directory site
    """
    import asyncio
    from dataclasses import asdict

    from meshtide_client.connection.credentials import find_token
    from meshtide_client.connection.link import Link
    from meshtide_client.export.site import export_static
    from meshtide_codec.command_line import LONGEST_EXPLANATION, ExitCode, progress_bar
    from meshtide_codec.command_options import profile_options
    from meshtide_codec.json_text import json_text

    options = profile_options(profile, bits, {"effort": effort}, {})
    link = Link(timeout=timeout, token=find_token(token_file), ca_file=ca_file)

    def notify(sentence: str) -> None:
        typer.echo(printable(sentence, LONGEST_EXPLANATION), err=True)

    with progress_bar("export"):
        exported = asyncio.run(
            export_static(sources, static, options=options, link=link, notify=notify, overwrite=overwrite)
        )
    if as_json:
        failed = [{"source": failure.source, "error": failure.error} for failure in exported.failed]
        typer.echo(
            json_text({"folder": str(static), "meshes": [asdict(mesh) for mesh in exported.meshes], "failed": failed})
        )
    else:
        size = sum(mesh.bytes or 0 for mesh in exported.meshes)
        failures = f"; {len(exported.failed)} failed" if exported.failed else ""
        typer.echo(f"{shown(static)}: {len(exported.meshes)} meshes, {size} bytes{failures}")
    if exported.failed:
        raise typer.Exit(ExitCode.FAILURE)
