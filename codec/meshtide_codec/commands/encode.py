"""The command `encode`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from meshtide_codec.shared_options import (
    JsonOption,
    OverwriteOption,
    bits_option,
    coarsest_vertices_option,
    drop_bits_option,
    effort_option,
    minimum_ratio_option,
    named_path,
    profile_option,
)


def encode(
    mesh: Annotated[
        Path,
        typer.Argument(
            help="Mesh file: PLY, OBJ, OFF, STL, GLB, ..., gzipped or not; - reads standard input.", parser=named_path
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="File to write; by default the mesh's name with .tide; - writes standard output.",
            parser=named_path,
        ),
    ] = None,
    profile: Annotated[str, profile_option()] = "compact",
    bits: Annotated[int | None, bits_option("12")] = None,
    origin: Annotated[
        str | None,
        typer.Option(help="Corner of the grid, as X,Y,Z; by default the mesh's smallest coordinates."),
    ] = None,
    extent: Annotated[
        float | None,
        typer.Option(help="Side of the grid; tiles encoded on the same grid match along their borders."),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(help="Spacing of the grid, in the mesh's unit; used in place of -B."),
    ] = None,
    strict: Annotated[
        bool, typer.Option(help="Refuse a mesh if quantization merges more than 0.1 % of its faces or area.")
    ] = False,
    previews: Annotated[
        str | None,
        typer.Option(
            help="compact: Ratios of the previews, such as 512,64; or none.", show_default="chosen by distance"
        ),
    ] = None,
    slices: Annotated[
        int | None,
        typer.Option(help="compact: Number of parts that Diffs are cut into.", show_default="1, more for large meshes"),
    ] = None,
    effort: Annotated[str | None, effort_option()] = None,
    drop_bits: Annotated[int | None, drop_bits_option("classic: ")] = None,
    minimum_ratio: Annotated[float | None, minimum_ratio_option("classic: ")] = None,
    coarsest_vertices: Annotated[int | None, coarsest_vertices_option("classic: ")] = None,
    filter_kind: Annotated[
        str | None, typer.Option("--filter", help="classic: zeroth, gaussian, taubin, polynomial or rational.")
    ] = None,
    degree: Annotated[int | None, typer.Option(help="classic: Degree of the polynomial filter.")] = None,
    basis: Annotated[str | None, typer.Option(help="classic: power or chebyshev.")] = None,
    norm: Annotated[
        float | None, typer.Option(help="classic: p of the norm that fitted filters minimise: 1 to 2, or inf.")
    ] = None,
    variable_from: Annotated[
        int | None,
        typer.Option("-S", help="classic: Send no Diffs for levels 1 to S-1; a large S means single resolution."),
    ] = None,
    diff_levels: Annotated[
        str | None, typer.Option(help="classic: Send Diffs for exactly these levels, such as 0,2,3.")
    ] = None,
    mesh_format: Annotated[
        str | None, typer.Option("--format", help="Format of the input, such as ply, in place of what its name says.")
    ] = None,
    keep_unreferenced: Annotated[bool, typer.Option(help="Keep vertices that no face uses.")] = False,
    store_order: Annotated[
        bool, typer.Option(help="Keep all vertices, and store the input's order of vertices and faces.")
    ] = False,
    report_to: Annotated[
        Path | None,
        typer.Option(
            "--report",
            help="Report bytes by layer and distances: a folder, or a .png or .html file; - only prints.",
            parser=named_path,
        ),
    ] = None,
    threads: Annotated[
        int | None,
        typer.Option(
            help="Number of threads; the bytes do not depend on it.", show_default="one fewer than processors"
        ),
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Encode a mesh file into a .tide stream.

    Without -o, an earlier stream of the same mesh beside it is replaced. With -o, an existing stream is replaced only
    if it decodes to the same mesh. Any other existing file is left alone, unless --overwrite is given.

    Example: meshtide encode bunny.obj -o bunny.tide

    Example: meshtide encode bunny.obj --profile classic --degree 5 --basis chebyshev
    """
    from meshtide_codec.command_line import progress_bar
    from meshtide_codec.command_options import chosen_grid, profile_options
    from meshtide_codec.commands.rates_table import print_rates
    from meshtide_codec.encoder import encode as encode_mesh
    from meshtide_codec.json_text import json_text
    from meshtide_codec.merging import merged_by_quantization
    from meshtide_codec.mesh_files import load_scene, mesh_of
    from meshtide_codec.mesh_files.not_kept import notes_of_encoding
    from meshtide_codec.own_streams import check_same_mesh, stream_target
    from meshtide_codec.printable import shown
    from meshtide_codec.quantize import DEFAULT_B
    from meshtide_codec.rates import stream_report
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
    report = stream_report(encoded.header, len(encoded.header.to_bytes())) | {
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
        typer.echo(json_text(report), err=aside)
        return
    print_rates(report, err=aside)
    typer.echo(
        f"left out: {report['unreferenced_vertices']} vertices without a face, {report['welded_vertices']} welded, "
        f"{report['dropped_faces']} faces that became degenerate or repeat another",
        err=aside,
    )
    if details is not None:
        print_report(details, err=aside)
    typer.echo(f"{shown(target.path)}: {len(data)} bytes, {report['bits_per_vertex']:.2f} bits per vertex", err=aside)
