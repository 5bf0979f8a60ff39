"""The codec's part of the command `meshtide`: encode, decode, info, sphere.

Imports of anything heavy happen inside the commands, so that `meshtide --help` answers at once.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from meshtide_codec.shared_options import JsonOption, MaxFacesOption, MaxVerticesOption, OverwriteOption, named_path

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import StreamHeader

StreamArgument = Annotated[
    Path, typer.Argument(help="A .tide file, or the beginning of one; - reads a pipe.", parser=named_path)
]


def register(app: typer.Typer) -> None:
    """Add the codec's commands to `app`."""
    app.command()(encode)
    app.command()(decode)
    app.command()(info)
    app.command()(sphere)


def encode(
    mesh: Annotated[
        Path,
        typer.Argument(
            help="Mesh file: PLY, OBJ, OFF, STL, GLB, ..., packed by gzip or not; - reads a pipe.", parser=named_path
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Default: the mesh's name with .tide; - is standard output.",
            parser=named_path,
        ),
    ] = None,
    profile: Annotated[
        str, typer.Option(help="compact (small) or classic (the paper's codec, for study).")
    ] = "compact",
    bits: Annotated[
        int | None,
        typer.Option(
            "-B", "--bits", help="Quantization bits per coordinate, 4 to 20; by default 12.", show_default=False
        ),
    ] = None,
    origin: Annotated[
        str | None, typer.Option(help="Where the grid begins, as X,Y,Z: by default at the mesh's smallest coordinates.")
    ] = None,
    extent: Annotated[
        float | None,
        typer.Option(help="Length of the grid's side; tiles of the same grid agree on their border."),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(help="Spacing of the grid in the mesh's unit; it decides about B."),
    ] = None,
    strict: Annotated[
        bool, typer.Option(help="Refuse a mesh of which quantization merges more than 0.1 % of the faces or the area.")
    ] = False,
    previews: Annotated[
        str | None,
        typer.Option(
            help="compact: ratios of the previews, such as 512,64; or none; by default chosen by distance.",
            show_default=False,
        ),
    ] = None,
    slices: Annotated[
        int | None,
        typer.Option(help="compact: into how many parts the Diffs are cut; by default 1, and more for large meshes."),
    ] = None,
    effort: Annotated[
        str | None,
        typer.Option(help="compact: default, or high: smaller, and slower to write and to read.", show_default=False),
    ] = None,
    drop_bits: Annotated[
        int | None, typer.Option("-K", "--drop-bits", help="classic: bits per coordinate that a level drops.")
    ] = None,
    minimum_ratio: Annotated[float | None, typer.Option(help="classic: skip levels that collapse less.")] = None,
    coarsest_vertices: Annotated[int | None, typer.Option(help="classic: stop at a level so small.")] = None,
    filter_kind: Annotated[
        str | None, typer.Option("--filter", help="classic: zeroth, gaussian, taubin, polynomial or rational.")
    ] = None,
    degree: Annotated[int | None, typer.Option(help="classic: degree of a polynomial filter.")] = None,
    basis: Annotated[str | None, typer.Option(help="classic: power or chebyshev.")] = None,
    norm: Annotated[float | None, typer.Option(help="classic: p of the norm that is minimised, 1 to 2 or inf.")] = None,
    variable_from: Annotated[
        int | None, typer.Option("-S", help="classic: levels S-1 to 1 send no Diff; a large S is single resolution.")
    ] = None,
    diff_levels: Annotated[
        str | None, typer.Option(help="classic: the very levels whose Diffs are sent, such as 0,2,3.")
    ] = None,
    mesh_format: Annotated[
        str | None, typer.Option("--format", help="What the file is, such as ply, whatever its name tells.")
    ] = None,
    keep_unreferenced: Annotated[bool, typer.Option(help="Keep vertices that no face uses.")] = False,
    store_order: Annotated[
        bool, typer.Option(help="Keep all vertices, and store the order of vertices and faces, to restore it.")
    ] = False,
    report_to: Annotated[
        Path | None,
        typer.Option(
            "--report",
            help="Bytes by layer, and distances: a folder, .png or .html file; - prints only.",
            parser=named_path,
        ),
    ] = None,
    threads: Annotated[
        int | None,
        typer.Option(
            help="How many work at once; without it one fewer than there are processors. Bytes stay the same."
        ),
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Encode a mesh file into a .tide stream.

    Without -o, an earlier stream beside the mesh, of the same cube, is made anew. With -o, a stream is replaced that
    decodes to the very same mesh. Any other file that is there is left alone without --overwrite.

    Example: meshtide encode bunny.obj -o bunny.tide

    Example: meshtide encode bunny.obj --profile classic --degree 5 --basis chebyshev
    """
    from meshtide_codec.command_line import progress_bar
    from meshtide_codec.command_options import chosen_grid, profile_options
    from meshtide_codec.encoder import encode as encode_mesh
    from meshtide_codec.merging import merged_by_quantization
    from meshtide_codec.mesh_files import load_scene, mesh_of
    from meshtide_codec.mesh_files.not_kept import notes_of_encoding
    from meshtide_codec.own_streams import check_same_mesh, stream_target
    from meshtide_codec.printable import shown
    from meshtide_codec.quantize import DEFAULT_B
    from meshtide_codec.report.output import print_report, report_target, written_report

    grid = chosen_grid(origin, extent, step, bits)
    options = profile_options(
        profile,
        DEFAULT_B if bits is None else bits,
        {"previews": previews, "slices": slices, "effort": effort},
        {
            "drop_bits": drop_bits,
            "minimum_ratio": minimum_ratio,
            "coarsest_vertices": coarsest_vertices,
            "filter": filter_kind,
            "degree": degree,
            "basis": basis,
            "norm": norm,
            "variable_from": variable_from,
            "sent_levels": diff_levels,
        },
    )
    target = stream_target(mesh, output, overwrite=overwrite)
    report_files = report_target(report_to, mesh, target.path, overwrite=overwrite)
    with progress_bar("encode") as progress:
        progress("read", 0.0)
        scene = load_scene(mesh, kind=mesh_format)
        loaded = mesh_of(scene, mesh, keep_unreferenced=keep_unreferenced or store_order)
        if store_order:
            loaded.check_order(mesh)
        if target.replaces:
            check_same_mesh(target, scene.mesh(), grid, by_name=output is None, overwrite=overwrite)
        encoded = encode_mesh(
            loaded.mesh, options, grid=grid, store_order=store_order, threads=threads, progress=progress
        )
        progress("merged faces", 1.0)
        merged = merged_by_quantization(loaded.mesh, encoded.quantized)
    merged.check(strict=strict)
    data = encoded.to_bytes()
    target.write(data)
    report = _report(encoded.header) | {
        "output": str(target.path),
        "unreferenced_vertices": loaded.unreferenced,
        "welded_vertices": encoded.quantized.welded_vertices,
        "dropped_faces": encoded.quantized.dropped_faces,
        "notes": notes_of_encoding(scene, loaded),
        "merged": merged.plain(),
    }
    for note in report["notes"]:
        typer.echo(f"{shown(mesh.name)}: {shown(note)}", err=True)
    if merged.noticed:
        typer.echo(f"warning: {shown(merged.message())}", err=True)
    details = written_report(report_files, mesh, encoded)
    if details is not None:
        report |= details.plain()
    aside = target.is_standard_output
    if as_json:
        _print_json(report, err=aside)
        return
    _print_report(report, err=aside)
    typer.echo(
        f"left out: {report['unreferenced_vertices']} vertices without a face, {report['welded_vertices']} welded, "
        f"{report['dropped_faces']} faces that became degenerate or repeat another",
        err=aside,
    )
    if details is not None:
        print_report(details, err=aside)
    typer.echo(f"{shown(target.path)}: {len(data)} bytes, {report['bits_per_vertex']:.2f} bits per vertex", err=aside)


def decode(
    stream: StreamArgument,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Default: the stream's name with .decoded.ply; - is standard output.",
            parser=named_path,
        ),
    ] = None,
    kind: Annotated[
        str | None, typer.Option("--format", help="Of the mesh file, such as obj; default: as its name ends, or ply.")
    ] = None,
    level: Annotated[int, typer.Option(help="Level to decode; 0 is the finest.")] = 0,
    partial: Annotated[bool, typer.Option(help="Take what a cut-off or damaged file still holds.")] = False,
    input_order: Annotated[
        bool, typer.Option(help="Level 0 with vertices and faces as the input had them; needs --store-order.")
    ] = False,
    overwrite: OverwriteOption = False,
    max_vertices: MaxVerticesOption = None,
    max_faces: MaxFacesOption = None,
    as_json: JsonOption = False,
) -> None:
    """Decode a .tide stream into a mesh file.

    The mesh that was encoded is never replaced: bunny.tide becomes bunny.decoded.ply unless another name is given.

    Example: meshtide decode bunny.tide -o bunny-coarse.ply --level 2
    """
    from meshtide_codec.command_line import progress_bar
    from meshtide_codec.decoder import Decoder
    from meshtide_codec.errors import OptionError
    from meshtide_codec.limits import wanted_limits
    from meshtide_codec.mesh_files import save_mesh
    from meshtide_codec.mesh_files.write import format_of
    from meshtide_codec.order import in_input_order
    from meshtide_codec.output_policy import output_file
    from meshtide_codec.own_streams import default_mesh
    from meshtide_codec.printable import shown
    from meshtide_codec.stream.container import read_available

    path = output or default_mesh(stream, kind or "ply")
    target = output_file(path, [stream], overwrite=overwrite, standard_output=True)
    kind = format_of(target.path, kind)
    limits = wanted_limits(max_vertices, max_faces)
    header, packets, problem = read_available(_stream_bytes(stream), limits)
    if problem is not None and not partial:
        typer.echo("what is whole of it can be had: add --partial", err=True)
        raise problem
    coarsest = header.levels[0].level
    if not 0 <= level <= coarsest:
        raise OptionError(f"the stream has levels 0..{coarsest}, not {level}")
    with progress_bar("decode") as progress:
        decoder = Decoder(header, limits)
        wanted = packets if input_order else packets[: header.packet_count(level)]
        for done, packet in enumerate(wanted):
            progress("packets", done / len(wanted))
            decoder.push(packet)
        found = level if decoder.is_available(level) else decoder.best
        if found is None:
            raise problem or OptionError("the stream holds no whole level")
        mesh = decoder.mesh(found)
        if input_order:
            if decoder.order is None or found != 0:
                raise OptionError("the input's order is known for level 0 of a stream encoded with --store-order only")
            mesh = in_input_order(mesh, decoder.order)
    save_mesh(mesh, target.path, kind=kind, replace=target.replace)
    answer = {
        "output": str(target.path),
        "level": found,
        "exact": decoder.is_exact(found),
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "problem": None if problem is None else str(problem),
    }
    aside = target.is_standard_output
    if as_json:
        _print_json(answer, err=aside)
        return
    if problem is not None:
        typer.echo(f"the file is not whole ({problem})", err=True)
    state = "" if answer["exact"] else ", predicted only"
    counts = f"{len(mesh.vertices)} vertices, {len(mesh.faces)} faces{state}"
    typer.echo(f"{shown(target.path)}: level {found}, {counts}", err=aside)


def info(
    stream: StreamArgument,
    statistics: Annotated[bool, typer.Option(help="Read the Diffs too: Shannon's bound, power law, l2 error.")] = False,
    max_vertices: MaxVerticesOption = None,
    max_faces: MaxFacesOption = None,
    as_json: JsonOption = False,
) -> None:
    """Tell what a .tide stream holds: bytes by level and kind, bits per vertex, predictor.

    Example: meshtide info bunny.tide --json
    """
    from meshtide_codec.limits import wanted_limits
    from meshtide_codec.stream.container import read_available

    header, packets, problem = read_available(_stream_bytes(stream), wanted_limits(max_vertices, max_faces))
    report = _report(header) | {"packets_present": len(packets), "problem": None if problem is None else str(problem)}
    if statistics:
        report["differences"] = _difference_statistics(header, packets)
    if as_json:
        _print_json(report)
    else:
        _print_report(report)
    if problem is not None:
        raise problem


def sphere(as_json: JsonOption = False) -> None:
    """Print the rates of the paper's sphere, filter by filter, beside the published ones.

    Example: meshtide sphere
    """
    from dataclasses import asdict

    from rich.table import Table

    from meshtide_codec.command_line import progress_bar, wide_console
    from meshtide_codec.sphere import sphere_table

    with progress_bar("sphere") as progress:
        rows = list(sphere_table(progress))
    if as_json:
        _print_json({"rows": [asdict(row) for row in rows]})
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


def _stream_bytes(stream: Path) -> bytes:
    """The bytes of a stream's file, or of standard input where it is called ``-``."""
    import sys

    return sys.stdin.buffer.read() if str(stream) == "-" else stream.read_bytes()


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _report(header: StreamHeader) -> dict[str, Any]:
    from meshtide_codec.rates import stream_report

    return stream_report(header, len(header.to_bytes()))


def _difference_statistics(header: StreamHeader, packets: Sequence[Packet]) -> list[dict[str, Any]]:
    from dataclasses import asdict

    from meshtide_codec.command_line import progress_bar
    from meshtide_codec.report.difference_statistics import difference_statistics

    with progress_bar("statistics"):
        return [asdict(row) for row in difference_statistics(header, packets)]


def _print_json(answer: Mapping[str, Any], *, err: bool = False) -> None:
    from meshtide_codec.json_text import json_text

    typer.echo(json_text(answer), err=err)


def _print_report(report: Mapping[str, Any], *, err: bool = False) -> None:
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
    if "differences" in report:
        _print_difference_statistics(report["differences"])


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


def _predictor(report: Mapping[str, Any]) -> str:
    """The filter of a classic stream."""
    if "filter" not in report["options"]:
        return ""
    spec = dict(report["options"]["filter"])
    kind = spec.pop("kind")
    fields = ", ".join(f"{name} {value}" for name, value in spec.items())
    return f", predictor {kind} ({fields})" if fields else f", predictor {kind}"
