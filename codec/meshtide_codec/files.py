"""Mesh files, read and written through trimesh: PLY, OBJ, OFF, STL, GLB and whatever else it knows.

Faces and vertex order are taken as they stand in the file: nothing is merged or repaired, only vertices that no face
uses are left out. Polygons are cut into triangles and the meshes of a scene become one.
"""

from __future__ import annotations

import logging
import os
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from meshtide_codec.errors import MeshError, MeshFileError
from meshtide_codec.file_checks import check_rows
from meshtide_codec.mesh import Mesh

MESH_SUFFIXES = frozenset({".ply", ".obj", ".off", ".stl", ".glb", ".gltf"})
"""What is taken for a mesh file without being told; trimesh reads and writes more."""

TEXT_FORMATS = frozenset({"obj", "off"})
TEXT_DIGITS = 17  # enough to restore each float64


def is_mesh_path(path: Path | str) -> bool:
    """Whether the name of a file ends like that of a mesh.

    >>> is_mesh_path("bunny.PLY"), is_mesh_path("notes.txt")
    (True, False)
    """
    return Path(path).suffix.lower() in MESH_SUFFIXES


def load_mesh(path: Path | str, *, keep_unreferenced: bool = False) -> Mesh:
    """Read a mesh from a file.

    Args:
        path: of the file; its suffix tells the format.
        keep_unreferenced: whether vertices that no face uses stay (they cannot be seen, but cost bytes).

    Raises:
        MeshFileError: the file is not a mesh, holds less than it declares, or is of a format that cannot be read.
        MeshError: it holds a mesh that is not usable.
        OSError: the file cannot be opened.
    """
    import trimesh  # noqa: PLC0415 - heavy

    path = Path(path)
    with path.open("rb"):  # missing or forbidden files are told by their own errors
        pass
    try:
        check_rows(path)
    except MeshFileError as error:
        raise MeshFileError(f"{path} cannot be read as a mesh: {error}") from error
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # its warnings come back below as one error
    try:
        loaded: Any = trimesh.load(path, process=False, maintain_order=True)
        mesh: Any = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
    except MemoryError:
        raise
    except Exception as error:  # its readers raise whatever their parsers meet
        raise MeshFileError(f"{path} cannot be read as a mesh: {str(error) or type(error).__name__}") from error
    if not isinstance(mesh, trimesh.Trimesh | trimesh.points.PointCloud):
        raise MeshFileError(f"{path} holds no mesh but a {type(mesh).__name__}")
    if len(mesh.vertices) == 0:
        raise MeshFileError(f"{path} holds no mesh: there are no vertices in it")
    try:
        checked = Mesh.checked(mesh.vertices, getattr(mesh, "faces", []))
    except MeshError as error:
        raise type(error)(f"{path}: {error}") from error
    return checked if keep_unreferenced else checked.referenced()


def save_mesh(mesh: Mesh, path: Path | str) -> None:
    """Write a mesh to a file whose name tells the format; an existing file is replaced only once all is written.

    Raises:
        MeshFileError: the format is unknown.
        OSError: the file cannot be written; nothing is left behind.
    """
    import trimesh  # noqa: PLC0415 - heavy

    path = Path(path)
    suffix = path.suffix.lower().lstrip(".")
    if suffix == "ply":
        write_atomically(path, _binary_ply(mesh))
        return
    plain = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, validate=False)
    digits: Any = {"digits": TEXT_DIGITS} if suffix in TEXT_FORMATS else {}
    try:
        data = plain.export(file_type=suffix, **digits)
    except (KeyError, ValueError, ImportError) as error:
        raise MeshFileError(f"cannot write {path}: {suffix!r} is unknown or lacks a library ({error})") from error
    if not isinstance(data, bytes | str):
        raise MeshFileError(f"cannot write {path}: format {suffix!r} takes more than one file; try ply, obj or glb")
    write_atomically(path, data.encode() if isinstance(data, str) else data)


def _binary_ply(mesh: Mesh) -> bytes:
    """A binary PLY file in double precision (trimesh writes single, which moves the vertices of a large scan)."""
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment written by meshtide\n"
        f"element vertex {len(mesh.vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"] = 3
    rows["corners"] = mesh.faces
    return header.encode() + mesh.vertices.astype("<f8").tobytes() + rows.tobytes()


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file beside its place and move it there, so that nobody ever sees half of it.

    Raises:
        OSError: the file cannot be written; nothing is left behind.
    """
    descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        umask = os.umask(0)
        os.umask(umask)
        Path(name).chmod(0o666 & ~umask)  # as open() would have made it; mkstemp makes files private
        Path(name).replace(path)
    except BaseException:
        with suppress(OSError):
            Path(name).unlink()
        raise
