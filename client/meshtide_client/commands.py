"""The client's part of the command `meshtide`: fetch, meshes, ingest, export, demo; others have folders of their own.

Imports of anything heavy happen inside the commands, so that `meshtide --help` answers at once.
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from meshtide_client.curation.commands import register as register_curation
from meshtide_client.paper.commands import register as register_paper
from meshtide_client.rendering.commands import register as register_rendering
from meshtide_client.server_options import CaFileOption
from meshtide_client.simulation.commands import register as register_simulation
from meshtide_codec.printable import printable, shown
from meshtide_codec.shared_options import MaxFacesOption, MaxVerticesOption, OverwriteOption, named_path

if TYPE_CHECKING:
    from meshtide_client.link.lossy_link import LossyLink

JsonOption = Annotated[bool, typer.Option("--json", help="Print the answer as one JSON object.")]
TimeoutOption = Annotated[float, typer.Option(help="Seconds without any news until the connection counts as lost.")]
TokenFileOption = Annotated[
    Path | None, typer.Option(help="File that holds the token for the server; without it, MESHTIDE_TOKEN is the token.")
]
_MOMENTS = ["%Y-%m-%d", "%Y-%m-%dT%H:%M:%S", "%Y-%m-%dT%H:%M:%S%z"]
RateOption = Annotated[float | None, typer.Option(help="Take no more than so many bytes a second.")]


def register(app: typer.Typer) -> None:
    """Add the client's commands to `app`."""
    app.command()(fetch)
    app.command()(meshes)
    app.command()(ingest)
    app.command()(export)
    app.command()(demo)
    register_curation(app)
    register_rendering(app)
    register_paper(app)
    register_simulation(app)


