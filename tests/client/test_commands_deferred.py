from __future__ import annotations

from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from meshtide_client.commands.application import build
from meshtide_client.commands.deferred import deferred

READ: list[str] = []
"""What options have been made of, one entry each time."""


def noted(name: str) -> str:
    READ.append(name)
    return name


def application() -> typer.Typer:
    app = typer.Typer(no_args_is_help=True)

    @app.command()
    def swim(metres: int, *, stroke: Annotated[str, typer.Option(help=noted("stroke"))] = "crawl") -> None:
        """Swim a little.

        Example: swim 50
        """
        typer.echo(f"{metres} m, {stroke}")

    @app.command("dive-in", hidden=True)
    def dive() -> None:
        """Dive."""
        raise typer.Exit(7)

    return app


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["--help"],
        ["swim", "--help"],
        ["swim", "50"],
        ["swim", "50", "--stroke", "back"],
        ["swim"],
        ["swim", "far"],
        ["swim", "50", "--fins"],
        ["swimm"],
        ["dive-in"],
    ],
)
def test_deferred_commands_behave_as_others(arguments: list[str]) -> None:
    expected = CliRunner().invoke(application(), arguments)
    result = CliRunner().invoke(deferred(application()), arguments)
    assert (result.exit_code, result.stdout, result.stderr) == (expected.exit_code, expected.stdout, expected.stderr)


def test_options_are_read_of_a_command_that_is_called() -> None:
    app = deferred(application())
    READ.clear()
    assert "swim" in CliRunner().invoke(app, ["--help"]).stdout
    assert CliRunner().invoke(app, ["dive-in"]).exit_code == 7
    assert READ == []
    assert CliRunner().invoke(app, ["swim", "50"]).stdout == "50 m, crawl\n"
    assert READ


def test_the_application_itself_stays_as_it_is() -> None:
    app = application()
    commands = list(app.registered_commands)
    deferred(app)
    assert app.registered_commands == commands


def test_all_commands_of_meshtide_show_their_help() -> None:
    app = build()
    names = [
        command.name or (command.callback.__name__ if command.callback else "") for command in app.registered_commands
    ]
    assert len(names) > 15
    for name in names:
        result = CliRunner().invoke(deferred(app), [name.replace("_", "-"), "--help"])
        assert (result.exit_code, "Usage" in result.stdout) == (0, True)
