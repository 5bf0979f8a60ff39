"""How far two meshes are from each other: symmetric distance of their surfaces, as fractions of the original's size.

Points spread evenly over each surface are searched for on the other (codec/core, surface/distance.hpp). The root mean
square is that of the worse direction, the maximum that over both, over samples and all vertices; both are divided by
the diagonal of the original's bounding box: the convention of Cignoni, Rocchini, Scopigno, "Metro: measuring error on
simplified surfaces", Computer Graphics Forum 17 (1998), section 3. O((m + samples) log m) a measurement.
"""

from __future__ import annotations

from ctypes import byref, c_double
from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec import core
from meshtide_codec.closest_points import lent_surface
from meshtide_codec.errors import MeshError, OptionError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

DEFAULT_SAMPLES = 8_000
"""Samples of each surface: the root mean square of quantized meshes of any size is good to 1 %."""

DEFAULT_VERTEX_LIMIT = 1 << 16
"""Vertices of each mesh that the maximum looks at: all of them in most meshes, and bounded time in huge ones."""

DEFAULT_SEED = 1


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
        _, self._faces = original.kept  # which the core goes on reading

    def measure(self, vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> Distortion:
        """The distance of another mesh (n, 3), (m, 3) from the original.

        Raises:
            MeshError: the arrays are not a mesh of finite vertices.
        """
        rms, maximum = c_double(), c_double()
        other = lent_surface(vertices, faces)
        core.call("mt_meter_measure", self._meter, byref(other), byref(rms), byref(maximum), argument_error=MeshError)
        return Distortion(rms.value, maximum.value)
