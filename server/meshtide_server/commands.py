"""The commands `serve`, `copy-store` and `check-store`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from pydantic import ValidationError


def register(app: typer.Typer) -> None:
    """Add this package's commands to `app`."""
    app.command()(serve)
    app.command()(copy_store)
    app.command()(check_store)


def serve(
    directory: Annotated[
        Path | None, typer.Argument(help="Folder of .tide files and mesh files (ply, obj, off, stl, glb, gltf).")
    ] = None,
    samples: Annotated[bool | None, typer.Option("--samples", help="Host the meshes that come with meshtide.")] = None,
    host: Annotated[str | None, typer.Option(help="Address to listen on.", show_default="127.0.0.1")] = None,
    port: Annotated[
        int | None, typer.Option(help="Port to listen on; 0 takes a free one.", show_default="8000", min=0, max=65535)
    ] = None,
    data: Annotated[Path | None, typer.Option(help="Folder where published meshes are kept.")] = None,
    store: Annotated[
        str | None,
        typer.Option(help="Where their streams are kept: a folder, or s3://bucket/folder.", show_default="in --data"),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option(help="Folder for encoded streams.", show_default="beside the meshes, else the user's cache"),
    ] = None,
    bits: Annotated[
        int | None, typer.Option("-B", "--bits", help="Bits per coordinate for meshes encoded here.", show_default="12")
    ] = None,
    profile: Annotated[
        str | None, typer.Option(help="How meshes are encoded here: compact or classic.", show_default="compact")
    ] = None,
    effort: Annotated[
        str | None,
        typer.Option(
            help="compact: default, or high: smaller, and slower to encode and to decode.", show_default="default"
        ),
    ] = None,
    allow_origin: Annotated[
        list[str] | None, typer.Option(help="Web origin whose pages may read the meshes; * for all. May be repeated.")
    ] = None,
    allow_method: Annotated[
        list[str] | None,
        typer.Option(help="Method of pages of those origins. May be repeated.", show_default="GET, HEAD, POST"),
    ] = None,
    allow_header: Annotated[
        list[str] | None,
        typer.Option(help="Header of pages of those origins. May be repeated.", show_default="what reading takes"),
    ] = None,
    ticket_seconds: Annotated[
        float | None, typer.Option(help="Seconds for which a ticket opens a websocket.", show_default="30")
    ] = None,
    hello_timeout: Annotated[
        float | None, typer.Option(help="Seconds a client has to ask for something.", show_default="10")
    ] = None,
    stall_timeout: Annotated[
        float | None, typer.Option(help="Seconds a stream may stand still.", show_default="300")
    ] = None,
    recursive: Annotated[
        bool | None, typer.Option("--recursive", help="Host subfolders too, under ids with their path.")
    ] = None,
    rescan_seconds: Annotated[
        float | None,
        typer.Option(help="How often to look for new and changed files; 0: never.", show_default="5"),
    ] = None,
    connections_per_client: Annotated[
        int | None, typer.Option(help="Connections of one address at a time; 0: no limit.", show_default="256")
    ] = None,
    bytes_per_second: Annotated[
        int | None, typer.Option(help="Bytes a second sent to one address; 0: no limit.", show_default="0")
    ] = None,
    writes_per_minute: Annotated[
        int | None, typer.Option(help="Requests of one address that write; 0: no limit.", show_default="600")
    ] = None,
    unlimited_client: Annotated[
        list[str] | None,
        typer.Option(help="Network that these limits spare. May be repeated.", show_default="this machine"),
    ] = None,
    trusted_proxy: Annotated[
        list[str] | None,
        typer.Option(help="Network of proxies whose X-Forwarded-For is believed. May be repeated."),
    ] = None,
    drain_timeout: Annotated[
        float | None, typer.Option(help="Seconds that running streams have to end in on SIGTERM.", show_default="5")
    ] = None,
    log_level: Annotated[str | None, typer.Option(help="debug, info, warning or error.", show_default="info")] = None,
    log_format: Annotated[str | None, typer.Option(help="text or json.", show_default="text")] = None,
    access_log: Annotated[bool | None, typer.Option("--access-log", help="Log every request.")] = None,
    metrics: Annotated[
        str | None, typer.Option(help="Who may read /metrics: read, open or off.", show_default="read")
    ] = None,
    assigned: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME=VALUE", help="Any other setting, such as max_upload=1000000. May be repeated."
        ),
    ] = None,
    settings_file: Annotated[
        Path | None,
        typer.Option("--settings", envvar="MESHTIDE_SETTINGS_FILE", help="TOML file of settings; see below."),
    ] = None,
    announce: Annotated[
        bool, typer.Option("--announce", help='Print {"url": ...} on standard output once the server listens.')
    ] = False,
    ready_file: Annotated[
        Path | None, typer.Option(help="Write the same to this file; it is removed when the server stops.")
    ] = None,
) -> None:
    """Host meshes: each one is encoded once, then served as a file and as a stream.

    Example: meshtide serve meshes/

    Example: MESHTIDE_WRITE_TOKENS_FILE=tokens meshtide serve --data kept/ --host 0.0.0.0 --set max_upload=100000000

    Each setting can be given as an argument, by an environment variable, such as MESHTIDE_PORT, or in a TOML file, such
    as port = 8000; the first of these wins. Settings without an option of their own, for --set, environment and file:
    database_file, catalogue_seconds, store_cache_mib, write_tokens_file, read_tokens_file, max_upload,
    upload_stall_timeout, max_vertices, max_faces, max_decode_memory, job_processes, job_seconds, job_processor_seconds,
    job_lost_seconds, job_memory, shutdown_timeout, max_message, max_request_line, max_head, max_headers,
    frames_per_second, control_frames_per_second. For environment and file only, as secrets: database, write_tokens,
    read_tokens. docs/operate.md tells what each of them means.

    SIGTERM and Ctrl-C end it politely, with exit code 0: it takes no new streams and lets running ones end; a second
    signal ends it at once.
    """
    from pydantic import ValidationError

    from meshtide_server.logs import set_up_log
    from meshtide_server.serving import run
    from meshtide_server.settings_sources import load_settings

    given: dict[str, Any] = {
        "directory": directory,
        "samples": samples,
        "host": host,
        "port": port,
        "data": data,
        "store": store,
        "cache": cache,
        "bits": bits,
        "profile": profile,
        "effort": effort,
        "allowed_origins": tuple(allow_origin) if allow_origin else None,
        "allowed_methods": tuple(allow_method) if allow_method else None,
        "allowed_headers": tuple(allow_header) if allow_header else None,
        "ticket_seconds": ticket_seconds,
        "hello_timeout": hello_timeout,
        "stall_timeout": stall_timeout,
        "recursive": recursive,
        "rescan_seconds": rescan_seconds,
        "connections_per_client": connections_per_client,
        "bytes_per_second": bytes_per_second,
        "writes_per_minute": writes_per_minute,
        "unlimited_clients": tuple(unlimited_client) if unlimited_client else None,
        "trusted_proxies": tuple(trusted_proxy) if trusted_proxy else None,
        "drain_timeout": drain_timeout,
        "log_level": log_level,
        "log_format": log_format,
        "access_log": access_log,
        "metrics": metrics,
    }
    try:
        settings = load_settings(
            {name: value for name, value in given.items() if value is not None},
            assigned=assigned or (),
            file=settings_file,
        )
    except ValidationError as error:
        raise typer.BadParameter(explanation(error)) from None
    set_up_log(settings.log_level, settings.log_format)
    run(settings, announce=announce, ready_file=ready_file)


