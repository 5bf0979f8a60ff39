"""The command `meshtide`: assembled from what each installed package registers, so that none imports another.

Every entry point of the group ``meshtide.commands`` names a function that takes the application and adds commands.
"""

from __future__ import annotations

import os
import sys
from importlib.metadata import entry_points, version
from typing import Annotated, NoReturn

import typer

from meshtide_client.commands.deferred import deferred
from meshtide_codec.command_line import ExitCode, run

_GROUP = "meshtide.commands"
_S3_LIBRARY = "obstore"
_ORDER = ("codec", "comparison", "server", "client", "paper", "simulation")


def build() -> typer.Typer:
    """The application with all its commands."""
    app = typer.Typer(
        name="meshtide",
        help="Progressive transmission of 3D meshes: encode them, serve them, and fetch them level by level.",
        epilog="Start with: meshtide demo",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
    )
    app.callback()(_options)
    found = sorted(entry_points(group=_GROUP), key=lambda point: (point.name not in _ORDER, _place(point.name)))
    for point in found:
        point.load()(app)
    return app


def main() -> None:
    """Run the command; exits with one of `meshtide_codec.command_line.ExitCode`."""
    try:
        app = build()
    except KeyboardInterrupt:
        sys.exit(ExitCode.INTERRUPTED)
    try:
        run(deferred(app))
    except SystemExit as ending:
        if _S3_LIBRARY in sys.modules:
            _leave_at_once(ending.code)
        raise


def _leave_at_once(code: str | int | None) -> NoReturn:
    """End the process without taking the interpreter apart.

    The threads of the library for S3 may ask for the interpreter while it ends, which aborts the process now and then.
    Files are closed by then, and standard output is written (`command_line.run`).
    """
    sys.stderr.flush()
    os._exit(code if isinstance(code, int) else ExitCode.OK if code is None else ExitCode.FAILURE)


def _place(name: str) -> tuple[int, str]:
    return (_ORDER.index(name), name) if name in _ORDER else (len(_ORDER), name)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"meshtide {version('meshtide')}")
        raise typer.Exit


def _options(
    show_version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Progressive transmission of 3D meshes: encode them, serve them, and fetch them level by level."""


if __name__ == "__main__":
    main()
