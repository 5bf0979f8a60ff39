"""Meshes of any size for benchmarks: a wavy torus, closed, irregular enough to be like a scan; and rough terrain."""

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


def fractal_terrain(vertex_count: int) -> Mesh:
    """An open square of about `vertex_count` vertices, rough at every scale, its diagonals and corners at random."""
    side = max(2, round(vertex_count**0.5))
    rng = np.random.default_rng(2)
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None, :])
    frequency[0, 0] = np.inf  # the mean height is 0
    spectrum = np.fft.rfft2(rng.normal(size=(side, side))) / frequency**1.8
    height = np.fft.irfft2(spectrum, s=(side, side))
    height *= 0.1 * side / max(np.abs(height).max(), 1e-300)
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    moved = rng.uniform(-0.3, 0.3, size=(2, side, side))
    vertices = np.stack([x + moved[0], y + moved[1], height], axis=-1).reshape(-1, 3) / side
    corner = (x * side + y)[:-1, :-1].reshape(-1)
    a, b, c, d = corner, corner + side, corner + side + 1, corner + 1
    turned = rng.random(len(corner)) < 0.5
    first = np.where(turned[:, None], np.stack([a, b, d], axis=1), np.stack([a, b, c], axis=1))
    second = np.where(turned[:, None], np.stack([b, c, d], axis=1), np.stack([a, c, d], axis=1))
    return Mesh.checked(vertices, np.concatenate([first, second]))
