"""OFF files of tests: a square of two triangles, read from bytes."""

from __future__ import annotations

from typing import Any

from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.off import read_off
from meshtide_codec.mesh_files.source import Source

LIMITS = FileLimits(vertices=1000, faces=2000)
SQUARE = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
FACES = [[0, 1, 2], [0, 2, 3]]


def read(data: bytes, limits: FileLimits = LIMITS) -> tuple[Mesh, list[str]]:
    source = Source("a.off", ".off", data)
    return read_off(source, limits).mesh(), source.notes


def values(mesh: Mesh, name: str) -> Any:
    """The values of the attribute of that name, or None."""
    return next((one.values.tolist() for one in mesh.attributes if one.name == name), None)
