"""The command `paper`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from meshtide_codec.printable import printable, shown
from meshtide_codec.shared_options import (
    JsonOption,
    OverwriteOption,
    ProcessesOption,
    bits_option,
    coarsest_vertices_option,
    drop_bits_option,
    minimum_ratio_option,
)

if TYPE_CHECKING:
    from meshtide_lab.paper.run import PaperResults


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(paper)


def paper(
    meshes: Annotated[
        list[str] | None,
        typer.Argument(
            help="Mesh files, or the names sphere, round-table, piping, spot, stanford-bunny.",
            show_default="all five names",
        ),
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the report.")] = Path("paper-report"),
    bits: Annotated[int, bits_option()] = 10,
    drop_bits: Annotated[int, drop_bits_option()] = 1,
    minimum_ratio: Annotated[float, minimum_ratio_option()] = 1.5,
    coarsest_vertices: Annotated[int, coarsest_vertices_option()] = 300,
    processes: ProcessesOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Reproduce section 5 of the paper: rates by filter and degree, errors, norms, pictures, and a report.

    The paper's sphere is built in; its published figures appear next to those measured. The paper's other meshes are
    not public, so two similar ones are generated instead; you can add any mesh file.

    Example: meshtide paper sphere fandisk.obj -o report
    """
    import os

    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.command_line import progress_bar
    from meshtide_codec.errors import MeshError
    from meshtide_codec.extras import check_extras
    from meshtide_codec.json_text import json_text
    from meshtide_codec.output_policy import check_different
    from meshtide_lab.paper import plots
    from meshtide_lab.paper.output import check_folder, plain_results, write_report
    from meshtide_lab.paper.run import DEFAULT_MESHES, mesh_name, run_paper

    options = ClassicOptions(
        bits=bits, drop_bits=drop_bits, minimum_ratio=minimum_ratio, coarsest_vertices=coarsest_vertices
    )
    check_extras(*plots.LIBRARIES, group=plots.EXTRA)
    check_different((mesh_name(text), text) for text in dict.fromkeys(meshes or DEFAULT_MESHES))
    check_folder(output, overwrite=overwrite)
    with progress_bar("paper") as progress:
        results = run_paper(
            meshes or DEFAULT_MESHES, options, processes=processes or os.cpu_count() or 1, progress=progress
        )
        if not results.meshes:
            reasons = "; ".join(f"{name}: {reason}" for name, reason in results.failures.items())
            raise MeshError(f"none of the meshes could be analysed: {reasons}")
        files = write_report(results, output, progress)
    if as_json:
        typer.echo(json_text(plain_results(results) | {"files": [str(path) for path in files]}))
        return
    _show(results)
    typer.echo(f"report: {shown(files[0])}")


def _show(results: PaperResults) -> None:
    from rich.table import Table
    from rich.text import Text

    from meshtide_codec.command_line import wide_console
    from meshtide_codec.sphere import PAPER_FILTERS

    for scheme, title in (("multi", "multi-resolution"), ("single", "single resolution")):
        table = Table(title=f"{title}: geometry, bits per vertex")
        table.add_column("mesh")
        for name in PAPER_FILTERS:
            table.add_column(name, justify="right")
        for mesh in results.meshes:
            table.add_row(
                Text(shown(mesh.name)), *(f"{found.schemes[scheme].sizes.rate:.2f}" for found in mesh.filters.values())
            )
            printed = mesh.published
            if printed is not None:
                known = {name: row.rate for name, row in getattr(printed, scheme).items()}
                if scheme == "multi":
                    known |= {f"degree {degree}": rate for degree, rate in enumerate(printed.degrees, start=1)}
                table.add_row(
                    "  published", *(f"{known[name]:.2f}" if name in known else "-" for name in PAPER_FILTERS)
                )
        wide_console().print(table)
    for name, reason in results.failures.items():
        typer.echo(printable(f"not analysed: {name}: {reason}"))