def copy_store(
    source: Annotated[str, typer.Argument(help="Store to read: a folder, or s3://bucket/folder.")],
    target: Annotated[str, typer.Argument(help="Store to fill; what it has already is left alone.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the answer as one JSON object.")] = False,
) -> None:
    """Copy the streams of a store into another one: for a backup, to get one back, or to move.

    Copy the catalogue first (pg_dump, or sqlite3's .backup): its streams are then in the store. Interrupted, the same
    command goes on where it was. What is damaged is told and not copied: exit code 4. Nothing is deleted.

    Example: meshtide copy-store s3://meshes /backup/store
    """
    import asyncio
    import json
    from dataclasses import asdict

    from rich.console import Console

    from meshtide_server.store import open_store
    from meshtide_server.store.copying import Copied
    from meshtide_server.store.copying import copy_store as copy

    def told(copied: Copied) -> str:
        gone = f", {copied.gone} were deleted meanwhile" if copied.gone else ""
        return f"{copied.objects} objects with {copied.bytes} bytes copied, {copied.kept} were there{gone}"

    _check_there(source)
    with Console(stderr=True).status(f"reading {source}") as shown:
        copied = asyncio.run(copy(open_store(source), open_store(target), lambda so_far: shown.update(told(so_far))))
    typer.echo(json.dumps(asdict(copied)) if as_json else told(copied))
    _complain(copied.damaged)


def check_store(
    store: Annotated[str, typer.Argument(help="Store to read: a folder, or s3://bucket/folder.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the answer as one JSON object.")] = False,
) -> None:
    """Read every object of a store and hold it against its SHA-256. Exit code 4 if one is damaged.

    Example: meshtide check-store /backup/store
    """
    import asyncio
    import json
    from dataclasses import asdict

    from rich.console import Console

    from meshtide_server.store import open_store
    from meshtide_server.store.copying import Checked
    from meshtide_server.store.copying import check_store as check

    def told(checked: Checked) -> str:
        return f"{checked.objects} objects with {checked.bytes} bytes are whole, {len(checked.damaged)} are damaged"

    _check_there(store)
    with Console(stderr=True).status(f"reading {store}") as shown:
        checked = asyncio.run(check(open_store(store), lambda so_far: shown.update(told(so_far))))
    typer.echo(json.dumps(asdict(checked)) if as_json else told(checked))
    _complain(checked.damaged)


def _check_there(store: str) -> None:
    """Raise unless a store that is a folder is there: opening it would make it."""
    from meshtide_codec.errors import OptionError

    if not store.startswith("s3://") and not Path(store.removeprefix("file:")).is_dir():
        raise OptionError(f"there is no folder {store}")


def _complain(damaged: list[str]) -> None:
    from meshtide_codec.errors import StreamError

    if damaged:
        raise StreamError(f"{len(damaged)} objects are damaged; publish their meshes again: {', '.join(damaged)}")


def explanation(error: ValidationError) -> str:
    """What is wrong with the settings, in one line."""
    parts = []
    for detail in error.errors():
        name = ".".join(str(part) for part in detail["loc"])
        message = detail["msg"].removeprefix("Value error, ")
        parts.append(f"{name}: {message}" if name else message)
    return "; ".join(parts)
