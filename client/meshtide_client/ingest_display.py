"""What `meshtide ingest` shows: a bar and the failures while it runs, a line or a JSON object at its end."""

from __future__ import annotations

import json
from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from meshtide_client.ingest_plan import Ingested

STATES = ("done", "kept", "failed")


@contextmanager
def ingest_display(total: int, *, quiet: bool) -> Iterator[Callable[[Ingested], None]]:
    """A bar on standard error; yields what is to be told of each file that is through.

    Args:
        total: how many files there are.
        quiet: whether failures are left for the JSON object.
    """
    columns = (TextColumn("ingest"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("files", total=total)

        def tell(result: Ingested) -> None:
            bar.advance(task)
            if result.state == "failed" and not quiet:
                console.print(f"{result.file}: {result.error}", style="red", markup=False, soft_wrap=True)

        yield tell


def print_ingested(results: Sequence[Ingested], place: dict[str, str], *, as_json: bool) -> int:
    """Print what became of all files; returns how many failed.

    Args:
        results: of all files.
        place: where they went, as the JSON object tells it.
        as_json: whether one is printed.
    """
    counts = {state: sum(result.state == state for result in results) for state in STATES}
    if as_json:
        rows = [{"file": str(row.file), "mesh": row.mesh, "state": row.state, "error": row.error} for row in results]
        typer.echo(json.dumps({**place, **counts, "files": rows}))
    else:
        typer.echo(f"{counts['done']} ingested, {counts['kept']} there before, {counts['failed']} failed")
    return counts["failed"]
