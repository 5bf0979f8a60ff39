"""The commands `edit`, `delete` and `tags`."""

from __future__ import annotations

from typing import Annotated

import typer

from meshtide_client.commands.options import CaFileOption, TimeoutOption, TokenFileOption
from meshtide_client.connection.secrecy import shown_address
from meshtide_codec.command_line import LONGEST_EXPLANATION
from meshtide_codec.json_text import json_text
from meshtide_codec.printable import printable, shown
from meshtide_codec.shared_options import JsonOption

Mesh = Annotated[str, typer.Argument(help="The mesh: http://host:port/meshes/ID.")]


def edit(
    url: Mesh,
    name: Annotated[str | None, typer.Option(help="New name.")] = None,
    tag: Annotated[list[str] | None, typer.Option(help="New tag; replaces all tags. May be repeated.")] = None,
    no_tags: Annotated[bool, typer.Option("--no-tags", help="Remove all tags.")] = False,
    licence: Annotated[str | None, typer.Option(help="New text of its licence or terms of use.")] = None,
    timeout: TimeoutOption = 30.0,
    token_file: TokenFileOption = None,
    ca_file: CaFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Change the name, tags or licence of a published mesh; it is not encoded again. Needs a write token.

    Example: MESHTIDE_TOKEN=... meshtide edit http://localhost:8000/meshes/vase --tag clay --licence "CC BY 4.0"
    """
    from dataclasses import asdict

    from meshtide_client.connection.credentials import find_token
    from meshtide_client.remote.edit import change_mesh
    from meshtide_codec.errors import OptionError

    if tag and no_tags:
        raise OptionError("--tag and --no-tags contradict each other; give one of them")
    wanted = [] if no_tags else tag
    mesh = change_mesh(
        url, name=name, tags=wanted, licence=licence, timeout=timeout, token=find_token(token_file), ca_file=ca_file
    )
    if as_json:
        typer.echo(json_text(asdict(mesh)))
    else:
        line = f"{mesh.id}: {mesh.name}; tags: {', '.join(mesh.tags) or 'none'}; terms: {mesh.licence or 'none'}"
        typer.echo(printable(line, LONGEST_EXPLANATION))


def delete(
    urls: Annotated[list[str], typer.Argument(help="Meshes: http://host:port/meshes/ID.")],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask for confirmation.")] = False,
    timeout: TimeoutOption = 30.0,
    token_file: TokenFileOption = None,
    ca_file: CaFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Delete published meshes from a server, for good. Needs a write token.

    Example: MESHTIDE_TOKEN=... meshtide delete http://localhost:8000/meshes/vase --yes
    """
    from meshtide_client.connection.credentials import find_token
    from meshtide_client.remote.edit import delete_mesh

    if not yes:
        typer.confirm(f"delete {', '.join(shown(shown_address(url)) for url in urls)}?", abort=True, err=True)
    for url in urls:
        delete_mesh(url, timeout=timeout, token=find_token(token_file), ca_file=ca_file)
        if not as_json:
            typer.echo(f"{shown(shown_address(url))} is deleted")
    if as_json:
        typer.echo(json_text({"deleted": [shown_address(url) for url in urls]}))


def tags(
    url: Annotated[str, typer.Argument(help="Address of the server: http://host:port.")],
    limit: Annotated[int, typer.Option(min=1, max=1000, help="Maximum number of tags.")] = 1000,
    timeout: TimeoutOption = 30.0,
    token_file: TokenFileOption = None,
    ca_file: CaFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """List the tags of a server's published meshes, the most used first.

    Example: meshtide tags http://localhost:8000
    """
    from meshtide_client.connection.credentials import find_token
    from meshtide_client.remote.edit import list_tags

    found = list_tags(url, limit=limit, timeout=timeout, token=find_token(token_file), ca_file=ca_file)
    if as_json:
        typer.echo(json_text({"tags": found}))
        return
    for tag, count in found.items():
        typer.echo(f"{count}\t{printable(tag)}")
