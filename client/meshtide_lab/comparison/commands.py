"""The command `compare`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from meshtide_codec.printable import encodable, printable, shown
from meshtide_codec.shared_options import JsonOption, OverwriteOption, bits_option, effort_option, profile_option

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from meshtide_lab.comparison.mesh_comparison import MeshComparison


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(compare)


def compare(
    meshes: Annotated[list[Path], typer.Argument(help="Mesh files, or folders of them.")],
    bits: Annotated[list[int] | None, bits_option("12")] = None,
    profile: Annotated[str, profile_option()] = "compact",
    effort: Annotated[str | None, effort_option()] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for CSV and JSON files, and a plot of each mesh.")
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Compare meshtide with Draco, and with a series of simplified Draco files that show a mesh coarse to fine.

    Whole files are compared without previews, which Draco does not have; what previews add is listed separately.
    Distances are measured from the quantized input. The bytes for a distance are those of the first state within it;
    nothing is interpolated. Repeat --bits to compare several.

    Example: meshtide compare scans/ --bits 10 --bits 12 --bits 14 --output comparison
    """
    from meshtide_codec.command_line import progress_bar
    from meshtide_codec.command_options import profile_options
    from meshtide_codec.errors import MeshError
    from meshtide_codec.extras import check_extras
    from meshtide_codec.mesh_files import load_mesh
    from meshtide_codec.report.plots import LIBRARIES
    from meshtide_codec.samples import load_sample
    from meshtide_lab.comparison import draco, ladder
    from meshtide_lab.comparison.mesh_comparison import compare_mesh

    options = [profile_options(profile, each, {"effort": effort}, {}) for each in bits or [12]]
    paths = _mesh_files(meshes)
    check_extras(draco.LIBRARY, ladder.LIBRARY, *(LIBRARIES if output is not None else ()))
    files = _Files(output, paths, [each.bits for each in options], overwrite=overwrite) if output is not None else None
    comparisons: list[MeshComparison] = []
    refused: dict[str, str] = {}
    with progress_bar("compare") as progress:
        progress("loading libraries", 0.0)
        compare_mesh("spot", load_sample("spot"), options[0])
        for name, path in paths.items():
            try:
                mesh = load_mesh(path)
                comparisons += [compare_mesh(f"{name}", mesh, each, progress) for each in options]
            except MeshError as error:
                refused[name] = str(error)
    if files is not None and comparisons:
        files.write(comparisons)
    _show(comparisons, refused, as_json=as_json)
    if not comparisons:
        raise MeshError("none of the meshes could be compared")


def _mesh_files(arguments: Sequence[Path]) -> dict[str, Path]:
    """Mesh files by a name of their own: the stem, and a number where stems repeat."""
    from meshtide_codec.errors import OptionError
    from meshtide_codec.mesh_files import is_mesh_path

    paths: list[Path] = []
    for argument in arguments:
        if argument.is_dir():
            found = sorted(path for path in argument.iterdir() if is_mesh_path(path))
            if not found:
                raise OptionError(f"there is no mesh file in {argument}")
            paths += found
        else:
            paths.append(argument)
    named: dict[str, Path] = {}
    for path in paths:
        count = 1
        name = path.stem
        while name in named:
            count += 1
            name = f"{path.stem}-{count}"
        named[name] = path
    return named


class _Files:
    """The files of a comparison, every one of them checked before the work begins.

    Args:
        folder: where they go.
        paths: the meshes by their names.
        bits: of which each mesh gets a plot.
        overwrite: whether existing files are replaced.

    Raises:
        OptionError: two meshes lead to one file, or one is there that is not to be replaced.
        OSError: nothing can be written there.
    """

    TABLES = ("sizes", "targets", "states")

    def __init__(self, folder: Path, paths: Mapping[str, Path], bits: Sequence[int], *, overwrite: bool) -> None:
        from meshtide_codec.output_policy import check_different, output_file, output_folder

        output_folder(folder)
        check_different((path.stem, path) for path in paths.values())
        names = [*(f"{name}.csv" for name in self.TABLES), "comparison.json"]
        names += [f"{name}-{each}.png" for name in paths for each in dict.fromkeys(bits)]
        for name in names:
            output_file(folder / name, paths.values(), overwrite=overwrite, new_folder=True)
        self._overwrite = overwrite
        self._folder = folder

    def write(self, comparisons: Sequence[MeshComparison]) -> None:
        """Write all of them, or none."""
        from meshtide_codec.json_text import json_text
        from meshtide_codec.output_files import made_folder, write_together
        from meshtide_lab.comparison import plots, tables

        contents: dict[str, bytes] = {}
        rows = (tables.size_rows(comparisons), tables.target_rows(comparisons), tables.state_rows(comparisons))
        for name, found in zip(self.TABLES, rows, strict=True):
            contents[f"{name}.csv"] = encodable(tables.csv_text(found)).encode()
        contents["comparison.json"] = json_text(tables.plain_comparison(comparisons), indent=1).encode()
        for item in comparisons:
            title = f"{shown(item.name)}: {item.vertices} vertices, B = {item.bits}"
            size = None if item.draco is None else item.draco.size
            contents[f"{item.name}-{item.bits}.png"] = plots.comparison_plot(title, item.curves, size)
        with made_folder(self._folder):
            write_together([(self._folder / name, data) for name, data in contents.items()], replace=self._overwrite)


def _show(comparisons: Sequence[MeshComparison], refused: dict[str, str], *, as_json: bool) -> None:
    from meshtide_codec.command_line import wide_console
    from meshtide_codec.json_text import json_text
    from meshtide_lab.comparison import tables
    from meshtide_lab.comparison.summary import summarize

    if as_json:
        typer.echo(json_text(tables.plain_comparison(comparisons) | {"refused": refused}))
        return
    if comparisons:
        console = wide_console()
        console.print(tables.size_table(comparisons))
        console.print(tables.target_table(comparisons))
        summaries = summarize(comparisons)
        console.print(tables.summary_table(summaries))
        console.print(tables.target_summary_table(summaries))
    problems = [f"{item.name}, B = {item.bits}: {problem}" for item in comparisons for problem in item.problems]
    _print_lines("not compared:", [*problems, *(f"{name}: {reason}" for name, reason in refused.items())])


def _print_lines(title: str, lines: Iterable[str]) -> None:
    found = [printable(line) for line in lines]
    if found:
        typer.echo("\n  ".join([title, *found]))
