"""How far two meshes are from each other: symmetric distance of their surfaces, as fractions of the original's size.

Points spread evenly over each surface are searched for on the other (`closest_points`). The root mean square is that
of the worse direction, the maximum that over both, over samples and all vertices; both are divided by the diagonal of
the original's bounding box: the convention of Cignoni, Rocchini, Scopigno, "Metro: measuring error on simplified
surfaces", Computer Graphics Forum 17 (1998), section 3. O((m + samples) log m) a measurement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.closest_points import TriangleTree
from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
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
    """Measures meshes against one original, which is made ready once.

    Args:
        vertices: (n, 3) float64 of the original, finite.
        faces: (m, 3) integers; a mesh without faces is the set of its vertices.
        samples: points to sample on each surface, at least 1.
        vertex_limit: vertices of each mesh that the maximum looks at; of more, every second, third and so on.
        seed: of the samples; the same seed gives the same bits.

    Raises:
        MeshError: the arrays are not of that form.
        OptionError: there are no samples, or no vertices.

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
        points = np.asarray(vertices, np.float64)
        self._count = samples
        self._seed = seed
        self._centre = np.zeros(3)
        self._scale = 1.0
        if points.size:
            low, high = points.min(axis=0), points.max(axis=0)
            self._centre = low / 2 + high / 2
            self._scale = _diagonal(low, high)
        self._original = TriangleTree(self._scaled(points), faces)
        self._samples = self._original.samples(samples, seed).points
        self._vertex_limit = vertex_limit
        self._vertices = self._original.used_vertices(vertex_limit)

    def measure(self, vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> Distortion:
        """The distance of another mesh (n, 3), (m, 3) from the original.

        Raises:
            MeshError: the arrays are not a mesh of finite vertices.
        """
        other = TriangleTree(self._scaled(np.asarray(vertices, np.float64)), faces)
        forth, farthest_forth = other.mean_and_largest(self._samples)
        back, farthest_back = self._original.mean_and_largest(other.samples(self._count, self._seed + 1).points)
        farthest = max(farthest_forth, farthest_back)
        farthest = self._original.largest(other.used_vertices(self._vertex_limit), farthest)
        farthest = other.largest(self._vertices, farthest)
        return Distortion(math.sqrt(max(forth, back)), math.sqrt(farthest))

    def _scaled(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        return (vertices - self._centre) / self._scale


def distortion(
    original: tuple[NDArray[np.float64], NDArray[np.integer]],
    other: tuple[NDArray[np.float64], NDArray[np.integer]],
    samples: int = DEFAULT_SAMPLES,
    seed: int = DEFAULT_SEED,
) -> Distortion:
    """The distance of two meshes (vertices, faces), see `DistortionMeter` for arguments and errors.

    >>> point = np.array([[1.0, 2.0, 3.0]]), np.zeros((0, 3), np.int32)
    >>> distortion(point, point)
    Distortion(rms=0.0, maximum=0.0)
    """
    return DistortionMeter(*original, samples=samples, seed=seed).measure(*other)


def _diagonal(low: NDArray[np.float64], high: NDArray[np.float64]) -> float:
    """Length of the box's diagonal, safe from underflow; 1 for a point, whose distances are in its own unit."""
    with np.errstate(over="ignore"):
        sides = high - low
    largest = float(sides.max())
    if largest == 0.0 or not math.isfinite(largest):
        return 1.0
    return largest * math.sqrt(float(((sides / largest) ** 2).sum()))
