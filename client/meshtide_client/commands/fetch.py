"""The command `fetch`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from meshtide_client.commands.options import CaFileOption, TimeoutOption, TokenFileOption
from meshtide_codec.shared_options import (
    JsonOption,
    MaxFacesOption,
    MaxVerticesOption,
    MeshFormatOption,
    OverwriteOption,
    UnprotectedOption,
    named_path,
)

if TYPE_CHECKING:
    from meshtide_client.download.packet_filter import PacketFilter


def fetch(
    url: Annotated[
        str, typer.Argument(help="The mesh: http://host:port/meshes/ID, or any .tide file: its URL, s3://..., a path.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Mesh file to write; by default the mesh's id with .ply.",
            parser=named_path,
        ),
    ] = None,
    kind: MeshFormatOption = None,
    until_level: Annotated[int | None, typer.Option(min=0, help="Stop at this level; 0 is the finest.")] = None,
    max_bytes: Annotated[
        int | None, typer.Option(min=0, help="Fetch the finest level that fits into this many bytes.")
    ] = None,
    max_error: Annotated[
        float | None,
        typer.Option(min=0.0, help="Stop at this RMS error, as a fraction of the bounding box's diagonal."),
    ] = None,
    keep_levels: Annotated[Path | None, typer.Option(help="Folder to write every level to, as PLY files.")] = None,
    stream_file: Annotated[
        Path | None,
        typer.Option(
            help="Keep the stream in this .tide file; what it holds already is not fetched again.",
            parser=named_path,
        ),
    ] = None,
    timeout: TimeoutOption = 30.0,
    retries: Annotated[int, typer.Option(min=0, help="Number of reconnections without progress before giving up.")] = 5,
    rate: Annotated[float | None, typer.Option(help="Limit the download to this many bytes a second.")] = None,
    transport: Annotated[
        str, typer.Option(help="websocket, http (ranges), download (one plain request); auto: the first that works.")
    ] = "auto",
    token_file: TokenFileOption = None,
    ca_file: CaFileOption = None,
    loss: Annotated[
        str | None,
        typer.Option(help="Simulate a lossy link, such as 'gilbert:p=0.05,r=0.5 + deadline:seconds=2'."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the lossy link: the same seed loses the same packets.")] = 0,
    unprotected: UnprotectedOption = "",
    overwrite: OverwriteOption = False,
    max_vertices: MaxVerticesOption = None,
    max_faces: MaxFacesOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fetch a mesh from a server, level by level.

    To continue an interrupted download, run the same command again: what has arrived is kept beside the output, in a
    file that ends in .partial.tide. An existing output is replaced only with --overwrite, and only once the mesh is
    complete. A --stream-file that holds another stream is left alone without --overwrite, and renamed with it. If
    several fetches write to one file at once, one continues and the others stop with a message.

    Example: meshtide fetch http://localhost:8000/meshes/stanford-bunny -o bunny.ply --max-error 0.005

    With --loss, packets are lost, delayed or perturbed before they are decoded, as in `meshtide simulate`. The server
    still sends all of them, and --stream-file keeps all of them.

    Example: meshtide fetch http://localhost:8000/meshes/stanford-bunny --loss loss:rate=0.1 --seed 3
    """
    from meshtide_client.commands.fetch_display import Display, result_json, result_line
    from meshtide_client.connection.credentials import find_token
    from meshtide_client.connection.link import Link
    from meshtide_client.connection.tide_address import parse_address
    from meshtide_client.download.fetch import fetch as fetch_mesh
    from meshtide_codec.json_text import json_text
    from meshtide_codec.limits import wanted_limits
    from meshtide_codec.output_files import is_standard_output
    from meshtide_codec.stream.session import Until

    address = parse_address(url)
    target = output or Path(f"{address.file_stem}.ply")
    lossy = _packet_filter(loss, seed, unprotected)
    display = Display(address.mesh)
    with display.shown():
        result = fetch_mesh(
            url,
            target,
            until=Until(until_level, max_error, max_bytes),
            stream_file=stream_file,
            keep_levels=keep_levels,
            link=Link(timeout=timeout, retries=retries, rate=rate, token=find_token(token_file), ca_file=ca_file),
            transport=transport,
            limits=wanted_limits(max_vertices, max_faces),
            loss=lossy,
            overwrite=overwrite,
            kind=kind,
            on_level=display.on_level,
            notify=display.notify,
            progress=display.progress,
        )
    aside = is_standard_output(target)
    if as_json:
        typer.echo(json_text(result_json(result, output=target, stream_file=stream_file)), err=aside)
    else:
        typer.echo(result_line(result, target), err=aside)


def _packet_filter(loss: str | None, seed: int, unprotected: str) -> PacketFilter | None:
    from meshtide_client.download.packet_filter import find_filter
    from meshtide_codec.errors import OptionError

    if loss is None:
        if unprotected:
            raise OptionError("--unprotected is about a lossy link; give one with --loss")
        return None
    return find_filter()(loss, seed, unprotected)
