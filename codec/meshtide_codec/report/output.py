"""What `encode --report` prints and writes."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import typer

from meshtide_codec.command_line import wide_console
from meshtide_codec.output_files import made_folder, write_together
from meshtide_codec.output_policy import check_apart, output_file, output_folder
from meshtide_codec.printable import shown
from meshtide_codec.report.stream_report import StreamReport, report_files

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from meshtide_codec.encoder import EncodedMesh
    from meshtide_codec.output_policy import OutputFile


def report_target(target: Path | None, mesh: Path, stream: Path, *, overwrite: bool) -> list[OutputFile] | None:
    """The files of `encode --report TARGET`, checked before the work begins; None without a report.

    Args:
        target: where the report goes, or None for no report.
        mesh: that is encoded.
        stream: where its stream goes, which no report may be.
        overwrite: whether existing files are replaced.

    Raises:
        OptionError: a file of a kind that a report cannot be, or one that is not to be replaced.
        MissingLibraryError: a library is not installed.
        OSError: nothing can be written there.
    """
    if target is None:
        return None
    files = report_files(target, mesh.stem)
    for path in files:
        output_folder(path.parent)
        check_apart(path, stream)
    return [output_file(path, [mesh], overwrite=overwrite, new_folder=True) for path in files]


def written_report(files: Sequence[OutputFile] | None, mesh: Path, encoded: EncodedMesh) -> StreamReport | None:
    """The report of a stream, its files written; None without a report."""
    if files is None:
        return None
    report = StreamReport(mesh.stem, encoded, [file.path for file in files])
    contents = [(file.path, report.file(file.path)) for file in files]
    with ExitStack() as folders:
        for folder in {file.path.parent for file in files}:
            folders.enter_context(made_folder(folder))
        write_together(contents, replace=all(file.replace for file in files))
    return report


def print_report(report: StreamReport, *, err: bool = False) -> None:
    """Print the tables of a report, and where its files are."""
    for table in report.tables():
        wide_console(stderr=err).print(table)
    for path in report.files:
        typer.echo(f"report: {shown(path)}", err=err)
