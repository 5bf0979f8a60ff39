"""A level that has arrived: what is known of it, and its mesh."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshtide_codec.mesh import Mesh


@dataclass(frozen=True, slots=True)
class LevelFigures:
    """What is known of a level that has arrived, besides its mesh.

    Args:
        level: its number, 0 the finest.
        vertices: its vertex count.
        faces: its face count.
        exact: whether it is as the encoder made it: every packet that it builds on was decoded.
        rms: root mean square distance from the finest mesh, as a fraction of its bounding box's diagonal; NaN where
            a lossy link has left nobody knows what.
        maximum: largest distance, in the same unit.
        size: bytes of the file up to here: preamble, header and packets.
        seconds: since the download began.
    """

    level: int
    vertices: int
    faces: int
    exact: bool
    rms: float
    maximum: float
    size: int
    seconds: float


@dataclass(frozen=True, slots=True)
class ReceivedLevel(LevelFigures):
    """A level that has arrived: its figures and its mesh.

    Args:
        mesh: its vertices and faces as arrays.
    """

    mesh: Mesh

    @property
    def figures(self) -> LevelFigures:
        """The figures alone, to be kept when the mesh is not."""
        return LevelFigures(**{field.name: getattr(self, field.name) for field in fields(LevelFigures)})
