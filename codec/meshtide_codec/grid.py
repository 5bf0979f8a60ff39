"""The grid that a mesh is rounded to, where a person chooses it: its origin, its extent, the length of its steps.

Adjacent tiles that are encoded with the same origin, extent and B agree to the bit on the vertices that they share.
A step in the mesh's own unit, a millimetre for instance, decides how many bits there are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshtide_codec.errors import OptionError
from meshtide_codec.quantize import LARGEST_B, SMALLEST_B, grid_steps

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.mesh import Mesh


class PlacedGrid(NamedTuple):
    """A grid for one mesh.

    Attributes:
        bits: B, bits per coordinate.
        origin: (3,) float64, the position of grid point (0, 0, 0); None for the mesh's smallest coordinates.
        extent: length of the grid's side in the mesh's unit; None for as much as the mesh needs.
    """

    bits: int
    origin: NDArray[np.float64] | None
    extent: float | None


@dataclass(frozen=True, slots=True)
class Grid:
    """What is known of the grid before the mesh is; what is left out follows from the mesh.

    Args:
        origin: position of grid point (0, 0, 0) in the mesh's unit.
        extent: length of the grid's side, positive. With a step: at least so much, a whole number of steps.
        step: distance of neighbouring grid points, positive; B is the smallest that covers the extent, or the mesh.

    Raises:
        OptionError: a number that is not finite, or not positive where it has to be.

    >>> from meshtide_codec.mesh import Mesh
    >>> tile = Mesh.checked([[0, 0, 0], [40, 0, 0], [0, 30, 0]], [[0, 1, 2]])
    >>> Grid(step=0.5).placed(tile, bits=12)
    PlacedGrid(bits=7, origin=None, extent=63.5)
    """

    origin: tuple[float, float, float] | None = None
    extent: float | None = None
    step: float | None = None

    def __post_init__(self) -> None:
        if self.origin is not None and not (len(self.origin) == 3 and all(map(math.isfinite, self.origin))):
            raise OptionError(f"the grid's origin must be three finite numbers, not {self.origin}")
        for name, value in (("extent", self.extent), ("step", self.step)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise OptionError(f"the grid's {name} must be a positive number, not {value}")

    def placed(self, mesh: Mesh, bits: int) -> PlacedGrid:
        """The grid for `mesh`: of `bits` bits, or of as many as the step asks for.

        Raises:
            OptionError: the step asks for fewer than 4 or more than 20 bits; the message names a step that would do.
        """
        origin = None if self.origin is None else np.array(self.origin, np.float64)
        if self.step is None:
            return PlacedGrid(bits, origin, self.extent)
        span = _span(mesh, origin) if self.extent is None else self.extent
        bits = _bits_for(span, self.step)
        return PlacedGrid(bits, origin, _extent_of(self.step, grid_steps(bits)))


def _span(mesh: Mesh, origin: NDArray[np.float64] | None) -> float:
    """How far the mesh reaches from the origin, or from its smallest coordinates."""
    start = mesh.vertices.min(axis=0) if origin is None else origin
    with np.errstate(over="ignore"):
        return max(0.0, float((mesh.vertices.max(axis=0) - start).max()))


def _bits_for(span: float, step: float) -> int:
    """The smallest B whose steps cover `span`."""
    needed = span / step
    if needed > grid_steps(LARGEST_B) * (1.0 + 1e-15):
        least = span / grid_steps(LARGEST_B)
        raise OptionError(
            f"steps of {step:g} over {span:g} take more than B = {LARGEST_B} bits; "
            f"a step of {_rounded(least * (1 + 1e-5))} would do"
        )
    if 0.0 < needed <= grid_steps(SMALLEST_B - 1):
        raise OptionError(
            f"steps of {step:g} over {span:g} take fewer than B = {SMALLEST_B} bits; "
            f"a step of {_rounded(span / grid_steps(SMALLEST_B))} would do"
        )
    return next(bits for bits in range(SMALLEST_B, LARGEST_B + 1) if needed <= grid_steps(bits) * (1.0 + 1e-15))


def _rounded(value: float) -> str:
    return f"{value:.6g}"


def _extent_of(step: float, steps: int) -> float:
    """The extent that, cut into `steps`, gives `step` as exactly as a float64 can."""
    product = step * steps
    candidates = (product, math.nextafter(product, 0.0), math.nextafter(product, math.inf))
    return min(candidates, key=lambda extent: abs(extent / steps - step))
