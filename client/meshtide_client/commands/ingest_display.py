"""What `meshtide ingest` shows: a bar, failures and notes while it runs, a line or a JSON object at its end."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Self

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from meshtide_codec.json_text import json_text
from meshtide_codec.printable import printable

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType

    from meshtide_client.remote.ingest_plan import Ingested

STATES = ("done", "kept", "failed", "left", "skipped")


class IngestDisplay:
    """A bar on standard error, failures and notes above it; a context manager. Any thread may call its methods.

    Args:
        total: how many files there are.
        quiet: whether failures, notes, and what is skipped, are left for the JSON object.
    """

    def __init__(self, total: int, *, quiet: bool) -> None:
        self._quiet = quiet
        self._console = Console(stderr=True)
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
        )
        self._bar = Progress(*columns, console=self._console, transient=True, disable=not self._console.is_terminal)
        self._task = self._bar.add_task("ingest", total=total)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def report(self, result: Ingested) -> None:
        """A file is through."""
        self._bar.advance(self._task)
        if result.state == "failed":
            self._print(result, result.error, "red")
        for note in result.notes:
            self._print(result, note, "yellow")

    def skip(self, result: Ingested) -> None:
        """Something in a folder is not a file, and not counted among them."""
        self._print(result, result.error, "yellow")

    def _print(self, result: Ingested, words: str | None, style: str) -> None:
        if not self._quiet:
            self._console.print(printable(f"{result.file}: {words}"), style=style, markup=False, soft_wrap=True)

    def stage(self, what: str) -> None:
        """Show what is being done."""
        self._bar.update(self._task, description=f"ingest: {what}")


def print_ingested(results: Sequence[Ingested], place: dict[str, str], *, as_json: bool) -> int:
    """Print what became of all files; returns how many were not ingested.

    Args:
        results: of all files.
        place: where they went, as the JSON object has it.
        as_json: whether one is printed.
    """
    counts = {state: sum(result.state == state for result in results) for state in STATES}
    if as_json:
        rows = [{**asdict(row), "file": str(row.file)} for row in results]
        typer.echo(json_text({**place, **counts, "files": rows}))
    else:
        left = f", {counts['left']} not begun" if counts["left"] else ""
        left += f", {counts['skipped']} skipped" if counts["skipped"] else ""
        typer.echo(f"{counts['done']} ingested, {counts['kept']} there before, {counts['failed']} failed{left}")
    return counts["failed"] + counts["left"]
