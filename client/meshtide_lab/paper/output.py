"""The folder that `meshtide paper` leaves: report.html, results.json, CSV files and pictures."""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from meshtide_codec.errors import OptionError
from meshtide_codec.json_text import json_text
from meshtide_codec.output_files import made_folder, write_together
from meshtide_codec.output_policy import output_folder
from meshtide_codec.printable import encodable, shown
from meshtide_lab.paper import pictures, plots, tables
from meshtide_lab.paper.report import report_page

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from meshtide_lab.paper.run import PaperResults

RESULTS = "results.json"
REPORT = "report.html"


def check_folder(folder: Path, *, overwrite: bool) -> None:
    """Make sure that a report may be written into a folder: one that holds something is left alone without a word.

    Raises:
        OptionError: the folder holds something.
        OSError: nothing can be written there.
    """
    output_folder(folder)
    if not overwrite and folder.exists() and any(folder.iterdir()):
        what = "a report" if (folder / RESULTS).exists() else "files of something else"
        raise OptionError(f"{shown(folder)} holds {what}; name a new folder, or add --overwrite")


def plain_results(results: PaperResults) -> dict[str, Any]:
    """All figures as values that can become JSON."""
    options = results.options
    return {
        "meshtide": version("meshtide"),
        "bits": options.bits,
        "drop_bits": options.drop_bits,
        "minimum_ratio": options.minimum_ratio,
        "coarsest_vertices": options.coarsest_vertices,
        "failures": results.failures,
        **{name: rows for name, rows in _row_sets(results).items() if name != "histograms"},
    }


def write_report(
    results: PaperResults, folder: Path, progress: Callable[[str, float], None] | None = None
) -> list[Path]:
    """Write all files, or none; returns them, the report first.

    Raises:
        MissingLibraryError: matplotlib is not installed.
        OSError: a file cannot be written.
    """
    report = progress or (lambda _stage, _fraction: None)
    drawn: dict[str, dict[str, bytes]] = {}
    files: dict[Path, bytes] = {folder / REPORT: b""}  # the first of them, though it is made last
    for done, mesh in enumerate(results.meshes):
        report(f"pictures of {mesh.name}", done / len(results.meshes))
        drawn[mesh.name] = {
            "levels": pictures.levels_picture(mesh, results.options),
            "predictions": pictures.predictions_picture(mesh),
            "errors": pictures.errors_picture(mesh),
            "histograms": plots.histogram_plot(mesh),
            "rates": plots.rate_plot(mesh),
        }
        for kind, picture in drawn[mesh.name].items():
            files[folder / f"{mesh.name}-{kind}.png"] = picture
    for name, rows in _row_sets(results).items():
        files[folder / f"{name}.csv"] = encodable(tables.csv_text(rows)).encode()
    files[folder / RESULTS] = json_text(plain_results(results), indent=1).encode()
    files[folder / REPORT] = encodable(report_page(results, drawn)).encode()
    with made_folder(folder):
        write_together(files.items())
    report("written", 1.0)
    return list(files)


def _row_sets(results: PaperResults) -> dict[str, list[tables.Row]]:
    by_mesh = {
        "rates": tables.rate_rows,
        "accuracy": tables.accuracy_rows,
        "differences": tables.difference_rows,
        "norms": tables.norm_rows,
        "noise": tables.noise_rows,
        "conclusions": tables.conclusion_rows,
        "histograms": tables.histogram_rows,
    }
    sets = {name: [row for mesh in results.meshes for row in rows(mesh)] for name, rows in by_mesh.items()}
    return {"meshes": tables.mesh_rows(results.meshes)} | sets
