"""Whether a `.tide` file was made of a certain mesh, so that `encode` may make it anew.

A stream does not name its source. One that lies under the mesh's default name is taken for an earlier version where its
cube is the mesh's bounding cube to a millionth, or the grid that is asked for. Under a name that a person gave, meshes
of a library that are all fitted into one box would be taken for each other: there, a stream has to decode to the very
mesh, rounded to the stream's own grid.
"""

from __future__ import annotations

import errno
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshError, MeshFileError, OptionError, StreamError
from meshtide_codec.file_suffix import split_name
from meshtide_codec.mesh_files import is_mesh_path
from meshtide_codec.output_files import STANDARD_OUTPUT
from meshtide_codec.output_policy import REMEDY, output_file
from meshtide_codec.packets import MAGIC
from meshtide_codec.printable import shown
from meshtide_codec.quantize import quantize
from meshtide_codec.stream.container import ContainerReader

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from meshtide_codec.grid import Grid
    from meshtide_codec.mesh import Mesh
    from meshtide_codec.output_policy import OutputFile
    from meshtide_codec.stream.header import StreamHeader

TIDE_SUFFIX = ".tide"
_PIECE = 1 << 16
_SAME = 1e-6
"""Difference of corners and sides, as a fraction of the side, that reading another format of the mesh may make."""


def default_stream(mesh: Path) -> Path:
    """Where the stream of a mesh file goes by default: beside it.

    Raises:
        OSError: the path has no name.

    >>> from pathlib import Path
    >>> default_stream(Path("scans/a.ply")).name, default_stream(Path("a.obj.gz")).name, str(default_stream(Path("-")))
    ('a.tide', 'a.tide', '-')
    """
    if str(mesh) == STANDARD_OUTPUT:
        return mesh
    return _file(mesh).with_name(split_name(mesh).stem + TIDE_SUFFIX)


def default_mesh(stream: Path, kind: str) -> Path:
    """Where the mesh of a stream goes by default: beside it, never in place of the mesh that was encoded.

    Raises:
        OSError: the path has no name.

    >>> from pathlib import Path
    >>> default_mesh(Path("scans/a.tide"), "ply").name
    'a.decoded.ply'
    """
    return _file(stream).with_suffix(f".decoded.{kind}")


def _file(path: Path) -> Path:
    """The same path, unless it can only be a folder, as ``.`` and ``/`` are."""
    if not path.name:
        raise IsADirectoryError(errno.EISDIR, "Is a directory", str(path))
    return path


def stream_target(mesh: Path, output: Path | None, *, overwrite: bool) -> OutputFile:
    """Where the stream of a mesh file may be written, before the mesh is read; see `check_same_mesh`.

    Raises:
        MeshFileError: the file is a stream itself.
        OptionError: something is there that is not to be replaced, or not surely made of this file.
        OSError: nothing can be written there.
    """
    path = output or default_stream(mesh)
    if str(mesh) != STANDARD_OUTPUT and _is_stream(mesh):
        raise MeshFileError(
            f"{shown(mesh)} is a .tide stream, so it is encoded already; meshtide decode makes a mesh of it, and "
            "meshtide info shows what it holds"
        )
    target = output_file(path, [mesh], overwrite=overwrite, own=_is_stream, standard_output=True)
    if output is None and target.replaces and not overwrite and (others := _rivals(mesh)):
        raise OptionError(f"{shown(path)} is there already, and {shown(mesh)} and {others[0]} both become it; {REMEDY}")
    return target


def check_same_mesh(
    target: OutputFile, mesh: Mesh, grid: Grid | None = None, *, by_name: bool = False, overwrite: bool
) -> None:
    """Make sure, before a mesh is encoded, that a stream that is there was made of it.

    Args:
        target: where the stream goes.
        mesh: that is encoded.
        grid: that was asked for.
        by_name: whether the target has the mesh's default name, so that its cube is enough.
        overwrite: whether the user wants existing files replaced.

    Raises:
        OptionError: it was made of another one.
    """
    if not target.replaces or overwrite or (by_name and has_cube_of(target.path, mesh, grid)):
        return
    if not is_stream_of(target.path, mesh):
        raise OptionError(
            f"{shown(target.path)} is there already, and is not a whole stream of this very mesh; {REMEDY}"
        )


def has_cube_of(path: Path, mesh: Mesh, grid: Grid | None = None) -> bool:
    """Whether a stream's cube is that of `mesh`, or that grid; with or without the vertices that no face uses."""
    header = _header(path)
    return header is not None and any(
        _same_cube(header, each, chosen) for each in _versions(mesh) for chosen in {None, grid}
    )


def is_stream_of(path: Path, mesh: Mesh) -> bool:
    """Whether a file decodes to `mesh` on its own grid, with or without the vertices that no face uses.

    Cheap checks come first: the file is decoded only where the counts in its header are those of the mesh.
    """
    header = _header(path)
    if header is None:
        return False
    wanted = [each for each in (_quantized(each, header) for each in _versions(mesh)) if each is not None]
    if not wanted:
        return False
    decoded = _decoded(path)
    return decoded is not None and any(
        np.array_equal(decoded.vertices, each.vertices) and np.array_equal(decoded.faces, each.faces) for each in wanted
    )


def _versions(mesh: Mesh) -> list[Mesh]:
    """The mesh with and without the vertices that no face uses; those that are not finite are never encoded."""
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(mesh.vertices).all(axis=1))
    if not finite.any() or not finite[mesh.faces].all():
        return []
    whole = mesh if finite.all() else mesh.with_vertices(finite)
    used = whole.referenced()
    return [whole] if used is whole else [whole, used]


def _quantized(mesh: Mesh, header: StreamHeader) -> Mesh | None:
    """The mesh on the grid of a stream, as a decoder would restore it; None where the header shows that it is none."""
    if header.vertices > len(mesh.vertices) or header.faces > len(mesh.faces):
        return None
    try:
        quantized = quantize(mesh, header.bits, np.array(header.origin, np.float64), header.extent)
    except (MeshError, OptionError):  # it reaches out of the grid
        return None
    same = (len(quantized.positions), len(quantized.faces)) == (header.vertices, header.faces)
    return quantized.mesh() if same else None


def _decoded(path: Path) -> Mesh | None:
    """The finest level of a whole stream, or None."""
    from meshtide_codec.decoder import decode  # noqa: PLC0415 - heavy

    try:
        return decode(path.read_bytes())
    except (OSError, StreamError, KeyError):  # not to be read, damaged, or without a finest level
        return None


def _is_stream(path: Path) -> bool:
    """Whether a regular file begins as a stream does; what a pipe has given once, nobody reads again."""
    if not path.is_file():
        return False
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
    corner = mesh.vertices.min(axis=0)
    side = None
    try:
        if grid is not None:
            _, origin, side = grid.placed(mesh, header.bits)
            corner = corner if origin is None else origin
    except OptionError:  # no such grid for this mesh
        return False
    with np.errstate(over="ignore", invalid="ignore"):
        if side is None:
            side = float((mesh.vertices.max(axis=0) - corner).max())
        slack = _SAME * max(side, header.extent)
        return abs(side - header.extent) <= slack and bool(np.abs(corner - header.origin).max() <= slack)
