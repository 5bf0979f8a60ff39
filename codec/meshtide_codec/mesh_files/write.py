"""From a scene or a mesh to a file whose name gives the format."""

from __future__ import annotations

import gzip
import os
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshFileError, OptionError
from meshtide_codec.file_suffix import GZIP_SUFFIX
from meshtide_codec.mesh_files.formats import Written, writer_of
from meshtide_codec.mesh_files.not_kept import not_kept
from meshtide_codec.mesh_files.other_formats import write_other
from meshtide_codec.mesh_files.source import format_suffix
from meshtide_codec.output_files import (
    STANDARD_OUTPUT,
    is_standard_output,
    is_written_in_place,
    write_atomically,
    write_output,
)
from meshtide_codec.output_policy import REMEDY
from meshtide_codec.printable import shown
from meshtide_codec.scene import Scene

if TYPE_CHECKING:
    from meshtide_codec.mesh import Mesh


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
        MeshFileError: the format is unknown, or needs files of their own beside standard output.
        OptionError: a file that the format keeps beside it is there already, and may not be replaced.
        OSError: a file cannot be written, or is there and may not be replaced; nothing is left behind of it.
    """
    path = Path(path)
    suffix = _suffix(path, kind)
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
    for name, data in written.companions.items():
        write_atomically(path.parent / name, data, replace=replace)
    data = gzip.compress(written.data, mtime=0) if packed else written.data  # without the time: always the same
    write_output(path, data, replace=replace)
    return written.notes


def save_mesh(mesh: Mesh, path: Path | str, *, kind: str | None = None, replace: bool = True) -> None:
    """Write a mesh to a file whose name, or `kind`, gives the format; see `save_scene`.

    Raises:
        MeshFileError: the format is unknown.
        OSError: the file cannot be written, or is there and may not be replaced; nothing is left behind.
    """
    save_scene(Scene.of(mesh), path, kind=kind, replace=replace)


def format_of(path: Path, kind: str | None = None) -> str:
    """The format of a mesh file that is to be written, so that it is known before any work.

    Args:
        path: its name; what is not a regular file is a PLY file unless its name says something else.
        kind: the format, in place of what the name says.

    Raises:
        MeshFileError: neither gives it.

    >>> format_of(Path("a.OBJ")), format_of(Path("a.obj"), "off"), format_of(Path("-"))
    ('obj', 'off', 'ply')
    """
    suffix = _suffix(path, kind).lstrip(".")
    if not suffix and (is_standard_output(path) or is_written_in_place(path)):
        return "ply"
    if not suffix:
        raise MeshFileError(f"cannot write {path}: its name has no ending that gives the format, such as .ply")
    return suffix


def _suffix(path: Path, kind: str | None) -> str:
    return format_suffix(path.name) if kind is None else f".{kind.lstrip('.').lower()}"
