"""Whether a `.tide` file was made of a certain mesh, so that `encode` may make it anew.

A stream does not name its source, but it keeps the corner and the side of the mesh's bounding cube exactly, whatever
the bits, the profile and the effort. Two different meshes that share both to a millionth are taken for versions of one.
Where the person gave an origin, as adjacent tiles share it, the cube tells nothing of the mesh.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import OptionError, StreamError
from meshtide_codec.mesh_files import is_mesh_path
from meshtide_codec.mesh_files.source import GZIP_SUFFIX
from meshtide_codec.output_files import STANDARD_OUTPUT
from meshtide_codec.output_policy import REMEDY, output_file
from meshtide_codec.printable import shown
from meshtide_codec.stream.container import MAGIC, ContainerReader

if TYPE_CHECKING:
    from pathlib import Path

    from meshtide_codec.grid import Grid
    from meshtide_codec.mesh import Mesh
    from meshtide_codec.output_policy import OutputFile
    from meshtide_codec.stream.header import StreamHeader

TIDE_SUFFIX = ".tide"
_PIECE = 1 << 16
_SAME = 1e-6
"""Difference of corners and sides, as a fraction of the side, that reading another format of the mesh may make."""


def default_stream(mesh: Path) -> Path:
    """Where the stream of a mesh file goes unless it is told: beside it.

    >>> from pathlib import Path
    >>> default_stream(Path("scans/a.ply")).name, default_stream(Path("a.obj.gz")).name, str(default_stream(Path("-")))
    ('a.tide', 'a.tide', '-')
    """
    if str(mesh) == STANDARD_OUTPUT:
        return mesh
    return (mesh.with_suffix("") if mesh.suffix.lower() == GZIP_SUFFIX else mesh).with_suffix(TIDE_SUFFIX)


def stream_target(mesh: Path, output: Path | None, *, overwrite: bool) -> OutputFile:
    """Where the stream of a mesh file may be written, before the mesh is read; see `check_same_mesh`.

    Raises:
        OptionError: something is there that is not to be replaced, or not surely made of this file.
        OSError: nothing can be written there.
    """
    path = output or default_stream(mesh)
    target = output_file(path, [mesh], overwrite=overwrite, own=_is_stream, standard_output=True)
    if output is None and target.replaces and not overwrite and (others := _rivals(mesh)):
        raise OptionError(f"{shown(path)} is there already, and {shown(mesh)} and {others[0]} both become it; {REMEDY}")
    return target


def check_same_mesh(target: OutputFile, mesh: Mesh, grid: Grid | None = None, *, overwrite: bool) -> None:
    """Make sure, before a mesh is encoded, that a stream that is there was made of it.

    Raises:
        OptionError: it was made of another one.
    """
    if target.replaces and not overwrite and not is_stream_of(target.path, mesh, grid):
        raise OptionError(f"{shown(target.path)} is there already, and the stream of another mesh; {REMEDY}")


def is_stream_of(path: Path, mesh: Mesh, grid: Grid | None = None) -> bool:
    """Whether a file is a stream of `mesh` on that grid, with or without the vertices that no face uses."""
    if grid is not None and grid.origin is not None:
        return False
    header = _header(path)
    return header is not None and any(_same_cube(header, each, grid) for each in (mesh, mesh.referenced()))


def _is_stream(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def _rivals(mesh: Path) -> list[str]:
    """Other mesh files beside `mesh` whose streams would have the same name."""
    name = default_stream(mesh)
    others = (path for path in mesh.parent.iterdir() if path.name != mesh.name and default_stream(path) == name)
    return sorted(shown(path) for path in others if is_mesh_path(path) and path.is_file())


def _header(path: Path) -> StreamHeader | None:
    reader = ContainerReader()
    try:
        with path.open("rb") as file:
            while reader.header is None and (piece := file.read(_PIECE)):
                reader.feed(piece)
    except (OSError, StreamError):
        return None
    return reader.header


def _same_cube(header: StreamHeader, mesh: Mesh, grid: Grid | None) -> bool:
    if not len(mesh.vertices):
        return False
    corner = mesh.vertices.min(axis=0)
    with np.errstate(over="ignore", invalid="ignore"):
        side = float((mesh.vertices.max(axis=0) - corner).max())
        if grid is not None:
            side = grid.placed(mesh, header.bits).extent or side
        slack = _SAME * max(side, header.extent)
        return abs(side - header.extent) <= slack and bool(np.abs(corner - header.origin).max() <= slack)
