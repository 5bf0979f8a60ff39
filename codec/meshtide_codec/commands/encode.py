"""The command `encode`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from meshtide_codec.shared_options import JsonOption, OverwriteOption, named_path


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
