"""How the command `meshtide` ends: one line on standard error and an exit code that scripts can use."""

from __future__ import annotations

import errno
import os
import sys
from contextlib import contextmanager, suppress
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
from meshtide_codec.printable import printable
from meshtide_codec.termination import terminable

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
    HUNG_UP = 129
    INTERRUPTED = 130
    TERMINATED = 143


LONGEST_EXPLANATION = 4000
"""Characters of an error that are printed: some name every file of a folder."""

_OF_SIGNALS = {
    ExitCode.HUNG_UP: "ended, because its terminal was closed (SIGHUP)",
    ExitCode.INTERRUPTED: "interrupted",
    ExitCode.TERMINATED: "ended by SIGTERM",
}
"""What is said of a command that a signal has ended."""

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
    """One line that says what `error` means."""
    if isinstance(error, OSError):
        name = "" if error.filename is None else f"{_file_name(error.filename)}: "
        hint = "; free some space and repeat the command" if error.errno == errno.ENOSPC else ""
        return printable(f"{name}{error.strerror or error}{hint}", LONGEST_EXPLANATION)
    return printable(" ".join(str(error).split()), LONGEST_EXPLANATION) or type(error).__name__


def _file_name(name: object) -> str:
    return os.fsdecode(name) if isinstance(name, bytes) else str(name)


def run(app: typer.Typer) -> NoReturn:
    """Run the command and exit; foreseen errors become one line on standard error, others keep their traceback."""
    try:
        with terminable():
            app(standalone_mode=True)
    except KeyboardInterrupt:  # before typer listens for it
        _end_by_signal(ExitCode.INTERRUPTED)
    except SystemExit as ending:
        if isinstance(ending.__context__, BrokenPipeError):  # typer and rich make it a silent exit with code 1
            _end_with(ending.__context__)
        if ending.code in _OF_SIGNALS:  # typer turns Ctrl-C into a silent exit with such a code
            _end_by_signal(ExitCode(ending.code))
        _end(ending.code)
    except Exception as error:
        if _comes_of_an_interruption(error):  # while a library was loaded, which makes another error of it
            _end_by_signal(ExitCode.INTERRUPTED)
        if not isinstance(error, (MeshtideError, OSError)):
            raise
        _end_with(error)
    _end(ExitCode.OK)


def _comes_of_an_interruption(error: BaseException | None) -> bool:
    seen: set[int] = set()  # some libraries tie such chains into circles
    while error is not None and id(error) not in seen:
        if isinstance(error, KeyboardInterrupt):
            return True
        seen.add(id(error))
        error = error.__cause__ or error.__context__
    return False


def _end_by_signal(code: ExitCode) -> NoReturn:
    _complain(f"meshtide: {_OF_SIGNALS[code]}")
    _end(code)


def _end_with(error: MeshtideError | OSError) -> NoReturn:
    """Explain an error and exit; that the reader of standard output has gone, as `head` does, is none."""
    if isinstance(error, BrokenPipeError) and error.filename is None:
        _end(ExitCode.OK)
    _complain(f"meshtide: {explanation(error)}")
    _end(exit_code(error))


def _end(code: int | str | None) -> NoReturn:
    """Exit; what is left in the buffer of standard output is written, unless nobody reads it any more."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(code)


def _complain(line: str) -> None:
    with suppress(OSError):  # the terminal may be gone
        sys.stderr.write(f"{printable(line, LONGEST_EXPLANATION)}\n")


def wide_console(*, stderr: bool = False) -> Console:
    """A console for tables: as wide as the terminal, or wide enough where there is none."""
    from rich.console import Console  # noqa: PLC0415 - heavy

    console = Console(stderr=stderr)
    return console if console.is_terminal else Console(width=140, stderr=stderr)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A progress display on standard error, shown only to a person; yields what is called with stage and fraction."""
    from rich.console import Console  # noqa: PLC0415 - heavy
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(title, total=1.0)

        def report(stage: str, fraction: float) -> None:
            bar.update(task, description=printable(f"{title}: {stage}"), completed=fraction)

        yield report