def fetch(
    url: Annotated[
        str, typer.Argument(help="The mesh: http://host:port/meshes/ID, or any .tide file: its URL, s3://..., a path.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Mesh file to write; default: the mesh's id with .ply.",
            parser=named_path,
        ),
    ] = None,
    kind: Annotated[
        str | None, typer.Option("--format", help="Of the mesh file, such as obj; default: as its name ends, or ply.")
    ] = None,
    until_level: Annotated[
        int | None, typer.Option(min=0, help="Fetch what this level needs; 0 is the finest.")
    ] = None,
    max_bytes: Annotated[
        int | None, typer.Option(min=0, help="Fetch the finest level that fits into so many bytes.")
    ] = None,
    max_error: Annotated[
        float | None,
        typer.Option(min=0.0, help="Stop at an RMS error of this fraction of the bounding box's diagonal."),
    ] = None,
    keep_levels: Annotated[Path | None, typer.Option(help="Folder to write every level to, as PLY.")] = None,
    stream_file: Annotated[
        Path | None,
        typer.Option(
            help="Keep the stream in this .tide file; what it holds of it is not fetched again.",
            parser=named_path,
        ),
    ] = None,
    timeout: TimeoutOption = 30.0,
    retries: Annotated[int, typer.Option(min=0, help="How often to reconnect without progress before giving up.")] = 5,
    rate: RateOption = None,
    transport: Annotated[
        str, typer.Option(help="websocket, http (ranges), download (one plain request); auto: the first that works.")
    ] = "auto",
    token_file: TokenFileOption = None,
    ca_file: CaFileOption = None,
    loss: Annotated[
        str | None,
        typer.Option(help="Send the packets over a lossy link, such as 'gilbert:p=0.05,r=0.5 + deadline:seconds=2'."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the lossy link: the same seed loses the same packets.")] = 0,
    unprotected: Annotated[
        str, typer.Option(help="What the link may lose besides Diffs: base,map-conn,param,preview, or all.")
    ] = "",
    overwrite: OverwriteOption = False,
    max_vertices: MaxVerticesOption = None,
    max_faces: MaxFacesOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fetch a mesh from a server, level by level.

    An interrupted download is gone on with when the same command is repeated: what has arrived is kept beside the
    output, in a file that ends in .partial.tide. An existing output is replaced only with --overwrite, and only when
    the mesh is complete; a --stream-file that holds another stream is left alone without it, and renamed with it. Of
    several fetches into one file at once, one goes on and the others say so.

    Example: meshtide fetch http://localhost:8000/meshes/stanford-bunny -o bunny.ply --max-error 0.005

    With --loss, packets are lost, late or perturbed before they are decoded, as by `meshtide simulate`; the server
    sends them all, and --stream-file keeps them all.

    Example: meshtide fetch http://localhost:8000/meshes/stanford-bunny --loss loss:rate=0.1 --seed 3
    """
    from meshtide_client.credentials import find_token
    from meshtide_client.display import Display, result_json, result_line
    from meshtide_client.fetching import fetch as fetch_mesh
    from meshtide_client.tide_address import parse_address
    from meshtide_client.transport import Link
    from meshtide_codec.limits import wanted_limits
    from meshtide_codec.output_files import is_standard_output
    from meshtide_codec.stream.session import Until

    address = parse_address(url)
    target = output or Path(f"{address.file_stem}.ply")
    lossy = _lossy_link(loss, seed, unprotected)
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
        _print_json(result_json(result, output=target, stream_file=stream_file), err=aside)
    else:
        typer.echo(result_line(result, target), err=aside)


def meshes(
    url: Annotated[str, typer.Argument(help="Address of the server: http://host:port.")],
    text: Annotated[
        str, typer.Option("-q", "--search", help="Words that all stand in the id, the name or the tags.")
    ] = "",
    tag: Annotated[list[str] | None, typer.Option(help="Tag that it has. May be repeated.")] = None,
    licence: Annotated[str, typer.Option(help="Words that all stand in the text of its terms.")] = "",
    status: Annotated[Literal["ready", "encoding", "failed"] | None, typer.Option(help="In which state it is.")] = None,
    smallest: Annotated[int | None, typer.Option(min=0, help="Bytes of its stream, at least.")] = None,
    largest: Annotated[int | None, typer.Option(min=0, help="Bytes of its stream, at most.")] = None,
    fewest_vertices: Annotated[int | None, typer.Option(min=0, help="Vertices, at least.")] = None,
    most_vertices: Annotated[int | None, typer.Option(min=0, help="Vertices, at most.")] = None,
    fewest_levels: Annotated[int | None, typer.Option(min=0, help="States that it can show, at least.")] = None,
    most_levels: Annotated[int | None, typer.Option(min=0, help="States that it can show, at most.")] = None,
    created_after: Annotated[
        datetime | None,
        typer.Option(
            metavar="MOMENT",
            formats=_MOMENTS,
            help="Published after this moment, such as 2026-11-30; UTC without a zone.",
        ),
    ] = None,
    created_before: Annotated[
        datetime | None,
        typer.Option(
            metavar="MOMENT",
            formats=_MOMENTS,
            help="Published before this moment, such as 2026-11-30; UTC without a zone.",
        ),
    ] = None,
    box: Annotated[
        tuple[float, float, float, float, float, float] | None,
        typer.Option(metavar="X Y Z X Y Z", help="A box that its own touches: the smallest x, y, z, then the largest."),
    ] = None,
    after: Annotated[str, typer.Option(help="Only ids that come after this one.")] = "",
    limit: Annotated[int | None, typer.Option(min=1, help="How many at most.", show_default="all")] = None,
    timeout: TimeoutOption = 30.0,
    token_file: TokenFileOption = None,
    ca_file: CaFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """List the meshes that a server hosts, or those of them that are asked for.

    Example: meshtide meshes http://localhost:8000 --search bust --tag scan --fewest-vertices 100000 --limit 20
    """
    from dataclasses import asdict

    from rich.console import Console
    from rich.text import Text

    from meshtide_client.address import ServerAddress
    from meshtide_client.credentials import find_token
    from meshtide_client.listing import list_meshes
    from meshtide_client.mesh_search import MeshSearch

    search = MeshSearch(
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
        _print_json({"server": str(ServerAddress.parse(url)), "meshes": [asdict(mesh) for mesh in hosted]})
        return
    from meshtide_client.listing_table import listing_table
    from meshtide_codec.command_line import wide_console

    nothing = "the server hosts no such meshes" if search.parameters() else "the server hosts no meshes"
    wide_console().print(listing_table(hosted) if hosted else nothing)


def ingest(
    paths: Annotated[list[Path], typer.Argument(help="Mesh files, .tide files, and folders of them.")],
    server: Annotated[str | None, typer.Option(help="Upload to the server at http://host:port.")] = None,
    data: Annotated[
        Path | None, typer.Option(help="Publish without a server, in this folder: what `serve --data` shows.")
    ] = None,
    store: Annotated[
        str | None, typer.Option(help="Publish without a server, in a folder or s3://bucket/folder; with --database.")
    ] = None,
    database: Annotated[
        str | None,
        typer.Option(
            help="Its catalogue: sqlite:///file.db or postgresql://host/name; default: MESHTIDE_DATABASE, which may "
            "hold a password."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, max=1024, help="Encode in so many processes here; default: one a processor, 8 at most."),
    ] = None,
    distributed: Annotated[
        str | None, typer.Option(help="Encode on the Dask cluster of the scheduler tcp://host:8786 (extra dask).")
    ] = None,
    bits: Annotated[
        int | None, typer.Option("-B", "--bits", help="Bits per coordinate; default: the server's.")
    ] = None,
    profile: Annotated[str | None, typer.Option(help="compact or classic; default: the server's.")] = None,
    effort: Annotated[
        str | None, typer.Option(help="compact: default, or high: smaller and slower; default: the server's.")
    ] = None,
    tag: Annotated[list[str] | None, typer.Option(help="To find them by; may be repeated.")] = None,
    licence: Annotated[str, typer.Option(help="The text of their terms.")] = "",
    replace: Annotated[
        bool, typer.Option("--replace", help="Make again what is there by its content, or else by its name.")
    ] = False,
    parallel: Annotated[int, typer.Option(min=1, max=64, help="Uploads at a time.")] = 4,
    timeout: TimeoutOption = 30.0,
    token_file: TokenFileOption = None,
    ca_file: CaFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Put many meshes online: upload them to a server, or encode them here, or on a cluster, into its store.

    Contents that are there already are left alone, whatever their files are called, so an ingest that was interrupted
    goes on when the command is repeated. Uploads take a write token. Exit code 1 if any file failed. What lies in a
    folder and is no file, such as a link that leads nowhere, is told and skipped.

    Example: MESHTIDE_TOKEN=... meshtide ingest scans/ --server http://localhost:8000

    Example: meshtide ingest scans/ --store s3://bucket/meshes --database postgresql://host/meshes --workers 8
    """
    from meshtide_client.credentials import find_token
    from meshtide_client.ingest import ingest as ingest_files
    from meshtide_client.ingest_display import IngestDisplay, print_ingested
    from meshtide_client.ingest_plan import mesh_files
    from meshtide_client.secrecy import shown_address
    from meshtide_client.store_ingest import ingest_into_store
    from meshtide_codec.command_line import ExitCode
    from meshtide_codec.errors import OptionError

    into_store = (data, store, database, workers, distributed) != (None,) * 5
    if into_store == (server is not None):
        raise OptionError("say where to: --server, or --data, or --store and --database")
    files, skipped = mesh_files(paths)
    how = {"bits": bits, "profile": profile, "effort": effort}
    with IngestDisplay(len(files), quiet=as_json) as display:
        for odd in skipped:
            display.skip(odd)
        if server is not None:
            given = {**how, "tag": tag, "licence": licence or None}
            results = ingest_files(
                files,
                server,
                token=find_token(token_file) if token_file else None,
                ca_file=ca_file,
                parallel=parallel,
                timeout=timeout,
                replace=replace,
                options={name: value for name, value in given.items() if value is not None},
                progress=display.tell,
            )
        else:
            where = {"data": data, "store": store, "database": database, "workers": workers, "scheduler": distributed}
            told = {"tags": tuple(tag or ()), "licence": licence}
            options = {**where, **how, **told, "patience": timeout}
            results = ingest_into_store(files, options, replace=replace, progress=display.tell, stage=display.stage)
    place = {"server": server and shown_address(server), "data": data, "store": store, "scheduler": distributed}
    if print_ingested(
        [*results, *skipped], {name: str(value) for name, value in place.items() if value is not None}, as_json=as_json
    ):
        raise typer.Exit(ExitCode.FAILURE)


def export(
    sources: Annotated[
        list[str],
        typer.Argument(help="Meshes, .tide files, folders of them, or addresses: of servers, meshes, .tide files."),
    ],
    static: Annotated[Path, typer.Option(help="Folder to write to; any web server can host it.")],
    bits: Annotated[int, typer.Option("-B", "--bits", help="Bits per coordinate for meshes encoded here.")] = 12,
    profile: Annotated[str, typer.Option(help="How meshes are encoded here: compact or classic.")] = "compact",
    effort: Annotated[
        str | None, typer.Option(help="compact: default, or high: smaller, and slower.", show_default=False)
    ] = None,
    timeout: TimeoutOption = 30.0,
    token_file: TokenFileOption = None,
    ca_file: CaFileOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a folder of .tide files, with a list of them, that works on any web server.

    What an earlier export of the same source put there is made anew; other meshes of the folder stay. A mesh that fails
    is told and stops no other; exit code 1 if any did.

    Example: meshtide export scans/ http://localhost:8000 --static site; python -m http.server --directory site
    """
    import asyncio
    from dataclasses import asdict

    from meshtide_client.credentials import find_token
    from meshtide_client.static_export import export_static
    from meshtide_client.transport import Link
    from meshtide_codec.command_line import LONGEST_EXPLANATION, ExitCode, progress_bar
    from meshtide_codec.command_options import profile_options

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
        _print_json({"folder": str(static), "meshes": [asdict(mesh) for mesh in exported.meshes], "failed": failed})
    else:
        size = sum(mesh.bytes or 0 for mesh in exported.meshes)
        failures = f"; {len(exported.failed)} failed" if exported.failed else ""
        typer.echo(f"{shown(static)}: {len(exported.meshes)} meshes, {size} bytes{failures}")
    if exported.failed:
        raise typer.Exit(ExitCode.FAILURE)


def demo(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the levels.")] = Path("demo-output"),
    mesh: Annotated[str, typer.Option(help="Sample to show: stanford-bunny or spot.")] = "stanford-bunny",
    rate: Annotated[
        float | None, typer.Option(help="Bytes a second, to watch the tide come in as on a slow link.")
    ] = None,
    wait: Annotated[float, typer.Option(help="Seconds to wait for the server and for its encoding.")] = 600.0,
    picture: Annotated[bool, typer.Option(help="Draw the levels side by side into levels.png.")] = True,
    overwrite: OverwriteOption = False,
) -> None:
    """Start a server with the sample meshes, fetch one of them level by level, and check the result.

    Example: meshtide demo --rate 20000
    """
    from meshtide_client.demo import run_demo

    run_demo(output, mesh, rate=rate, wait=wait, draw=picture, overwrite=overwrite)


def _lossy_link(loss: str | None, seed: int, unprotected: str) -> LossyLink | None:
    from meshtide_client.link.lossy_link import LossyLink
    from meshtide_codec.errors import OptionError

    if loss is None:
        if unprotected:
            raise OptionError("--unprotected is about a lossy link; give one with --loss")
        return None
    return LossyLink.parse(loss, seed, unprotected)


def _print_json(answer: object, *, err: bool = False) -> None:
    from meshtide_codec.json_text import json_text

    typer.echo(json_text(answer), err=err)
