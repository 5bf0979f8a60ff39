"""The command `meshes`."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

import typer

from meshtide_client.commands.options import CaFileOption, TimeoutOption, TokenFileOption
from meshtide_codec.shared_options import JsonOption

_MOMENTS = ["%Y-%m-%d", "%Y-%m-%dT%H:%M:%S", "%Y-%m-%dT%H:%M:%S%z"]


def meshes(
    url: Annotated[str, typer.Argument(help="Address of the server: http://host:port.")],
    text: Annotated[
        str, typer.Option("-q", "--search", help="Words that must all occur in the id, the name or the tags.")
    ] = "",
    tag: Annotated[list[str] | None, typer.Option(help="Tag that it must have. May be repeated.")] = None,
    licence: Annotated[str, typer.Option(help="Words that must all occur in its licence.")] = "",
    status: Annotated[Literal["ready", "encoding", "failed"] | None, typer.Option(help="State of the mesh.")] = None,
    smallest: Annotated[int | None, typer.Option(min=0, help="Minimum bytes of the stream.")] = None,
    largest: Annotated[int | None, typer.Option(min=0, help="Maximum bytes of the stream.")] = None,
    fewest_vertices: Annotated[int | None, typer.Option(min=0, help="Minimum number of vertices.")] = None,
    most_vertices: Annotated[int | None, typer.Option(min=0, help="Maximum number of vertices.")] = None,
    fewest_levels: Annotated[int | None, typer.Option(min=0, help="Minimum number of states it can show.")] = None,
    most_levels: Annotated[int | None, typer.Option(min=0, help="Maximum number of states it can show.")] = None,
    created_after: Annotated[
        datetime | None,
        typer.Option(
            metavar="MOMENT",
            formats=_MOMENTS,
            help="Published after this moment, such as 2026-11-30; in UTC unless it names a zone.",
        ),
    ] = None,
    created_before: Annotated[
        datetime | None,
        typer.Option(
            metavar="MOMENT",
            formats=_MOMENTS,
            help="Published before this moment, such as 2026-11-30; in UTC unless it names a zone.",
        ),
    ] = None,
    box: Annotated[
        tuple[float, float, float, float, float, float] | None,
        typer.Option(metavar="X Y Z X Y Z", help="Box that the mesh's own must meet: smallest x, y, z, then largest."),
    ] = None,
    after: Annotated[str, typer.Option(help="Only ids that sort after this one.")] = "",
    limit: Annotated[int | None, typer.Option(min=1, help="Maximum number of meshes.", show_default="all")] = None,
    timeout: TimeoutOption = 30.0,
    token_file: TokenFileOption = None,
    ca_file: CaFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """List the meshes that a server hosts, or those that match a search.

    Example: meshtide meshes http://localhost:8000 --search bust --tag scan --fewest-vertices 100000 --limit 20
    """
    from dataclasses import asdict

    from rich.console import Console
    from rich.text import Text

    from meshtide_client.connection.address import ServerAddress
    from meshtide_client.connection.credentials import find_token
    from meshtide_client.remote.listing import list_meshes
    from meshtide_codec.json_text import json_text
    from meshtide_codec.stream.mesh_query import MeshQuery

    search = MeshQuery(
        text=text,
        tags=tuple(tag or ()),
        licence=licence,
        status=status,
        smallest=smallest,
        largest=largest,
        fewest_vertices=fewest_vertices,
        most_vertices=most_vertices,
        fewest_levels=fewest_levels,
        most_levels=most_levels,
        created_after=created_after,
        created_before=created_before,
        box=box,
        after=after,
    )
    with Console(stderr=True).status(Text(f"asking {ServerAddress.parse(url)}")) as shown:
        hosted = list_meshes(
            url,
            search=search,
            limit=limit,
            timeout=timeout,
            token=find_token(token_file),
            ca_file=ca_file,
            progress=lambda count: shown.update(f"{count} meshes"),
        )
    if as_json:
        typer.echo(json_text({"server": str(ServerAddress.parse(url)), "meshes": [asdict(mesh) for mesh in hosted]}))
        return
    from meshtide_client.commands.meshes_table import listing_table
    from meshtide_codec.command_line import wide_console

    nothing = "the server hosts no such meshes" if search.parameters() else "the server hosts no meshes"
    wide_console().print(listing_table(hosted) if hosted else nothing)
