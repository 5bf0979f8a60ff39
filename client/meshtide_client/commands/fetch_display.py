"""What a person sees of a download: a progress bar while it runs, sentences about trouble, one line at the end.

Everything but the end goes to standard error, and the bar only to a terminal, so that output can be piped.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeElapsedColumn, TransferSpeedColumn

from meshtide_codec.command_line import LONGEST_EXPLANATION
from meshtide_codec.printable import printable, shown

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from meshtide_client.download.fetch import FetchResult
    from meshtide_client.download.levels import LevelFigures, ReceivedLevel


class Display:
    """A download on the screen; its three methods are what `fetch` calls.

    Args:
        title: what is downloaded.
        console: where to draw; standard error when left out.
    """

    def __init__(self, title: str, console: Console | None = None) -> None:
        self.console = console or Console(stderr=True)
        self._title = title = shown(title)
        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            DownloadColumn(),
            TransferSpeedColumn(),
            TimeElapsedColumn(),
            console=self.console,
            transient=True,
            disable=not self.console.is_terminal,
        )
        self._task = self._bar.add_task(title, total=None)

    @contextmanager
    def shown(self) -> Iterator[Display]:
        """Show the bar inside the block."""
        with self._bar:
            yield self

    def notify(self, sentence: str) -> None:
        """Show a person something."""
        self.console.print(printable(sentence, LONGEST_EXPLANATION), markup=False, highlight=False, soft_wrap=True)

    def progress(self, size: int, total: int) -> None:
        """Show how many bytes are there."""
        self._bar.update(self._task, completed=size, total=total)

    def on_level(self, level: ReceivedLevel) -> None:
        """Show the level that is there."""
        self._bar.update(self._task, description=f"{self._title}: level {level.level}, {level.vertices} vertices")


def result_line(result: FetchResult, output: Path) -> str:
    """What was fetched, in one line."""
    figures = result.figures
    exact = "" if figures.exact else ", predicted only" if result.link_report is None else ", not exact"
    coarse = f", rms error {figures.rms:.2e}" if figures.rms > 0 or (figures.level and figures.rms == 0) else ""
    resumed = "" if result.received_bytes >= _payload(result) else f" ({result.received_bytes} of them fetched now)"
    line = (
        f"{shown(output)}: level {figures.level}{exact}{coarse}, {figures.vertices} vertices, {figures.faces} faces; "
        f"{figures.size} bytes{resumed} in {result.seconds:.2f} s"
    )
    return line if result.link_report is None else f"{line}\nlink: {result.link_report.summary()}"


def result_json(result: FetchResult, *, output: Path, stream_file: Path | None) -> dict[str, Any]:
    """What was fetched, for programs."""
    figures = _plain(result.figures) | {"seconds": result.seconds}
    answer = {
        "mesh": result.address.mesh,
        "url": str(result.address),
        "output": str(output),
        "stream_file": None if stream_file is None else str(stream_file),
        **figures,
        "transport": result.transport,
        "received_bytes": result.received_bytes,
        "complete": not result.more,
        "levels": [_plain(level) for level in result.levels],
    }
    return answer if result.link_report is None else answer | {"link": result.link_report.plain()}


def _plain(figures: LevelFigures) -> dict[str, Any]:
    """Figures for programs: what is not known, behind a lossy link, is None."""
    return {name: None if value != value else value for name, value in asdict(figures).items()}  # noqa: PLR0124 - NaN


def _payload(result: FetchResult) -> int:
    """Bytes of packets of the level that was fetched: less than what comes over the network from the beginning on."""
    return result.header.level_bytes(result.header.entry(result.figures.level))
