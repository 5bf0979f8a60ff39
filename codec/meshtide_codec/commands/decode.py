"""The command `decode`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from meshtide_codec.commands.stream_input import StreamArgument
from meshtide_codec.shared_options import (
    JsonOption,
    MaxFacesOption,
    MaxVerticesOption,
    MeshFormatOption,
    OverwriteOption,
    named_path,
)


def decode(
    stream: StreamArgument,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="File to write; by default the stream's name with .decoded.ply; - writes standard output.",
            parser=named_path,
        ),
    ] = None,
    kind: MeshFormatOption = None,
    level: Annotated[int, typer.Option(help="Level to decode; 0 is the finest.")] = 0,
    partial: Annotated[bool, typer.Option(help="Decode what is left of a damaged or cut-off file.")] = False,
    input_order: Annotated[
        bool, typer.Option(help="Restore the input's order of vertices and faces; needs encode --store-order.")
    ] = False,
    overwrite: OverwriteOption = False,
    max_vertices: MaxVerticesOption = None,
    max_faces: MaxFacesOption = None,
    as_json: JsonOption = False,
) -> None:
    """Decode a .tide stream into a mesh file.

    The mesh that was encoded is not replaced: bunny.tide becomes bunny.decoded.ply unless you give another name.

    Example: meshtide decode bunny.tide -o bunny-coarse.ply --level 2
    """
    from meshtide_codec.command_line import LONGEST_EXPLANATION, progress_bar
    from meshtide_codec.commands.stream_input import read_stream
    from meshtide_codec.decoder import Decoder
    from meshtide_codec.errors import OptionError
    from meshtide_codec.json_text import json_text
    from meshtide_codec.limits import wanted_limits
    from meshtide_codec.mesh_files import save_mesh
    from meshtide_codec.mesh_files.write import format_of
    from meshtide_codec.order import in_input_order
    from meshtide_codec.output_policy import output_file
    from meshtide_codec.own_streams import default_mesh
    from meshtide_codec.printable import printable, shown

    path = output or default_mesh(stream, kind or "ply")
    target = output_file(path, [stream], overwrite=overwrite, standard_output=True)
    kind = format_of(target.path, kind)
    limits = wanted_limits(max_vertices, max_faces)
    header, packets, problem = read_stream(stream, limits)
    if problem is not None and not partial:
        typer.echo(f"meshtide: {shown(stream)} is damaged or cut short; --partial decodes the rest", err=True)
        raise problem
    coarsest = header.levels[0].level
    if not 0 <= level <= coarsest:
        raise OptionError(f"{shown(stream)} has levels 0 to {coarsest}; there is no level {level}")
    with progress_bar("decode") as progress:
        decoder = Decoder(header, limits)
        wanted = packets if input_order else packets[: header.packet_count(level)]
        for done, packet in enumerate(wanted):
            progress("packets", done / len(wanted))
            decoder.push(packet)
        found = level if decoder.is_available(level) else decoder.best
        if found is None:
            raise problem or OptionError(f"{shown(stream)} holds no whole level")
        mesh = decoder.mesh(found)
        if input_order:
            if decoder.order is None or found != 0:
                raise OptionError(
                    f"{shown(stream)} does not hold the input's order: it takes a stream that was encoded with "
                    "--store-order, and level 0"
                )
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
        typer.echo(json_text(answer), err=aside)
        return
    if problem is not None:
        typer.echo(printable(f"{problem}; decoded what is whole", LONGEST_EXPLANATION), err=True)
    state = "" if answer["exact"] else ", predicted only"
    counts = f"{len(mesh.vertices)} vertices, {len(mesh.faces)} faces{state}"
    typer.echo(f"{shown(target.path)}: level {found}, {counts}", err=aside)
