"""Meshes for tests, of this project and of others: small known ones, and a hypothesis strategy for random ones.

Needs hypothesis (`pip install 'meshtide[testing]'`); nothing else of the package imports this module.

>>> shapes()["tetrahedron"]()
Mesh(4 vertices, 4 faces)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshtideError
from meshtide_codec.mesh import Mesh

try:
    from hypothesis import strategies as st
except ModuleNotFoundError as error:
    raise MeshtideError("meshtide_codec.testing needs hypothesis: pip install 'meshtide[testing]'") from error

if TYPE_CHECKING:
    from collections.abc import Callable


def grid(side: int, *, seed: int = 0) -> Mesh:
    """A bumpy open patch of side x side vertices."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    height = np.sin(u * 0.7) + np.cos(v * 0.5) + 0.1 * rng.random((side, side))
    corner = (u * side + v)[:-1, :-1].reshape(-1)
    lower = np.stack([corner, corner + side, corner + 1], axis=1)
    upper = np.stack([corner + 1, corner + side, corner + side + 1], axis=1)
    return Mesh.checked(np.stack([u, v, height], axis=-1).reshape(-1, 3), np.concatenate([lower, upper]))


def tetrahedron() -> Mesh:
    """Four vertices, four faces."""
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    return Mesh.checked(vertices, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def soup(vertex_count: int, face_count: int, *, seed: int) -> Mesh:
    """Random triangles between random points: non-manifold, with isolated vertices and opposite faces."""
    rng = np.random.default_rng(seed)
    faces = rng.integers(0, vertex_count, (face_count, 3))
    opposite = faces[: face_count // 4][:, ::-1]
    return Mesh.checked(rng.random((vertex_count, 3)), np.concatenate([faces, opposite]))


def shapes() -> dict[str, Callable[[], Mesh]]:
    """Kinds of meshes that every round trip has to survive, by name."""
    return {
        "point": lambda: Mesh.checked([[3.0, -2.0, 5.0]], []),
        "points": lambda: Mesh.checked(np.random.default_rng(3).random((50, 3)), []),
        "triangle": lambda: Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
        "opposite faces": lambda: Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 1]]),
        "plane": lambda: Mesh.checked(grid(12).vertices * [1, 1, 0], grid(12).faces),
        "line": lambda: Mesh.checked(np.outer(np.arange(40), [1, 2, 3]), [[0, 1, 2], [5, 20, 39]]),
        "tetrahedron": tetrahedron,
        "grid": lambda: grid(24),
        "two components": lambda: Mesh.checked(
            np.concatenate([grid(9).vertices, grid(9).vertices + 100]),
            np.concatenate([grid(9).faces, grid(9).faces + 81]),
        ),
        "fan": lambda: Mesh.checked(np.random.default_rng(1).random((60, 3)), [[0, i, i + 1] for i in range(1, 59)]),
        "book": lambda: Mesh.checked(np.random.default_rng(2).random((40, 3)), [[0, 1, i] for i in range(2, 40)]),
        "soup": lambda: soup(80, 200, seed=5),
        "all welded": lambda: Mesh.checked(np.repeat([[1.0, 2.0, 3.0]], 5, axis=0), [[0, 1, 2], [2, 3, 4]]),
    }


@st.composite
def random_meshes(draw: st.DrawFn, largest: int = 60) -> Mesh:
    """Any mesh: coordinates on a coarse lattice (so that vertices weld) or free, any faces, some isolated vertices."""
    vertex_count = draw(st.integers(1, largest))
    face_count = draw(st.integers(0, 3 * largest))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    if draw(st.booleans()):
        vertices = rng.integers(0, draw(st.integers(1, 30)), (vertex_count, 3)).astype(float)
    else:
        vertices = rng.normal(size=(vertex_count, 3)) * 10.0 ** draw(st.integers(-6, 6))
    local = rng.integers(0, vertex_count, (face_count, 1)) + rng.integers(0, 6, (face_count, 3))
    return Mesh.checked(vertices, local % vertex_count)
