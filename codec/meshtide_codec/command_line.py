"""How the command `meshtide` ends: one line on standard error and an exit code that scripts can use."""

from __future__ import annotations

import errno
import os
import sys
from contextlib import contextmanager
from enum import IntEnum
from typing import TYPE_CHECKING, NoReturn

from meshtide_codec.errors import (
    MeshError,
    MeshtideError,
    OptionError,
    PeerError,
    ProtocolError,
    StreamError,
    TransferError,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import typer
    from rich.console import Console


class ExitCode(IntEnum):
    """Exit codes of every `meshtide` command."""

    OK = 0
    FAILURE = 1
    USAGE = 2
    BAD_MESH = 3
    BAD_STREAM = 4
    NETWORK = 5
    DISK = 6
    INTERRUPTED = 130


_CODES: tuple[tuple[type[BaseException], ExitCode], ...] = (
    (OptionError, ExitCode.USAGE),
    (MeshError, ExitCode.BAD_MESH),
    (StreamError, ExitCode.BAD_STREAM),
    (PeerError, ExitCode.NETWORK),
    (ProtocolError, ExitCode.NETWORK),
    (TransferError, ExitCode.NETWORK),
    (OSError, ExitCode.DISK),
)


def exit_code(error: BaseException) -> ExitCode:
    """The exit code that stands for `error`.

    >>> exit_code(MeshError("no vertices")), exit_code(RuntimeError())
    (<ExitCode.BAD_MESH: 3>, <ExitCode.FAILURE: 1>)
    """
    for kind, code in _CODES:
        if isinstance(error, kind):
            return code
    return ExitCode.FAILURE


def explanation(error: BaseException) -> str:
    """One line that tells a person what `error` means."""
    if isinstance(error, OSError):
        name = f"{error.filename}: " if error.filename else ""
        hint = "; free some space and repeat the command" if error.errno == errno.ENOSPC else ""
        return f"{name}{error.strerror or error}{hint}"
    return " ".join(str(error).split()) or type(error).__name__


def run(app: typer.Typer) -> NoReturn:
    """Run the command and exit; foreseen errors become one line on standard error, others keep their traceback."""
    try:
        app(standalone_mode=True)
    except (MeshtideError, OSError) as error:
        if isinstance(error, BrokenPipeError):  # the reader of a pipe has gone, as `head` does
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            sys.exit(ExitCode.OK)
        _complain(f"meshtide: {explanation(error)}")
        sys.exit(exit_code(error))
    except SystemExit as ending:  # typer turns Ctrl-C into a silent exit with this code
        if ending.code == ExitCode.INTERRUPTED:
            _complain("meshtide: interrupted")
        raise
    sys.exit(ExitCode.OK)


def _complain(line: str) -> None:
    sys.stderr.write(line + "\n")


def wide_console() -> Console:
    """A console for tables: as wide as the terminal, or wide enough where there is none."""
    from rich.console import Console  # noqa: PLC0415 - heavy

    console = Console()
    return console if console.is_terminal else Console(width=140)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A progress display on standard error, shown only to a person; yields what is called with stage and fraction.

    Compilation of kernels, which happens in the first run only, is announced on it.
    """
    from rich.console import Console  # noqa: PLC0415 - heavy
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    from meshtide_codec.compilation import announced_compilation  # noqa: PLC0415 - heavy

    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(title, total=1.0)

        def report(stage: str, fraction: float) -> None:
            bar.update(task, description=f"{title}: {stage}", completed=fraction)

        def announce() -> None:
            console.print("compiling kernels: this happens in the first run only, and takes a minute or two")

        with announced_compilation(announce):
            yield report
