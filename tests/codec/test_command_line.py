from __future__ import annotations

import errno

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


def test_progress_is_silent_where_nobody_watches(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("encode") as report:
        report("levels", 0.5)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "levels" not in captured.err
