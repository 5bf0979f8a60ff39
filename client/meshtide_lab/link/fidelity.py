"""How far what a lossy link left of a mesh is from what was sent: vertex by vertex, surface by surface.

Vertex errors compare a level with the same level as it was sent, whose vertices and faces are the same ones: exact,
O(n). Surface errors compare any mesh with the finest one by samples (`meshtide_codec.distortion`). The l2 error per
vertex is the measure of Balan & Taubin 2000, section 5: the l2 norm divided by the number of vertices, in the unit
cube that holds the mesh.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.closest_points import TriangleTree
from meshtide_codec.decoder import Decoder
from meshtide_codec.distortion import DistortionMeter
from meshtide_codec.errors import MeshError, PacketError
from meshtide_codec.statistics import l2_error_per_vertex

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from meshtide_codec.mesh import Mesh
    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import StreamHeader

SURFACE_SAMPLES = 4000
"""Samples of each surface; the root mean square of distances is good to about 2 %, and the same for every mesh."""

SURFACE_VERTICES = 8192
SEED = 1


@dataclass(frozen=True, slots=True)
class VertexErrors:
    """How far vertices are from where they belong, in units of the cube that holds the mesh.

    Args:
        l2: root of the sum of squares over all vertices and coordinates.
        l_infinity: the largest error of a coordinate.
        l2_per_vertex: l2 / n, as in the paper's tables.
        rms: root mean square of a coordinate's error, l2 / sqrt(3 n).
    """

    l2: float
    l_infinity: float
    l2_per_vertex: float
    rms: float


@dataclass(frozen=True, slots=True)
class SurfaceErrors:
    """How far a surface is from the original's.

    Args:
        rms: symmetric root mean square distance, the worse of the two directions, as a fraction of the diagonal of
            the original's bounding box.
        hausdorff: largest distance found in either direction, vertices included, in the same unit.
        normal_deviation: mean angle, in degrees, between the original's normal at its samples and that of the
            closest triangle of the other surface; NaN where there are no triangles.
    """

    rms: float
    hausdorff: float
    normal_deviation: float


@dataclass(frozen=True, slots=True)
class LevelMetrics:
    """One level after a lossy link.

    Args:
        level: its number, 0 the finest.
        vertices: its vertex count.
        exact: whether it is as a receiver that lost nothing shows it at the end.
        vertex: errors against that; NaN where damage that went unnoticed has changed the number of vertices.
        surface: errors against the finest level as it was sent; None if they were not asked for.
    """

    level: int
    vertices: int
    exact: bool
    vertex: VertexErrors
    surface: SurfaceErrors | None


@dataclass(frozen=True, slots=True)
class StreamMetrics:
    """All levels of a stream after a lossy link.

    Args:
        levels: those that can be shown, coarse to fine.
        levels_missing: numbers of those that cannot, coarse to fine.
    """

    levels: tuple[LevelMetrics, ...]
    levels_missing: tuple[int, ...]

    @property
    def final(self) -> LevelMetrics | None:
        """The finest level that can be shown, None if there is none."""
        return self.levels[-1] if self.levels else None


def vertex_errors(true: NDArray[np.float64], found: NDArray[np.float64], unit: float = 1.0) -> VertexErrors:
    """Errors of positions (n, 3), divided by `unit`.

    Raises:
        MeshError: the arrays are not of one shape (n, 3).

    >>> vertex_errors(np.zeros((2, 3)), np.array([[0.0, 3.0, 0.0], [4.0, 0.0, 0.0]]), unit=2.0)
    VertexErrors(l2=2.5, l_infinity=2.0, l2_per_vertex=1.25, rms=1.0206...)
    """
    if true.shape != found.shape or true.ndim != 2 or true.shape[1] != 3 or not len(true):
        raise MeshError(
            f"vertices (n, 3) can be compared with as many others only, not {true.shape} with {found.shape}"
        )
    differences = (found - true) / unit
    l2 = math.sqrt(float(np.square(differences).sum()))
    return VertexErrors(
        l2=l2,
        l_infinity=float(np.abs(differences).max()),
        l2_per_vertex=l2_error_per_vertex(differences, 1.0),
        rms=l2 / math.sqrt(differences.size),
    )


class SurfaceMeter:
    """Measures surfaces against one original, which is made ready once.

    Args:
        original: the mesh.
        samples: points on each surface.
        seed: of the samples.

    Raises:
        MeshError: the mesh has no vertices.
        OptionError: there are no samples.
    """

    def __init__(self, original: Mesh, *, samples: int = SURFACE_SAMPLES, seed: int = SEED) -> None:
        self._meter = DistortionMeter(
            original.vertices, original.faces, samples=samples, seed=seed, vertex_limit=SURFACE_VERTICES
        )
        on_surface = TriangleTree(original.vertices, original.faces).samples(samples, seed)
        self._points = on_surface.points
        self._normals = _normals(original.vertices, on_surface.corners)

    def measure(self, mesh: Mesh) -> SurfaceErrors:
        """The errors of a mesh."""
        distance = self._meter.measure(mesh.vertices, mesh.faces)
        closest = TriangleTree(mesh.vertices, mesh.faces).closest(self._points)
        cosines = (self._normals * _normals(mesh.vertices, closest.corners)).sum(axis=1)
        known = np.isfinite(cosines)
        angles = np.degrees(np.arccos(np.clip(cosines[known], -1.0, 1.0)))
        return SurfaceErrors(
            rms=distance.rms,
            hausdorff=distance.maximum,
            normal_deviation=float(angles.mean()) if len(angles) else math.nan,
        )


class StreamMeter:
    """Measures what is left of one stream; the stream as it was sent is decoded once.

    Args:
        header: the stream's header.
        packets: all its packets.
        samples: points on each surface.

    Raises:
        StreamError: the stream is damaged.
    """

    def __init__(self, header: StreamHeader, packets: Iterable[Packet], *, samples: int = SURFACE_SAMPLES) -> None:
        decoder = Decoder(header)
        for packet in packets:
            decoder.push(packet)
        self.levels = tuple(dict.fromkeys(row.level for row in header.levels))
        self.true = {level: decoder.mesh(level) for level in self.levels}
        self.unit = header.extent or 1.0
        self._surface = SurfaceMeter(self.true[0], samples=samples)
        self._exact_surfaces: dict[int, SurfaceErrors] = {}

    def measure(self, decoder: Decoder, *, surfaces: bool = True) -> StreamMetrics:
        """The metrics of what `decoder` can show.

        Args:
            decoder: of the same stream.
            surfaces: whether surfaces are measured for all levels; else for the finest one only.
        """
        meshes = {level: _shown(decoder, level) for level in self.levels}
        shown = [level for level, mesh in meshes.items() if mesh is not None]
        rows = []
        for level, mesh in meshes.items():
            if mesh is None:
                continue
            errors = self._vertex_errors(level, mesh)
            wanted = surfaces or level == shown[-1]
            rows.append(
                LevelMetrics(
                    level=level,
                    vertices=len(mesh.vertices),
                    exact=decoder.is_exact(level) and errors.l_infinity == 0.0,
                    vertex=errors,
                    surface=self._surface_errors(level, mesh, changed=errors.l_infinity != 0.0) if wanted else None,
                )
            )
        return StreamMetrics(tuple(rows), tuple(level for level in self.levels if level not in shown))

    def _vertex_errors(self, level: int, mesh: Mesh) -> VertexErrors:
        true = self.true[level]
        if mesh.vertices.shape != true.vertices.shape:
            return VertexErrors(math.nan, math.nan, math.nan, math.nan)
        return vertex_errors(true.vertices, mesh.vertices, self.unit)

    def _surface_errors(self, level: int, mesh: Mesh, *, changed: bool) -> SurfaceErrors:
        if changed:
            return self._surface.measure(mesh)
        if level not in self._exact_surfaces:
            self._exact_surfaces[level] = self._surface.measure(self.true[level])
        return self._exact_surfaces[level]


def _normals(vertices: NDArray[np.float64], corners: NDArray[np.int32]) -> NDArray[np.float64]:
    """(k, 3) unit normals of triangles; NaN for those without area."""
    first, second, third = (vertices[corners[:, corner]] for corner in range(3))
    crossed = np.cross(second - first, third - first)
    lengths = np.sqrt(np.square(crossed).sum(axis=1, keepdims=True))
    return crossed / np.where(lengths > 0.0, lengths, math.nan)


def _shown(decoder: Decoder, level: int) -> Mesh | None:
    """The mesh of a level; None if it is not there, or its packets came damaged, as over a link without checks."""
    if not decoder.is_available(level):
        return None
    try:
        return decoder.mesh(level)
    except PacketError:
        return None
