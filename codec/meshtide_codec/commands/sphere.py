"""The command `sphere`."""

from __future__ import annotations

import typer

from meshtide_codec.shared_options import JsonOption


def sphere(as_json: JsonOption = False) -> None:
    """Print the rates of the paper's sphere, filter by filter, next to the published ones.

    Example: meshtide sphere
    """
    from dataclasses import asdict

    from rich.table import Table

    from meshtide_codec.command_line import progress_bar, wide_console
    from meshtide_codec.json_text import json_text
    from meshtide_codec.sphere import sphere_table

    with progress_bar("sphere") as progress:
        rows = list(sphere_table(progress))
    if as_json:
        typer.echo(json_text({"rows": [asdict(row) for row in rows]}))
        return
    table = Table(title="sphere, B = 10, K = 1, four levels: geometry, bits per vertex")
    for column in ("filter", "multi", "paper", "single", "paper", "l2 error/vertex x 1e4"):
        table.add_column(column, justify="left" if column == "filter" else "right")
    for row in rows:
        table.add_row(
            row.name,
            f"{row.multi:.2f}",
            _figure(row.published_multi),
            f"{row.single:.2f}",
            _figure(row.published_single),
            f"{1e4 * row.l2_error:.3f}",
        )
    wide_console().print(table)


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
