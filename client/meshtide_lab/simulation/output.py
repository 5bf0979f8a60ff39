"""The files of a sweep: tidy tables as CSV and Parquet, one row an observation; plots; and what is printed."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any

from meshtide_codec.extras import extra
from meshtide_codec.output_files import write_together
from meshtide_codec.printable import encodable, shown
from meshtide_lab.simulation import plots
from meshtide_lab.simulation.summary import summarize

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from rich.table import Table

    from meshtide_lab.simulation.sweep import SweepResults

PARQUET = ("pyarrow", "pyarrow.parquet")
EXTRA = "lab"


def write_results(results: SweepResults, folder: Path, *, parquet: bool = True, draw: bool = True) -> list[Path]:
    """Write all files of a sweep; the same results give the same bytes.

    Args:
        results: what was found.
        folder: where.
        parquet: whether tables are written as Parquet too.
        draw: whether plots are drawn.

    Raises:
        MissingLibraryError: a library of the extra `lab` is missing.
        OSError: a file cannot be written.
    """
    summary = summarize(results.runs)
    tables: dict[str, Sequence[Mapping[str, Any]]] = {
        "runs": results.runs,
        "levels": results.levels,
        "summary": summary,
        "failures": [{"what": name, "reason": reason} for name, reason in results.failures.items()],
    }
    files = {}
    for name, rows in tables.items():
        if rows:
            files[folder / f"{name}.csv"] = csv_bytes(rows)
            if parquet:
                files[folder / f"{name}.parquet"] = parquet_bytes(rows)
    if draw and summary:
        files[folder / "loss-distortion.png"] = plots.loss_distortion_plot(summary)
        files[folder / "rate-distortion.png"] = plots.rate_distortion_plot(results.levels)
    write_together(files.items())
    return list(files)


def csv_bytes(rows: Sequence[Mapping[str, Any]]) -> bytes:
    r"""A table with a head; what is not known is empty.

    >>> csv_bytes([{"a": 1, "b": float("nan")}])
    b'a,b\n1,\n'
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(rows[0])
    for row in rows:
        writer.writerow("" if value != value else value for value in row.values())  # noqa: PLR0124 - NaN
    return encodable(text.getvalue()).encode()


def parquet_bytes(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """The same table as a Parquet file.

    Raises:
        MissingLibraryError: pyarrow is not installed.
    """
    arrow, parquet = (extra(module, EXTRA) for module in PARQUET)
    file = io.BytesIO()
    columns = {
        name: [encodable(row[name]) if isinstance(row[name], str) else row[name] for row in rows] for name in rows[0]
    }
    parquet.write_table(arrow.table(columns), file)
    return file.getvalue()


def summary_table(summary: Sequence[Mapping[str, Any]]) -> Table:
    """The summary, to be printed: means, and half the width of their 95 % intervals."""
    from rich.table import Table  # noqa: PLC0415 - heavy
    from rich.text import Text  # noqa: PLC0415 - the same

    table = Table(title="means over seeds, and the 95 % intervals of the means")
    for column in ("mesh", "stream", "link"):
        table.add_column(column, overflow="fold")
    for column in ("runs", "Diffs lost", "rms", "Hausdorff", "normals / degrees", "l2/vertex x 1e4", "l-infinity"):
        table.add_column(column, justify="right")
    for row in summary:
        table.add_row(
            Text(shown(row["mesh"])),
            Text(row["stream"]),
            Text(row["loss"]),
            str(row["runs"]) if row["shown"] == row["runs"] else f"{row['shown']} of {row['runs']} shown",
            f"{100 * row['lost_share']:.1f} %",
            _figure(row, "rms", ".2e"),
            _figure(row, "hausdorff", ".2e"),
            _figure(row, "normal_deviation", ".2f"),
            _figure(row, "l2_per_vertex", ".3f", 1e4),
            _figure(row, "l_infinity", ".2e"),
        )
    return table


def _figure(row: Mapping[str, Any], name: str, form: str, scale: float = 1.0) -> str:
    mean, half = scale * row[name], scale * row[f"{name}_95"]
    if mean != mean:  # noqa: PLR0124 - NaN
        return "-"
    return f"{mean:{form}}" if half != half else f"{mean:{form}} ± {half:{form}}"  # noqa: PLR0124 - NaN
