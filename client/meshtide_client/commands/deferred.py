"""Commands whose options are read when one of them is called.

typer works through the annotations of every option of every command before it looks at the command line, which took
half the time of `meshtide --help`. A list of commands needs their names and docstrings only.
"""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperCommand

if TYPE_CHECKING:
    from typer.models import CommandInfo


def deferred(app: typer.Typer) -> typer.Typer:
    """An application with the same commands, each of which is made whole when it is called or asked for its help.

    >>> app = typer.Typer()
    >>> @app.command()
    ... def swim(metres: int) -> None:
    ...     "Swim."
    >>> [(info.callback.__name__, info.callback.__doc__) for info in deferred(app).registered_commands]
    [('swim', 'Swim.')]
    """
    light = copy.copy(app)
    light.registered_commands = [_deferred(command) for command in app.registered_commands]
    return light


def _deferred(command: CommandInfo) -> CommandInfo:
    class Deferred(TyperCommand):
        """Stands for a command until there are arguments for it."""

        def make_context(self, *args: Any, **extra: Any) -> Any:  # noqa: ANN401 - as typer's own
            alone = typer.Typer(add_completion=False)
            alone.registered_commands.append(command)
            return typer.main.get_command(alone).make_context(*args, **extra)

    def name_and_help() -> None:
        """Stand for the function of the command."""

    assert command.callback is not None  # noqa: S101 - typer's decorator sets it
    name_and_help.__name__ = command.callback.__name__
    name_and_help.__doc__ = command.callback.__doc__
    light = copy.copy(command)
    light.callback, light.cls = name_and_help, Deferred
    return light
