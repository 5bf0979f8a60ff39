"""The sphere of the paper (section 5, tables 15 to 17): rates by filter, beside the published figures.

The mesh is an icosahedron subdivided five times (10242 vertices, 20480 faces), B = 10, K = 1, four levels. It is the
only mesh of the paper that can be made again exactly; the paper does not say how it normalizes it to the unit cube.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic.encoder import ClassicEncoding
from meshtide_codec.classic.geometry_bytes import geometry_bytes
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.filters import FilterSpec
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import grid_steps, quantize
from meshtide_codec.statistics import l2_error_per_vertex

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SUBDIVISIONS = 5
B = 10
COARSEST_VERTICES = 300
SINGLE_RESOLUTION = 99  # any S from the number of levels on

PAPER_FILTERS = {"zeroth": FilterSpec("zeroth"), "gaussian": FilterSpec("gaussian")} | {
    f"degree {degree}": FilterSpec("polynomial", degree=degree) for degree in range(1, 8)
}
"""The predictors of section 5, by name."""

PUBLISHED_MULTI = {
    "zeroth": 23.96,
    "gaussian": 18.37,
    "degree 1": 16.20,
    "degree 2": 12.90,
    "degree 3": 11.28,
    "degree 4": 10.59,
    "degree 5": 10.36,
    "degree 6": 10.42,
    "degree 7": 10.69,
}
PUBLISHED_SINGLE = {"zeroth": 23.28, "gaussian": 18.00, "degree 1": 17.09, "degree 3": 14.82}
"""Bits per vertex of the geometry, tables 15, 16 and 17."""


@dataclass(frozen=True, slots=True)
class SphereRow:
    """Bits per vertex of one filter: coarsest geometry, coefficients and Diffs, as the paper adds them up.

    `l2_error` is the l2 norm of the single resolution's Diffs divided by the vertex count, in units of the cube.
    """

    name: str
    multi: float
    single: float
    published_multi: float | None
    published_single: float | None
    l2_error: float


def paper_sphere(subdivisions: int = SUBDIVISIONS) -> Mesh:
    """An icosahedron subdivided `subdivisions` times, each new vertex pushed out to the unit sphere.

    >>> paper_sphere()
    Mesh(10242 vertices, 20480 faces)
    """
    golden = (1 + 5**0.5) / 2
    corners = [(sign * 1.0, other * golden, 0.0) for sign in (-1, 1) for other in (-1, 1)]
    vertices = np.array([np.roll(corner, turn) for turn in range(3) for corner in corners])
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    faces = _hull_of_icosahedron(vertices)
    for _ in range(subdivisions):
        vertices, faces = _subdivide(vertices, faces)
    return Mesh.checked(vertices, faces)


def sphere_table(progress: Callable[[str, float], None] | None = None) -> Iterator[SphereRow]:
    """The rows of tables 15 to 17, one filter after the other."""
    quantized = quantize(paper_sphere(), B)
    for done, (name, spec) in enumerate(PAPER_FILTERS.items()):
        if progress is not None:
            progress(name, done / len(PAPER_FILTERS))
        multi, single = (
            ClassicEncoding(
                quantized,
                ClassicOptions(bits=B, coarsest_vertices=COARSEST_VERTICES, filter=spec, variable_from=variable_from),
            )
            for variable_from in (None, SINGLE_RESOLUTION)
        )
        yield SphereRow(
            name,
            geometry_bytes(multi, B).rate,
            geometry_bytes(single, B).rate,
            PUBLISHED_MULTI.get(name),
            PUBLISHED_SINGLE.get(name),
            l2_error_per_vertex(single.differences[0], 1 / grid_steps(B)),
        )


def _hull_of_icosahedron(vertices: np.ndarray) -> np.ndarray:
    """The 20 triples of mutually nearest vertices, counter-clockwise from outside."""
    edge = np.sort(np.linalg.norm(vertices[0] - vertices, axis=1))[1] * 1.01
    near = np.linalg.norm(vertices[:, None] - vertices[None], axis=2) < edge
    faces = []
    for a in range(12):
        for b in range(a + 1, 12):
            for c in range(b + 1, 12):
                if near[a, b] and near[b, c] and near[a, c]:
                    outward = np.linalg.det(vertices[[a, b, c]]) > 0
                    faces.append((a, b, c) if outward else (a, c, b))
    return np.array(faces)


def _subdivide(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each triangle into four, the edges' midpoints pushed out to the unit sphere."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, midpoint = np.unique(edges, axis=0, return_inverse=True)
    middle = vertices[unique[:, 0]] + vertices[unique[:, 1]]
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    ab, bc, ca = (midpoint.reshape(-1, 3) + len(vertices)).T
    a, b, c = faces.T
    quarters = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return np.concatenate([vertices, middle]), np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
