"""The command `ingest`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from meshtide_client.commands.options import CaFileOption, TimeoutOption, TokenFileOption
from meshtide_codec.shared_options import JsonOption, bits_option, effort_option, profile_option


def ingest(
    paths: Annotated[list[Path], typer.Argument(help="Mesh files, .tide files, and folders of them.")],
    server: Annotated[str | None, typer.Option(help="Upload to the server at http://host:port.")] = None,
    data: Annotated[
        Path | None, typer.Option(help="Publish into this folder, without a server; host it with `serve --data`.")
    ] = None,
    store: Annotated[
        str | None,
        typer.Option(help="Publish into a folder or s3://bucket/folder, with no server; needs --database."),
    ] = None,
    database: Annotated[
        str | None,
        typer.Option(
            help="Catalogue of the store: sqlite:///file.db or postgresql://host/name; by default MESHTIDE_DATABASE, "
            "which may hold a password."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, max=1024, help="Number of processes to encode in; by default one per processor, up to 8."),
    ] = None,
    distributed: Annotated[
        str | None, typer.Option(help="Encode on the Dask cluster of the scheduler tcp://host:8786 (extra dask).")
    ] = None,
    bits: Annotated[int | None, bits_option("the server's")] = None,
    profile: Annotated[str | None, profile_option("the server's")] = None,
    effort: Annotated[str | None, effort_option("the server's")] = None,
    tag: Annotated[list[str] | None, typer.Option(help="Tag to add; may be repeated.")] = None,
    licence: Annotated[str, typer.Option(help="Text of their licence or terms of use.")] = "",
    replace: Annotated[
        bool, typer.Option("--replace", help="Encode again what is there already, by its content or else by its name.")
    ] = False,
    parallel: Annotated[int, typer.Option(min=1, max=64, help="Number of uploads at a time.")] = 4,
    timeout: TimeoutOption = 30.0,
    token_file: TokenFileOption = None,
    ca_file: CaFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Publish many meshes: upload them to a server, or encode them here or on a cluster into its store.

    Files whose content is there already are skipped, whatever their names, so you can run an interrupted ingest again
    to continue it. Uploading needs a write token. A file that fails is reported, and the exit code is 1. Anything in a
    folder that is not a file, such as a broken link, is reported and skipped.

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
                progress=display.report,
            )
        else:
            where = {"data": data, "store": store, "database": database, "workers": workers, "scheduler": distributed}
            about = {"tags": tuple(tag or ()), "licence": licence}
            options = {**where, **how, **about, "patience": timeout}
            results = ingest_into_store(files, options, replace=replace, progress=display.report, stage=display.stage)
    place = {"server": server and shown_address(server), "data": data, "store": store, "scheduler": distributed}
    if print_ingested(
        [*results, *skipped], {name: str(value) for name, value in place.items() if value is not None}, as_json=as_json
    ):
        raise typer.Exit(ExitCode.FAILURE)
