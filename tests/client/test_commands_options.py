from __future__ import annotations

from pathlib import Path

import pytest
import typer
from typer.main import get_command
from typer.testing import CliRunner

from meshtide_client import commands
from meshtide_codec.errors import OptionError


def test_every_command_that_may_talk_to_a_server_takes_a_file_of_authorities() -> None:
    app = typer.Typer()
    commands.register(app)
    found = get_command(app).commands  # type: ignore[attr-defined]
    for name, command in found.items():
        options = {option for parameter in command.params for option in parameter.opts}
        assert ("--ca-file" in options) == ("--token-file" in options), name
    assert {"fetch", "meshes", "ingest", "export", "edit", "delete", "tags"} <= {
        name for name, command in found.items() if any("--ca-file" in parameter.opts for parameter in command.params)
    }


@pytest.mark.parametrize("name", ["fetch", "meshes", "tags", "delete"])
def test_a_file_that_is_not_there_ends_the_command_as_a_wrong_option(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    app = typer.Typer()
    commands.register(app)
    url = "http://127.0.0.1:9" if name in {"meshes", "tags"} else "https://127.0.0.1:9/meshes/vase"
    more = ["--yes"] if name == "delete" else []
    result = CliRunner().invoke(app, [name, url, "--ca-file", "missing.pem", *more])
    assert isinstance(result.exception, OptionError), result.exception
    assert "missing.pem, named by --ca-file, cannot be read" in str(result.exception)
