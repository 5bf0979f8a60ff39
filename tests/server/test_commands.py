import re
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from meshtide_server import serving
from meshtide_server.commands import register, serve
from meshtide_server.operations import logs
from meshtide_server.settings import Settings


@pytest.fixture
def app() -> typer.Typer:
    made = typer.Typer()
    made.command()(serve)
    return made


def test_both_commands_are_registered() -> None:
    made = typer.Typer()
    register(made)
    output = plain(CliRunner().invoke(made, ["--help"], env={"COLUMNS": "200"}).output)
    assert "serve" in output
    assert "copy-store" in output


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Settings, bool, Path | None]]:
    """What would have been run."""
    made: list[tuple[Settings, bool, Path | None]] = []

    def run(settings: Settings, *, announce: bool, ready_file: Path | None) -> None:
        made.append((settings, announce, ready_file))

    monkeypatch.setattr(serving, "run", run)
    monkeypatch.setattr(logs, "set_up_log", lambda _level, _form: None)
    return made


def plain(output: str) -> str:
    """Without the frame and the line breaks that typer draws."""
    return " ".join(re.sub(r"[│╭╮╰╯─]|\x1b\[[0-9;]*m", " ", output).split())


def test_arguments_become_settings(
    app: typer.Typer, runs: list[tuple[Settings, bool, Path | None]], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MESHTIDE_PORT", "1234")
    monkeypatch.setenv("MESHTIDE_HOST", "::1")
    monkeypatch.setenv("MESHTIDE_EFFORT", "default")
    arguments = [str(folder), "--port", "0", "--cache", "c", "--bits", "10", "--log-level", "debug", "--announce"]
    arguments += ["--effort", "high"]
    result = CliRunner().invoke(app, [*arguments, "--allow-origin", "https://a.example", "--allow-origin", "*"])
    assert result.exit_code == 0, result.output
    ((settings, announce, ready_file),) = runs
    assert settings.directory == folder
    assert (settings.port, settings.host, settings.bits, settings.log_level) == (0, "::1", 10, "debug")
    assert settings.effort == "high"
    assert settings.allowed_origins == ("https://a.example", "*")
    assert not settings.samples
    assert (announce, ready_file) == (True, None)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "nothing to host: give a DIRECTORY of meshes, --samples"),
        (["/nowhere/at/all"], "directory: there is no folder /nowhere/at/all"),
        (["--samples", "--log-level", "loud"], "log_level: Input should be 'debug', 'info'"),
        (["--samples", "--bits", "99"], "bits: Input should be less than or equal to 20"),
        (["--samples", "--effort", "most"], "effort: Input should be 'default' or 'high'"),
        (["--samples", "--profile", "classic", "--effort", "high"], "effort high is of profile compact"),
        (["--samples", "--port", "70000"], "'--port': Input should be less than or equal to 65535"),
    ],
)
def test_mistakes_are_usage_errors(
    app: typer.Typer, runs: list[tuple[Settings, bool, Path | None]], arguments: list[str], words: str
) -> None:
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert words in plain(result.output)
    assert runs == []


def test_help_names_every_option(app: typer.Typer) -> None:
    output = plain(CliRunner().invoke(app, ["--help"], env={"COLUMNS": "200"}).output)
    for option in ("--samples", "--host", "--port", "--cache", "--log-level", "--announce", "--ready-file"):
        assert option in output


def test_help_names_every_setting(app: typer.Typer) -> None:
    output = plain(CliRunner().invoke(app, ["--help"], env={"COLUMNS": "200"}).output)
    options = {"allowed_origins": "--allow-origin", "allowed_methods": "--allow-method"}
    options |= {"allowed_headers": "--allow-header", "directory": "[directory]"}
    options |= {"unlimited_clients": "--unlimited-client", "trusted_proxies": "--trusted-proxy"}
    for name in Settings.model_fields:
        option = options.get(name, f"--{name.replace('_', '-')}")
        assert (option in output) != bool(re.search(rf"\b{name}[,.]", output)), name
    assert "Example: meshtide serve meshes/" in output


def test_all_sources_together(
    app: typer.Typer,
    runs: list[tuple[Settings, bool, Path | None]],
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "settings.toml").write_text('port = 1\nhost = "::1"\nmax_upload = 5\nallowed_origins = ["https://a"]\n')
    monkeypatch.setenv("MESHTIDE_SETTINGS_FILE", str(tmp_path / "settings.toml"))
    monkeypatch.setenv("MESHTIDE_HOST", "127.0.0.2")
    result = CliRunner().invoke(app, [str(folder), "--port", "3", "--set", "max-vertices = 7"])
    assert result.exit_code == 0, result.output
    ((settings, _, _),) = runs
    assert (settings.port, settings.host, settings.max_upload, settings.max_vertices) == (3, "127.0.0.2", 5, 7)
    assert settings.allowed_origins == ("https://a",)


def test_registering_is_cheap() -> None:
    program = (
        "import sys, meshtide_server.commands; "
        "print([name for name in ('numpy', 'fastapi', 'uvicorn', 'pydantic') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
