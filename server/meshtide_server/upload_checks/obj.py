"""OBJ: vertices and triangles are counted, and files that it names must lie beside it.

Format: Wavefront, "Object Files (.obj)", appendix B1 of the Advanced Visualizer manual. It declares no counts, so the
file is read once; a polygon of n corners becomes n - 2 triangles. Its materials are of no use here, but its reader
looks for them, and must not be sent elsewhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

from meshtide_codec.errors import MeshFileError
from meshtide_codec.file_checks.text_lines import filled_lines

if TYPE_CHECKING:
    from meshtide_server.upload_checks.limits import UploadLimits


def check_obj(file: BinaryIO, limits: UploadLimits) -> None:
    """Check an uploaded OBJ file.

    Raises:
        MeshFileError: it holds too much, nothing, or names a file elsewhere.
    """
    vertices = faces = 0
    for line in filled_lines(file):
        word, _, rest = line.partition(b" ")
        if word == b"v":
            vertices += 1
        elif word == b"f":
            faces += max(1, len(rest.split()) - 2)
        elif word == b"mtllib":
            _check_name(rest.strip().decode("utf-8", "replace"))
        limits.check_counts(vertices, faces)
    if vertices == 0:
        raise MeshFileError("the OBJ file holds no mesh: there are no vertices in it")


def _check_name(name: str) -> None:
    parts = name.replace("\\", "/").split("/")
    if "" in parts[:-1] or ".." in parts or ":" in parts[0]:
        raise MeshFileError(f"mtllib names a file elsewhere, {name[:80]!r}; remove the line and send the file again")
