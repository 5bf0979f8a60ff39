"""A scene as a binary STL file: facets with their normals, in single precision.

Format: 3D Systems, "StereoLithography Interface Specification" (1989).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.formats import Written
from meshtide_codec.mesh_files.not_kept import not_kept
from meshtide_codec.mesh_files.stl.read import FACET, HEADER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.scene import Scene


def write_stl(scene: Scene, name: str) -> Written:  # noqa: ARG001 - nothing is written beside it
    """The scene's mesh as a binary STL file: triangles, in single precision.

    Raises:
        MeshFileError: a position is beyond single precision, or there are more facets than the format can count.

    >>> from meshtide_codec.mesh import Mesh
    >>> from meshtide_codec.scene import Scene
    >>> written = write_stl(Scene.of(Mesh.checked([[0, 0, 0], [0.1, 0, 0], [0, 1, 0]], [[0, 1, 2]])), "a.stl")
    >>> len(written.data), written.notes
    (134, ('positions are rounded to single precision, by 1.5e-09 at most',))
    """
    mesh = scene.mesh()
    if len(mesh.faces) >= 1 << 32:
        raise MeshFileError(f"STL cannot count {len(mesh.faces)} facets; try ply")
    with np.errstate(over="ignore"):
        single = mesh.vertices.astype("<f4")
    if not np.isfinite(single).all():
        raise MeshFileError("a position is too large for single precision, all that STL has; try ply")
    rows = np.zeros(len(mesh.faces), FACET)
    rows["corners"] = single[mesh.faces]
    rows["normal"] = _normals(mesh.vertices[mesh.faces])
    notes = not_kept(scene)
    rounding = float(np.abs(single - mesh.vertices).max()) if len(single) else 0.0
    if rounding:
        notes.insert(0, f"positions are rounded to single precision, by {rounding:.2g} at most")
    head = b"binary STL written by meshtide".ljust(HEADER, b" ")
    return Written(head + len(rows).to_bytes(4, "little") + rows.tobytes(), notes=tuple(notes))


def _normals(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normals (m, 3) of triangles (m, 3, 3); zeros where there is no area."""
    with np.errstate(all="ignore"):
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    unit: NDArray[np.float64] = np.nan_to_num(normals, nan=0.0, posinf=0.0, neginf=0.0)
    return unit
