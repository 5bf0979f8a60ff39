from __future__ import annotations

import errno
import os
import signal
import time

import pytest
import typer

from meshtide_codec.command_line import ExitCode, exit_code, explanation, progress_bar, run
from meshtide_codec.errors import (
    ContainerError,
    LimitError,
    MeshFileError,
    MeshtideError,
    OptionError,
    PeerError,
    ProtocolError,
    TransferError,
)

CASES = [
    (OptionError("bad option"), ExitCode.USAGE),
    (MeshFileError("bad mesh"), ExitCode.BAD_MESH),
    (ContainerError("bad stream"), ExitCode.BAD_STREAM),
    (LimitError("too much"), ExitCode.BAD_STREAM),
    (PeerError("code", "refused"), ExitCode.NETWORK),
    (ProtocolError("foreign"), ExitCode.NETWORK),
    (TransferError("gone"), ExitCode.NETWORK),
    (OSError(errno.ENOSPC, "No space left on device"), ExitCode.DISK),
    (MeshtideError("other"), ExitCode.FAILURE),
]


def application(error: BaseException | None) -> typer.Typer:
    app = typer.Typer()

    @app.command()
    def command() -> None:
        if error is not None:
            raise error

    return app


def run_as(error: BaseException) -> None:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("sys.argv", ["meshtide"])
        run(application(error))


@pytest.mark.parametrize(("error", "code"), CASES, ids=lambda value: type(value).__name__)
def test_each_error_ends_in_one_line_and_its_code(
    error: Exception, code: ExitCode, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["meshtide"])
    assert exit_code(error) == code
    with pytest.raises(SystemExit) as ending:
        run(application(error))
    assert ending.value.code == code
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("meshtide: ")
    assert captured.out == ""


def test_success_and_interruption(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["meshtide"])
    with pytest.raises(SystemExit) as ending:
        run(application(None))
    assert ending.value.code in (0, None)
    with pytest.raises(SystemExit) as ending:
        run(application(KeyboardInterrupt()))
    assert ending.value.code == ExitCode.INTERRUPTED
    assert "interrupted" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("number", "told"),
    [(signal.SIGTERM, "ended by SIGTERM"), (signal.SIGHUP, "ended, because its terminal was closed (SIGHUP)")],
)
def test_a_signal_that_ends_a_command_is_told(
    number: signal.Signals, told: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    app = typer.Typer()

    @app.command()
    def command() -> None:
        os.kill(os.getpid(), number)
        time.sleep(5)

    monkeypatch.setattr("sys.argv", ["meshtide"])
    with pytest.raises(SystemExit) as ending:
        run(app)
    assert ending.value.code == 128 + number
    assert capsys.readouterr().err == f"meshtide: {told}\n"


def test_an_interruption_that_a_library_makes_another_error_of_is_one(capsys: pytest.CaptureFixture[str]) -> None:
    error = ImportError("numpy cannot be imported")
    error.__cause__ = RuntimeError()
    error.__cause__.__context__ = KeyboardInterrupt()
    with pytest.raises(SystemExit) as ending:
        run_as(error)
    assert ending.value.code == ExitCode.INTERRUPTED
    assert capsys.readouterr().err == "meshtide: interrupted\n"


def test_errors_that_are_each_others_context_end_too() -> None:
    first, second = TransferError("first"), TransferError("second")
    first.__cause__, second.__cause__ = second, first
    with pytest.raises(SystemExit) as ending:
        run_as(first)
    assert ending.value.code == ExitCode.NETWORK


def test_unforeseen_errors_keep_their_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["meshtide"])
    with pytest.raises(ZeroDivisionError):
        run(application(ZeroDivisionError()))


def test_explanations() -> None:
    assert explanation(OSError(errno.ENOSPC, "No space left on device", "a.ply")) == (
        "a.ply: No space left on device; free some space and repeat the command"
    )
    assert explanation(MeshtideError("two\n  lines")) == "two lines"
    assert explanation(MeshtideError()) == "MeshtideError"


@pytest.mark.parametrize(
    "error",
    [
        MeshtideError("of a \x1b]0;peer\x07 \u202e\udcff"),
        OSError(errno.EACCES, "Permission denied", "\x1b]0;peer\x07 \u202e\udcff"),
        OSError(errno.EACCES, "Permission denied", b"\x1b]0;peer\x07 \xe2\x80\xae\xff"),
    ],
)
def test_no_error_steers_the_terminal(error: Exception, capsys: pytest.CaptureFixture[str]) -> None:
    assert r"\x1b]0;peer\x07 \u202e\udcff" in explanation(error)
    with pytest.raises(SystemExit):
        run_as(error)
    assert r"\x1b]0;peer\x07 \u202e\udcff" in capsys.readouterr().err


def test_the_name_of_a_descriptor_is_its_number() -> None:
    assert explanation(OSError(errno.EBADF, "Bad file descriptor", 7)) == "7: Bad file descriptor"


def test_a_pipe_that_the_user_named_is_told_when_its_reader_goes(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ending:
        run_as(BrokenPipeError(errno.EPIPE, "Broken pipe", "pipe.tide"))
    assert ending.value.code == ExitCode.DISK
    assert "pipe.tide: Broken pipe" in capsys.readouterr().err


def test_titles_of_bars_are_no_markup(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "200")
    with progress_bar("read [/bold] [red]") as report:
        report("a\x1b]0;b[/]", 0.5)
    assert r"read [/bold] [red]: a\x1b]0;b[/]" in capsys.readouterr().err


def test_progress_is_silent_where_nobody_watches(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("encode") as report:
        report("levels", 0.5)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "levels" not in captured.err
