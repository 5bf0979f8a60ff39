"""Rarer formats, read and written by trimesh: positions and triangles only."""

from __future__ import annotations

import io
import logging
import warnings
from typing import TYPE_CHECKING, Any

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh import Mesh
from meshtide_codec.scene import Scene

if TYPE_CHECKING:
    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.source import Source


def read_other(source: Source, limits: FileLimits) -> Scene:
    """A scene of one mesh, from any format that trimesh reads.

    Raises:
        MeshFileError: it is of an unknown format, or cannot be read.
    """
    import trimesh  # noqa: PLC0415 - heavy

    kind = source.suffix.lstrip(".")
    if kind not in trimesh.available_formats():
        raise MeshFileError(f"nothing is known about files named *{source.suffix}")
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # its warnings come back below as one error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # other people's libraries; what matters is raised
            loaded: Any = trimesh.load(io.BytesIO(source.data), file_type=kind, process=False, maintain_order=True)
            mesh: Any = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
    except MemoryError:
        raise
    except Exception as error:  # its readers raise whatever their parsers meet
        raise MeshFileError(f"trimesh cannot read it: {str(error) or type(error).__name__}") from error
    if not isinstance(mesh, trimesh.Trimesh):
        raise MeshFileError(f"there is no mesh in it but a {type(mesh).__name__}")
    limits.check_counts(len(mesh.vertices), len(mesh.faces))
    source.note(f"files named *{source.suffix} are read as positions and triangles: nothing else of them is kept")
    return Scene.of(Mesh.checked(mesh.vertices, mesh.faces))


def write_other(scene: Scene, kind: str) -> bytes:
    """The scene's mesh in any format that trimesh writes into one file.

    Raises:
        MeshFileError: the format is unknown, lacks a library, or takes more than one file.
    """
    import trimesh  # noqa: PLC0415 - heavy

    mesh = scene.mesh()
    plain = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, validate=False)
    try:
        data = plain.export(file_type=kind)
    except (KeyError, ValueError, ImportError) as error:
        raise MeshFileError(f"{kind!r} is unknown or lacks a library ({error})") from error
    if not isinstance(data, bytes | str):
        raise MeshFileError(f"format {kind!r} takes more than one file; try ply, obj or glb")
    return data.encode() if isinstance(data, str) else data
