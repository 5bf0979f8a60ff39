"""The command `render`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from meshtide_codec.shared_options import JsonOption, MaxFacesOption, MaxVerticesOption, OverwriteOption


def render(
    inputs: Annotated[list[str], typer.Argument(help="Mesh files, .tide streams, or names of sample meshes.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="PNG file to write.")],
    all_levels: Annotated[
        bool, typer.Option(help="Draw all levels of a stream, coarse to fine, not just the finest.")
    ] = False,
    distance_from: Annotated[
        str | None, typer.Option(help="Colour vertices by their distance from this mesh's surface.", metavar="MESH")
    ] = None,
    size: Annotated[int, typer.Option(min=16, max=2048, help="Width and height of each mesh in pixels.")] = 360,
    columns: Annotated[int, typer.Option(min=1, help="Number of meshes side by side.")] = 3,
    turn: Annotated[float, typer.Option(help="Rotation about the upright axis, in degrees.")] = 25.0,
    tilt: Annotated[float, typer.Option(help="Tilt of the view from above, in degrees.")] = 15.0,
    smooth: Annotated[bool, typer.Option(help="Shade faces smoothly.")] = False,
    edges: Annotated[bool, typer.Option(help="Draw the edges of faces.")] = False,
    each_fits: Annotated[
        bool, typer.Option(help="Scale each mesh to fill its picture; by default all have the scale of the last.")
    ] = False,
    overwrite: OverwriteOption = False,
    max_vertices: MaxVerticesOption = None,
    max_faces: MaxFacesOption = None,
    as_json: JsonOption = False,
) -> None:
    """Draw meshes side by side into a PNG file; no display is needed.

    Example: meshtide render bunny.tide --all-levels -o levels.png

    Example: meshtide render coarse.ply fine.ply --distance-from scan.obj -o errors.png
    """
    from meshtide_codec.command_line import progress_bar
    from meshtide_codec.errors import OptionError
    from meshtide_codec.json_text import json_text
    from meshtide_codec.limits import wanted_limits
    from meshtide_codec.output_policy import output_file
    from meshtide_codec.printable import shown
    from meshtide_codec.rendering.picture import Style, draw_subjects
    from meshtide_codec.rendering.png import png
    from meshtide_codec.rendering.shown import coloured_by_distance, load_subjects
    from meshtide_codec.rendering.view import View

    if output.suffix.lower() != ".png":
        raise OptionError(f"cannot write {shown(output)}: its name must end with .png")
    target = output_file(output, [*inputs, *([] if distance_from is None else [distance_from])], overwrite=overwrite)
    style = Style(View(turn, tilt), size, columns, smooth, edges)
    with progress_bar("render") as progress:
        progress("read", 0.0)
        subjects = load_subjects(inputs, all_levels=all_levels, limits=wanted_limits(max_vertices, max_faces))
        scale = None
        if distance_from is not None:
            progress("distances", 0.3)
            subjects, scale = coloured_by_distance(subjects, load_subjects([distance_from])[0].mesh)
        progress("draw", 0.6)
        image = draw_subjects(subjects, None if each_fits else subjects[-1].mesh, scale, style)
        target.write(png(image))
    height, width, _ = image.shape
    if as_json:
        meshes = [{"caption": subject.caption, "vertices": len(subject.mesh.vertices)} for subject in subjects]
        typer.echo(json_text({"output": str(output), "width": width, "height": height, "meshes": meshes}))
        return
    typer.echo(f"{shown(output)}: {len(subjects)} meshes, {width} x {height} pixels")
