"""The command `info`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from meshtide_codec.commands.stream_input import StreamArgument
from meshtide_codec.shared_options import JsonOption, MaxFacesOption, MaxVerticesOption

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import StreamHeader


def info(
    stream: StreamArgument,
    statistics: Annotated[
        bool, typer.Option(help="Also decode the Diffs: Shannon's bound, power law, l2 error.")
    ] = False,
    max_vertices: MaxVerticesOption = None,
    max_faces: MaxFacesOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what a .tide stream contains: bytes by level and kind, bits per vertex, predictor.

    Example: meshtide info bunny.tide --json
    """
    from meshtide_codec.commands.rates_table import print_rates
    from meshtide_codec.commands.stream_input import read_stream
    from meshtide_codec.json_text import json_text
    from meshtide_codec.limits import wanted_limits
    from meshtide_codec.rates import stream_report

    header, packets, problem = read_stream(stream, wanted_limits(max_vertices, max_faces))
    report = stream_report(header, len(header.to_bytes())) | {
        "packets_present": len(packets),
        "problem": None if problem is None else str(problem),
    }
    if statistics:
        report["differences"] = _difference_statistics(header, packets)
    if as_json:
        typer.echo(json_text(report))
    else:
        print_rates(report)
        if statistics:
            _print_difference_statistics(report["differences"])
    if problem is not None:
        raise problem


def _difference_statistics(header: StreamHeader, packets: Sequence[Packet]) -> list[dict[str, Any]]:
    from dataclasses import asdict

    from meshtide_codec.command_line import progress_bar
    from meshtide_codec.report.difference_statistics import difference_statistics

    with progress_bar("statistics"):
        return [asdict(row) for row in difference_statistics(header, packets)]


def _print_difference_statistics(rows: Sequence[Mapping[str, Any]]) -> None:
    from rich import box
    from rich.table import Table

    from meshtide_codec.command_line import wide_console

    table = Table(title="Diffs, bits per vertex of their level", box=box.SIMPLE)
    for column in ("level", "bits", "Shannon's bound", "alpha", "a", "l2 error/vertex x 1e4"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(
            str(row["level"]),
            f"{row['bits'] / row['vertices']:.2f}",
            f"{row['shannon_bits'] / row['vertices']:.2f}",
            f"{row['alpha']:.2f}",
            f"{row['a']:.3g}",
            f"{1e4 * row['l2_error_per_vertex']:.3f}",
        )
    wide_console().print(table)
