"""The commands `serve`, `copy-store` and `check-store`."""

from __future__ import annotations

from inspect import Signature
from pathlib import Path
from typing import Annotated, Any

import typer

from meshtide_codec.shared_options import JsonOption


def register(app: typer.Typer) -> None:
    """Add this package's commands to `app`."""
    app.command()(serve)
    app.command()(copy_store)
    app.command()(check_store)


class _Serve:
    """Host meshes: each one is encoded once, then served as a file and as a stream.

    Example: meshtide serve meshes/

    Example: MESHTIDE_WRITE_TOKENS_FILE=tokens meshtide serve --data kept/ --host 0.0.0.0 --set max_upload=100000000

    Each setting can be given as an argument, by an environment variable, such as MESHTIDE_PORT, or in a TOML file, such
    as port = 8000; the first of these wins. Settings without an option of their own, for --set, environment and file:
    database_file, catalogue_seconds, store_cache_mib, write_tokens_file, read_tokens_file, max_upload,
    upload_stall_timeout, max_vertices, max_faces, max_decode_memory, job_processes, job_seconds, job_processor_seconds,
    job_lost_seconds, job_memory, shutdown_timeout, max_message, max_request_line, max_head, max_headers,
    frames_per_second, control_frames_per_second. For environment and file only, as secrets: database, write_tokens,
    read_tokens. docs/operate.md explains each of them.

    SIGTERM and Ctrl-C shut it down gracefully, with exit code 0: it accepts no new streams and lets running ones
    finish; a second signal ends it at once.
    """

    # What follows is for typer, which asks for it when the command is called: to load the settings takes a while.

    __name__ = "serve"

    @property
    def __signature__(self) -> Signature:
        from meshtide_server.serve_options import serve_parameters

        own = Signature.from_callable(self._others, eval_str=True).parameters.values()
        return Signature([*serve_parameters(), *own])

    @property
    def __annotations__(self) -> dict[str, Any]:  # type: ignore[override] # of functions it can be written to
        return {name: parameter.annotation for name, parameter in self.__signature__.parameters.items()}

    @staticmethod
    def _others(
        *,
        assigned: Annotated[
            list[str] | None,
            typer.Option(
                "--set", metavar="NAME=VALUE", help="Any other setting, such as max_upload=1000000. May be repeated."
            ),
        ] = None,
        settings_file: Annotated[
            Path | None,
            typer.Option("--settings", envvar="MESHTIDE_SETTINGS_FILE", help="TOML file of settings; see above."),
        ] = None,
        announce: Annotated[
            bool, typer.Option("--announce", help='Print {"url": ...} on standard output once the server listens.')
        ] = False,
        ready_file: Annotated[
            Path | None, typer.Option(help="Write the same to this file; it is removed when the server stops.")
        ] = None,
    ) -> None:
        """The options that are no settings."""

    def __call__(
        self,
        *,
        assigned: list[str] | None,
        settings_file: Path | None,
        announce: bool,
        ready_file: Path | None,
        **given: Any,  # noqa: ANN401 - the settings, whatever they are
    ) -> None:
        from pydantic import ValidationError

        from meshtide_server.operations.logs import set_up_log
        from meshtide_server.serving import run
        from meshtide_server.settings_sources import explanation, load_settings

        values = {name: value for name, value in given.items() if value not in (None, [])}
        told = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
        try:
            settings = load_settings(told, assigned=assigned or (), file=settings_file)
        except ValidationError as error:
            raise typer.BadParameter(explanation(error)) from None
        set_up_log(settings.log_level, settings.log_format)
        run(settings, announce=announce, ready_file=ready_file)


serve = _Serve()


def copy_store(
    source: Annotated[str, typer.Argument(help="Store to read: a folder, or s3://bucket/folder.")],
    target: Annotated[str, typer.Argument(help="Store to fill; what it holds already is left alone.")],
    as_json: JsonOption = False,
) -> None:
    """Copy the streams of a store into another one: to make a backup, to restore one, or to move.

    Copy the catalogue first (pg_dump, or sqlite3's .backup), so that the store has every stream it names. If it is
    interrupted, run the same command again to continue. Damaged streams are reported and not copied: exit code 4.
    Nothing is deleted.

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
    as_json: JsonOption = False,
) -> None:
    """Check every object of a store against its SHA-256. Exit code 4 if one is damaged.

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
