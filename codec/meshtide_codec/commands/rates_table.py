"""Bytes by level and kind, and bits per vertex, as a table for people."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping


def print_rates(report: Mapping[str, Any], *, err: bool = False) -> None:
    """Print bytes and rates of a stream, level by level.

    Args:
        report: of `meshtide_codec.rates.stream_report`.
        err: whether standard output is taken by something else.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from meshtide_codec.command_line import wide_console
    from meshtide_codec.printable import printable

    kinds = list(report["bytes_by_kind"])
    effort = f", effort {report['effort']}" if report["effort"] else ""
    title = f"profile {report['profile']}{effort}, B = {report['bits']}{_predictor(report)}"
    table = Table(title=Text(printable(title)), title_style="italic", box=box.SIMPLE)
    for column in ("level", "vertices", "faces", *kinds, "bytes so far", "rms", "maximum"):
        table.add_column(column, justify="right")
    for row in report["levels"]:
        table.add_row(
            str(row["level"]),
            str(row["vertices"]),
            str(row["faces"]),
            *(str(row["bytes_by_kind"].get(kind, "")) for kind in kinds),
            str(row["cumulative_bytes"]),
            f"{row['rms']:.2e}",
            f"{row['maximum']:.2e}",
        )
    table.add_section()
    rates = (f"{report['bits_per_vertex_by_kind'][kind]:.2f}" for kind in kinds)
    table.add_row("bits/vertex", "", "", *rates, f"{report['bits_per_vertex']:.2f}", "", "")
    wide_console(stderr=err).print(table)


def _predictor(report: Mapping[str, Any]) -> str:
    """The filter of a classic stream."""
    if "filter" not in report["options"]:
        return ""
    spec = dict(report["options"]["filter"])
    kind = spec.pop("kind")
    fields = ", ".join(f"{name} {value}" for name, value in spec.items())
    return f", predictor {kind} ({fields})" if fields else f", predictor {kind}"
