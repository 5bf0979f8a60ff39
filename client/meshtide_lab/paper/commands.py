"""The command `paper`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from meshtide_codec.printable import printable, shown
from meshtide_codec.shared_options import OverwriteOption

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
    bits: Annotated[int, typer.Option("-B", "--bits", help="Quantization bits per coordinate, 4 to 20.")] = 10,
    drop_bits: Annotated[int, typer.Option("-K", "--drop-bits", help="Bits per coordinate that a level drops.")] = 1,
    minimum_ratio: Annotated[float, typer.Option(help="Skip levels that collapse less.")] = 1.5,
    coarsest_vertices: Annotated[int, typer.Option(help="Stop at a level so small.")] = 300,
    processes: Annotated[
        int | None, typer.Option(min=1, help="How many share the work.", show_default="one a processor")
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print all figures as one JSON object.")] = False,
) -> None:
    """Run section 5 of the paper again: rates by filter and degree, errors, norms, pictures, and a report of them.

    The paper's sphere is built in, and its published figures stand beside those found. For the paper's other meshes,
    which are not public, two of like kind are made by rule; any mesh file can be added.

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
