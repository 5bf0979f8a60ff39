"""PLY (interim: the writer)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.mesh_files.formats import Written

if TYPE_CHECKING:
    from meshtide_codec.scene import Scene


def write_ply(scene: Scene, name: str) -> Written:  # noqa: ARG001
    """A binary PLY file in double precision."""
    mesh = scene.mesh()
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment written by meshtide\n"
        f"element vertex {len(mesh.vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"] = 3
    rows["corners"] = mesh.faces
    return Written(header.encode() + mesh.vertices.astype("<f8").tobytes() + rows.tobytes())
