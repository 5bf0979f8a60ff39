"""Checks of uploaded mesh files before a reader sees them: what they claim is refused before it costs memory.

Each format has a module of its own; `check_upload` picks it by the file's suffix and refuses contents of another kind,
such as an archive by the name of a mesh. Run in the encoder's process, like the readers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshFileError
from meshtide_server.upload_checks.glb import check_glb
from meshtide_server.upload_checks.limits import UploadLimits
from meshtide_server.upload_checks.obj import check_obj
from meshtide_server.upload_checks.off import check_off
from meshtide_server.upload_checks.ply import check_ply
from meshtide_server.upload_checks.sniffing import content_kind
from meshtide_server.upload_checks.stl import check_stl

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["UploadLimits", "check_upload"]


def check_upload(path: Path, limits: UploadLimits) -> None:
    """Check a file that a stranger sent.

    Args:
        path: of the file; its suffix tells its format.
        limits: what it may claim.

    Raises:
        MeshFileError: it is of another format, names other files, or claims too much, or more than it holds.
        OSError: it cannot be read.
    """
    suffix = path.suffix.lower()
    size = path.stat().st_size
    with path.open("rb") as file:
        kind = content_kind(file.read(64))
        if kind is not None and kind != suffix:
            raise MeshFileError(f"the file is named *{suffix}, but its content is {kind.lstrip('.')}")
        file.seek(0)
        match suffix:
            case ".ply":
                check_ply(file, size, limits)
            case ".stl":
                check_stl(file, size, limits)
            case ".off":
                check_off(file, limits)
            case ".obj":
                check_obj(file, limits)
            case ".glb":
                check_glb(file, size, limits)
            case _:
                raise MeshFileError(f"files named *{suffix} are not taken from strangers")
