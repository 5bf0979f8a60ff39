"""From a scene or a mesh to a file whose name tells the format."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.formats import Written, writer_of
from meshtide_codec.mesh_files.other_formats import write_other
from meshtide_codec.mesh_files.source import format_suffix
from meshtide_codec.output_files import write_atomically
from meshtide_codec.scene import Scene

if TYPE_CHECKING:
    from meshtide_codec.mesh import Mesh


def save_scene(scene: Scene, path: Path | str) -> tuple[str, ...]:
    """Write a scene to a file, and beside it what the format keeps in files of their own.

    Returns:
        What the format cannot hold, a line each.

    Raises:
        MeshFileError: the format is unknown.
        OSError: a file cannot be written; nothing is left behind of it.
    """
    path = Path(path)
    suffix = format_suffix(path.name)
    writer = writer_of(suffix)
    try:
        written = Written(write_other(scene, suffix.lstrip("."))) if writer is None else writer(scene, path.name)
    except MeshFileError as error:
        raise MeshFileError(f"cannot write {path}: {error}") from error
    for name, data in written.companions.items():
        write_atomically(path.parent / name, data)
    write_atomically(path, written.data)
    return written.notes


def save_mesh(mesh: Mesh, path: Path | str) -> None:
    """Write a mesh to a file whose name tells the format; an existing file is replaced only once all is written.

    Raises:
        MeshFileError: the format is unknown.
        OSError: the file cannot be written; nothing is left behind.
    """
    save_scene(Scene.of(mesh), path)
