"""Meshes of any size for benchmarks: a wavy torus, closed, irregular enough to be like a scan."""

from __future__ import annotations

import numpy as np

from meshtide_codec.mesh import Mesh


def wavy_torus(vertex_count: int) -> Mesh:
    """A torus of about `vertex_count` vertices with waves and a little noise, two faces for each vertex."""
    around = max(3, round((3 * vertex_count) ** 0.5))
    across = max(3, round(vertex_count / around))
    u, v = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    noise = np.random.default_rng(1).normal(scale=0.15, size=(2, around, across))
    phi = 2 * np.pi * (u + noise[0]) / around
    theta = 2 * np.pi * (v + noise[1]) / across
    radius = 0.35 + 0.03 * np.sin(9 * phi + 3 * theta) + 0.01 * np.cos(31 * phi - 17 * theta)
    ring = 1.0 + radius * np.cos(theta)
    vertices = np.stack([ring * np.cos(phi), ring * np.sin(phi), radius * np.sin(theta)], axis=-1).reshape(-1, 3)
    here = u * across + v
    ahead = (u + 1) % around * across + v
    right = u * across + (v + 1) % across
    opposite = (u + 1) % around * across + (v + 1) % across
    faces = np.concatenate(
        [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((here, ahead, right), (right, ahead, opposite))]
    )
    return Mesh.checked(vertices, faces)
