"""Rarer formats, read and written by trimesh: positions and triangles only.

Each needs a library that is not installed with meshtide. Those that are archives are bounded before they are opened.
"""

from __future__ import annotations

import io
import logging
import warnings
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.errors import MeshFileError, MissingLibraryError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.formats import SUFFIXES
from meshtide_codec.mesh_files.source import largest_expansion
from meshtide_codec.scene import Scene

if TYPE_CHECKING:
    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.source import Source

_READ = {
    "3mf": "lxml networkx",
    "3dxml": "lxml networkx",
    "dae": "pycollada",
    "zae": "pycollada",
    "xaml": "lxml",
    "step": "cascadio",
    "stp": "cascadio",
}
"""The packages that trimesh needs for each format."""
_NO_EXTRA = "cascadio"
"""The package that is in no extra of meshtide: it is large."""
WRITTEN = ("3mf", "dae")


def read_other(source: Source, limits: FileLimits) -> Scene:
    """A scene of one mesh, from a format that trimesh reads.

    Raises:
        MeshFileError: it is of an unknown format, needs a library, or cannot be read.
    """
    import trimesh  # noqa: PLC0415 - heavy

    kind = source.suffix.lstrip(".")
    if kind not in _READ:
        raise MeshFileError(f"nothing is known about files named *{source.suffix}; {_known()}")
    if kind not in trimesh.available_formats():
        raise MeshFileError(f"files named *{source.suffix} need a library: {_remedy(kind)}")
    data = source.data
    _check_archive(data, limits)
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # its warnings come back below as one error
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # other people's libraries; what matters is raised
            loaded: Any = trimesh.load(io.BytesIO(data), file_type=kind, process=False, maintain_order=True)
            mesh: Any = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
    except MemoryError:
        raise
    except Exception as error:  # its readers raise whatever their parsers meet
        raise MeshFileError(
            f"trimesh cannot read it: it is damaged, or of another kind than *{source.suffix}"
        ) from error
    if not isinstance(mesh, trimesh.Trimesh):
        raise MeshFileError("there is no mesh in it, but points or lines")
    limits.check_counts(len(mesh.vertices), len(mesh.faces))
    source.note(f"files named *{source.suffix} are read as positions and triangles: nothing else of them is kept")
    return Scene.of(Mesh.checked(mesh.vertices, mesh.faces))


def write_other(scene: Scene, kind: str) -> bytes:
    """The scene's mesh in one of the formats `WRITTEN`, which trimesh writes into one file.

    Raises:
        MissingLibraryError: the format takes a library that is not installed.
    """
    import trimesh  # noqa: PLC0415 - heavy

    mesh = scene.mesh()
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            plain = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, validate=False)
            data = plain.export(file_type=kind)
    except (KeyError, ValueError, ImportError) as error:
        raise MissingLibraryError(f"files named *.{kind} need a library: {_remedy(kind)}") from error
    return data.encode() if isinstance(data, str) else bytes(data)


def _remedy(kind: str) -> str:
    return f"pip install {_READ[kind]}" if _READ[kind] == _NO_EXTRA else "pip install 'meshtide[formats]'"


def _known() -> str:
    own = ", ".join(suffix.lstrip(".") for suffix in SUFFIXES)
    return f"{own} can be read, and with one more library each {', '.join(_READ)}"


def _check_archive(data: bytes, limits: FileLimits) -> None:
    """Refuse a zip archive whose members are larger together than an archive of that size may be.

    A member cannot be larger than it declares: more than that is never unpacked.
    """
    if not data.startswith(b"PK"):
        return
    most = largest_expansion(len(data), limits)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(member.file_size for member in archive.infolist())
    except (zipfile.BadZipFile, ValueError, NotImplementedError, OverflowError) as error:
        raise MeshFileError("the archive is damaged") from error
    if size > most:
        raise MeshFileError(f"the archive expands to more than {most} bytes from {len(data)}")
