"""Random soups of triangles, for benchmarks: nothing that a mesh may be is left out."""

from __future__ import annotations

import numpy as np

from meshtide_codec.mesh import Mesh

MOST_VERTICES = 400
MOST_FACES = 1200


def random_soup(seed: int) -> Mesh:
    """Up to 400 vertices and 1200 faces: non-manifold, with isolated vertices, faces twice, both ways and degenerate.

    Half of them lie on a coarse lattice, where vertices fall together; the others at any scale, far from the origin.
    """
    rng = np.random.default_rng(seed)
    vertex_count = int(rng.integers(1, MOST_VERTICES + 1))
    face_count = int(rng.integers(0, MOST_FACES + 1))
    if rng.random() < 0.5:
        vertices = rng.integers(0, rng.integers(1, 40), (vertex_count, 3)).astype(float)
    else:
        scale = 10.0 ** rng.integers(-6, 7)
        vertices = (rng.normal(size=(vertex_count, 3)) + 100.0 * rng.normal(size=3)) * scale
    reach = int(rng.integers(1, vertex_count + 1))  # from patches of neighbours to faces between any three
    local = rng.integers(0, vertex_count, (face_count, 1)) + rng.integers(0, reach, (face_count, 3))
    faces = local % vertex_count
    return Mesh.checked(vertices, np.concatenate([faces, faces[: face_count // 8], faces[: face_count // 4, ::-1]]))
