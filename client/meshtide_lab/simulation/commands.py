"""The command `simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from meshtide_codec.printable import printable, shown
from meshtide_codec.shared_options import JsonOption, OverwriteOption, ProcessesOption, UnprotectedOption, bits_option


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(simulate)


def simulate(
    meshes: Annotated[
        list[str], typer.Argument(help="Mesh files, samples (spot, stanford-bunny), .tide files, or URLs.")
    ],
    loss: Annotated[
        list[str] | None,
        typer.Option(
            help="A link, such as 'gilbert:loss=0.05,burst=10 + deadline:seconds=2', or none; may be repeated."
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(help="Number of seeds.")] = 20,
    first_seed: Annotated[int, typer.Option(min=0, help="First seed.")] = 0,
    profile: Annotated[
        list[str] | None, typer.Option(help="classic or compact; may be repeated.", show_default="classic")
    ] = None,
    filters: Annotated[
        list[str] | None,
        typer.Option(
            "--filter", help="classic: zeroth, gaussian, taubin, degree-N; may be repeated.", show_default="degree-3"
        ),
    ] = None,
    norm: Annotated[
        list[str] | None,
        typer.Option(
            help="classic: p of the norm that fitted filters minimise: 1 to 2, or inf; may be repeated.",
            show_default="2",
        ),
    ] = None,
    variable_from: Annotated[
        list[int] | None,
        typer.Option(
            "-S", help="classic: S of the variable-length algorithm, or 0 for the basic one; may be repeated."
        ),
    ] = None,
    slices: Annotated[
        list[int] | None, typer.Option(help="compact: Number of parts of each Diff; may be repeated.", show_default="1")
    ] = None,
    bits: Annotated[int, bits_option()] = 12,
    unprotected: UnprotectedOption = "",
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")] = Path("simulation"),
    processes: ProcessesOption = None,
    parquet: Annotated[bool, typer.Option(help="Also write the tables as Parquet; needs pyarrow.")] = True,
    draw: Annotated[bool, typer.Option("--plots/--no-plots", help="Draw plots; needs matplotlib.")] = True,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Send meshes over lossy links, many times, and measure what is left of them.

    Every mesh is encoded in every variant, and sent over every link with every seed. To continue an interrupted sweep,
    run the same command again. The same sweep gives the same files, whatever the number of processes.

    Example: meshtide simulate spot --loss none --loss gilbert:loss=0.1,burst=10 --profile classic --profile compact
    """
    import os

    from meshtide_codec.command_line import progress_bar, wide_console
    from meshtide_codec.errors import MeshtideError
    from meshtide_codec.extras import check_extras
    from meshtide_lab.simulation import output as files
    from meshtide_lab.simulation import plots
    from meshtide_lab.simulation.summary import summarize
    from meshtide_lab.simulation.sweep import Sweep, run_sweep
    from meshtide_lab.simulation.variants import make_variants, parse_norm

    variants = make_variants(
        profile or ["classic"],
        filters or ["degree-3"],
        [parse_norm(each) for each in norm or ["2"]],
        variable_from or [0],
        slices or [1],
        bits,
    )
    sweep = Sweep(tuple(meshes), tuple(variants), tuple(loss or ()), range(first_seed, first_seed + seeds), unprotected)
    check_extras(*(files.PARQUET if parquet else ()), *(plots.LIBRARIES if draw else ()), group=files.EXTRA)
    with progress_bar("simulate") as progress:
        results = run_sweep(
            sweep, output, processes=processes or os.cpu_count() or 1, overwrite=overwrite, progress=progress
        )
        progress("tables and plots", 1.0)
        written = files.write_results(results, output, parquet=parquet, draw=draw)
    summary = summarize(results.runs)
    if as_json:
        _print_json(
            {
                "runs": len(results.runs),
                "resumed": results.resumed,
                "failures": results.failures,
                "files": [str(path) for path in written],
                "summary": [
                    {name: None if value != value else value for name, value in row.items()}  # noqa: PLR0124 - NaN
                    for row in summary
                ],
            }
        )
    else:
        wide_console().print(files.summary_table(summary))
        for name, reason in results.failures.items():
            typer.echo(printable(f"failed: {name}: {reason}"))
        resumed = f", {results.resumed} of them done before" if results.resumed else ""
        typer.echo(f"{shown(output)}: {len(results.runs)} runs{resumed}, {len(results.failures)} failures")
    if not results.runs:
        raise MeshtideError("every run of the sweep failed")


def _print_json(answer: object) -> None:
    from meshtide_codec.json_text import json_text

    typer.echo(json_text(answer))
