"""The command `ingest`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from meshtide_client.commands.options import CaFileOption, TimeoutOption, TokenFileOption
from meshtide_codec.shared_options import JsonOption


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
    folder and is not a file, such as a link that leads nowhere, is reported and skipped.

    Example: MESHTIDE_TOKEN=... meshtide ingest scans/ --server http://localhost:8000

    Example: meshtide ingest scans/ --store s3://bucket/meshes --database postgresql://host/meshes --workers 8
    """
    from meshtide_client.commands.ingest_display import IngestDisplay, print_ingested
    from meshtide_client.connection.credentials import find_token
    from meshtide_client.connection.secrecy import shown_address
    from meshtide_client.remote.ingest import ingest as ingest_files
    from meshtide_client.remote.ingest_plan import mesh_files
    from meshtide_client.remote.store_ingest import ingest_into_store
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
            about = {"tags": tuple(tag or ()), "licence": licence}
            options = {**where, **how, **about, "patience": timeout}
            results = ingest_into_store(files, options, replace=replace, progress=display.tell, stage=display.stage)
    place = {"server": server and shown_address(server), "data": data, "store": store, "scheduler": distributed}
    if print_ingested(
        [*results, *skipped], {name: str(value) for name, value in place.items() if value is not None}, as_json=as_json
    ):
        raise typer.Exit(ExitCode.FAILURE)
