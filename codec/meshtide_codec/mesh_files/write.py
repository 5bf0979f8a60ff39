"""From a scene or a mesh to a file whose name gives the format."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

from meshtide_codec.argument_types import check_type
from meshtide_codec.errors import MeshFileError, OptionError
from meshtide_codec.file_suffix import GZIP_SUFFIX
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.formats import SUFFIXES, Written, writer_of
from meshtide_codec.mesh_files.not_kept import not_kept
from meshtide_codec.mesh_files.other_formats import WRITTEN, write_other
from meshtide_codec.mesh_files.source import format_suffix
from meshtide_codec.output_files import (
    STANDARD_OUTPUT,
    is_standard_output,
    is_written_in_place,
    write_output,
    write_together,
)
from meshtide_codec.output_policy import REMEDY
from meshtide_codec.printable import shown
from meshtide_codec.scene import Scene


def save_scene(scene: Scene, path: Path | str, *, kind: str | None = None, replace: bool = True) -> tuple[str, ...]:
    """Write a scene to a file, and beside it what the format keeps in files of their own.

    A file whose name ends in ``.gz`` is packed by gzip, those beside it are not.

    Args:
        scene: what is written.
        path: of the file, or ``-`` for standard output.
        kind: the format, such as ply, in place of what the name says.
        replace: whether files that are there already are replaced.

    Returns:
        What the format cannot hold, a line each.

    Raises:
        MeshFileError: the format cannot hold the scene, or needs files of their own beside standard output.
        MissingLibraryError: the format takes a library that is not installed.
        OptionError: the format is unknown, or a file that it keeps beside this one is there already, and may not be
            replaced.
        OSError: a file cannot be written, or is there and may not be replaced; nothing is left behind of it.
    """
    check_type("the scene", scene, Scene, remedy="save_mesh writes a mesh")
    path = Path(path)
    suffix = f".{format_of(path, kind)}"
    writer = writer_of(suffix)
    packed = path.suffix.lower() == GZIP_SUFFIX
    try:
        if writer is None:
            written = Written(write_other(scene, suffix.lstrip(".")), notes=tuple(not_kept(scene)))
        else:
            written = writer(scene, path.stem if packed else path.name)
    except MeshFileError as error:
        raise MeshFileError(f"cannot write {path}: {error}") from error
    if written.companions and str(path) == STANDARD_OUTPUT:
        raise MeshFileError(
            f"a {suffix} file with {', '.join(written.companions)} beside it needs a folder; name a file"
        )
    there = [name for name in written.companions if not replace and os.path.lexists(path.parent / name)]
    if there:
        raise OptionError(f"{shown(path.parent / there[0])} is there already; {REMEDY}")
    data = gzip.compress(written.data, mtime=0) if packed else written.data  # without the time: always the same
    if str(path) == STANDARD_OUTPUT:
        write_output(path, data)
    else:
        companions = [(path.parent / name, companion) for name, companion in written.companions.items()]
        write_together([*companions, (path, data)], replace=replace)
    return written.notes


def save_mesh(mesh: Mesh, path: Path | str, *, kind: str | None = None, replace: bool = True) -> None:
    """Write a mesh to a file whose name, or `kind`, gives the format; see `save_scene`.

    Raises:
        MeshFileError: the format cannot hold the mesh.
        OptionError: the format is unknown, or takes a library that is not installed.
        OSError: the file cannot be written, or is there and may not be replaced; nothing is left behind.
    """
    check_type("the mesh", mesh, Mesh, remedy="Mesh.checked makes one of arrays, save_scene writes a scene")
    save_scene(Scene.of(mesh), path, kind=kind, replace=replace)


def format_of(path: Path, kind: str | None = None) -> str:
    """The format of a mesh file that is to be written, so that it is known before any work.

    Every command and every function that writes meshes asks here.

    Args:
        path: its name; what is not a regular file is a PLY file unless its name says something else.
        kind: the format, in place of what the name says.

    Raises:
        OptionError: neither gives a format that can be written.

    >>> format_of(Path("a.OBJ")), format_of(Path("a.obj"), "off"), format_of(Path("-"))
    ('obj', 'off', 'ply')
    """
    suffix = format_suffix(path.name) if kind is None else f".{kind.lstrip('.').lower()}"
    if not suffix and (is_standard_output(path) or is_written_in_place(path)):
        return "ply"
    written = [*SUFFIXES, *(f".{other}" for other in WRITTEN)]
    if suffix in written:
        return suffix.lstrip(".")
    if kind is not None:
        formats = ", ".join(each.lstrip(".") for each in written)
        raise OptionError(f"cannot write {shown(path)}: {shown(kind)} is none of the formats {formats}")
    raise OptionError(f"cannot write {shown(path)}: its name must end with one of {', '.join(written)}")
