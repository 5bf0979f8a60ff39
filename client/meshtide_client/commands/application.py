"""The application `meshtide`: assembled from what each installed package registers, so that none imports another.

Every entry point of the group ``meshtide.commands`` names a function that takes the application and adds commands.
"""

from __future__ import annotations

from importlib.metadata import entry_points, version
from typing import Annotated

import typer

_GROUP = "meshtide.commands"
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
