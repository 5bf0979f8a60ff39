"""How far two meshes are from each other: symmetric distance of their surfaces, as fractions of the original's size.

Points spread evenly over each surface are searched for on the other (codec/core, surface/distance.hpp). The root mean
square is that of the worse direction, the maximum that over both, over samples and all vertices; both are divided by
the diagonal of the original's bounding box: the convention of Cignoni, Rocchini, Scopigno, "Metro: measuring error on
simplified surfaces", Computer Graphics Forum 17 (1998), section 3. O((m + samples) log m) a measurement.
"""

from __future__ import annotations

import sys
from ctypes import byref, c_double
from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec import core
from meshtide_codec.closest_points import LARGEST_REACH, Box, lent_surface
from meshtide_codec.errors import MeshError, OptionError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

DEFAULT_SAMPLES = 8_000
"""Samples of each surface: the root mean square of quantized meshes of any size is good to 1 %."""

DEFAULT_VERTEX_LIMIT = 1 << 16
"""Vertices of each mesh that the maximum looks at: all of them in most meshes, and bounded time in huge ones."""

DEFAULT_SEED = 1

LARGEST_HALF_SIDE = sys.float_info.max / 4
"""Of a box whose diagonal is finite."""

SMALLEST_REACH = 2.0**-500
"""Units that a mesh has to reach from an original without extent: squares of less are zero."""


@dataclass(frozen=True)
class Distortion:
    """Distance of two surfaces, as fractions of the diagonal of the original's bounding box.

    Attributes:
        rms: root mean square distance, of the worse of the two directions.
        maximum: the largest distance found in either direction, all vertices included.
    """

    rms: float
    maximum: float


class DistortionMeter:
    """Measures meshes against one original, which is made ready once; threads may share it.

    Args:
        vertices: (n, 3) float64 of the original, finite.
        faces: (m, 3) integers; a mesh without faces is the set of its vertices.
        samples: points to sample on each surface, at least 1.
        vertex_limit: vertices of each mesh that the maximum looks at; of more, every second, third and so on.
        seed: of the samples; the same seed gives the same bits.

    Raises:
        MeshError: the arrays are not of that form.
        OptionError: there are no samples, or no vertices.

    >>> import numpy as np
    >>> square = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0]])
    >>> meter = DistortionMeter(square, np.array([[0, 1, 2], [0, 2, 3]]))
    >>> found = meter.measure(square + np.array([0, 0, 0.5]), np.array([[1, 2, 3], [0, 1, 3]]))
    >>> round(found.rms, 12), round(found.maximum, 12)  # the diagonal is 5
    (0.1, 0.1)
    """

    def __init__(
        self,
        vertices: NDArray[np.float64],
        faces: NDArray[np.integer],
        samples: int = DEFAULT_SAMPLES,
        seed: int = DEFAULT_SEED,
        vertex_limit: int = DEFAULT_VERTEX_LIMIT,
    ) -> None:
        if samples < 1 or vertex_limit < 1:
            raise OptionError(f"a distance needs samples and vertices; {samples} and {vertex_limit} are none")
        self._meter = core.Handle("mt_meter_free")
        original = lent_surface(vertices, faces)
        core.call(
            "mt_meter_new",
            byref(original),
            samples,
            vertex_limit,
            seed,
            byref(self._meter.pointer),
            argument_error=MeshError,
        )
        points, self._faces = original.kept  # the faces are what the core goes on reading
        self._box = Box.around(points)
        if self._box.half_side > LARGEST_HALF_SIDE:
            raise MeshError("the mesh is too large to be measured: the diagonal of its box is no number")

    def measure(self, vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> Distortion:
        """The distance of another mesh (n, 3), (m, 3) from the original.

        Raises:
            MeshError: the arrays are not a mesh of finite vertices, or one so much larger, or so far away, that its
                distances are no numbers.
        """
        rms, maximum = c_double(), c_double()
        other = lent_surface(vertices, faces)
        self._check_range(other.kept[0])
        core.call("mt_meter_measure", self._meter, byref(other), byref(rms), byref(maximum), argument_error=MeshError)
        return Distortion(rms.value, maximum.value)

    def _check_range(self, points: NDArray[np.float64]) -> None:
        """Raise unless squared distances are numbers, and not zero where distances are none."""
        reach = float(self._box.reaches(points).max())
        vanishes = self._box.half_side == 0.0 and 0.0 < reach < SMALLEST_REACH
        if reach > LARGEST_REACH or vanishes:
            raise MeshError(f"the meshes cannot be compared: one reaches {reach:.1e} times the size of the other")
