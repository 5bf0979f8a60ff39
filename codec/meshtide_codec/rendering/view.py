"""From where a mesh is looked at, and which part of space a picture shows: parallel projection, y up.

A frame belongs to one mesh and can show others in the same place and scale: levels of a stream, say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.mesh import Mesh

MARGIN = 0.06
"""Share of a picture that stays empty at each side."""


@dataclass(frozen=True, slots=True)
class View:
    """The direction to look from.

    Args:
        turn: degrees about the y axis by which the mesh shows more of its +x side.
        tilt: degrees by which the mesh is looked at from above.

    Raises:
        OptionError: an angle that is not a finite number.

    >>> View(turn=90, tilt=0).turned(np.array([[1.0, 2.0, 3.0]])).round(12).tolist()
    [[-3.0, 2.0, 1.0]]
    """

    turn: float = 25.0
    tilt: float = 15.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.turn) and math.isfinite(self.tilt)):
            raise OptionError(f"a view's angles must be finite numbers of degrees, not {self.turn} and {self.tilt}")

    def turned(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions (n, 3) as the eye sees them: x to the right, y up, z towards the eye."""
        turn, tilt = math.radians(self.turn), math.radians(self.tilt)
        x, y, z = vertices.T
        x, z = x * math.cos(turn) - z * math.sin(turn), x * math.sin(turn) + z * math.cos(turn)
        y, z = y * math.cos(tilt) - z * math.sin(tilt), y * math.sin(tilt) + z * math.cos(tilt)
        return np.stack([x, y, z], axis=1)


@dataclass(frozen=True, slots=True)
class Framing:
    """A view, and the square of space that a picture shows.

    Args:
        view: the direction.
        origin: (3,) float64, what is taken from positions before they are turned.
        unit: the length that positions are divided by, so that no coordinate is too large to be drawn.
        centre: (3,) float64, the turned and scaled point in the middle of the picture.
        side: width of what should fit into the picture's margins, in units.
    """

    view: View
    origin: NDArray[np.float64]
    unit: float
    centre: NDArray[np.float64]
    side: float

    @classmethod
    def fitting(cls, mesh: Mesh, view: View | None = None) -> Framing:
        """The frame that `mesh` fills."""
        view = view or View()
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        origin = low / 2 + high / 2
        unit = float((high / 2 - low / 2).max()) or 1.0
        turned = view.turned((mesh.vertices - origin) / unit)
        low, high = turned.min(axis=0), turned.max(axis=0)
        return cls(view, origin, unit, (low + high) / 2, float((high - low)[:2].max()) or 1.0)

    def pixels(self, vertices: NDArray[np.float64], size: int) -> NDArray[np.float64]:
        """Positions (n, 3) in a picture of size x size: column, row from above, and height towards the eye."""
        scale = size * (1 - 2 * MARGIN) / self.side
        x, y, z = (self.view.turned((vertices - self.origin) / self.unit) - self.centre).T * scale
        return np.stack([x + size / 2, size / 2 - y, z], axis=1)
