"""Octrees of small meshes that the tests of profile compact share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.octree import Octree, build_octree
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import quantize

if TYPE_CHECKING:
    import numpy.typing as npt


def octree_of(mesh: Mesh, bits: int) -> Octree:
    quantized = quantize(mesh, bits)
    return build_octree(quantized.positions, quantized.faces, bits)


def torus(around: int, across: int, bits: int) -> Octree:
    """A bumpy torus of around * across vertices, mirror symmetric across z."""
    u, v = np.meshgrid(np.arange(around) / around, np.arange(across) / across, indexing="ij")
    u, v = 2 * np.pi * u.ravel(), 2 * np.pi * v.ravel()
    tube = 0.35 + 0.05 * np.sin(5 * u)
    radius = 1 + tube * np.cos(v)
    vertices = np.stack([radius * np.cos(u), radius * np.sin(u), tube * np.sin(v)], axis=1)
    cell = np.arange(around * across)
    row, column = cell // across, cell % across
    next_row, next_column = (row + 1) % around * across, (column + 1) % across
    lower = np.stack([cell, next_row + column, next_row + next_column], axis=1)
    upper = np.stack([cell, next_row + next_column, row * across + next_column], axis=1)
    return octree_of(Mesh.checked(vertices, np.concatenate([lower, upper])), bits)


def lattice_soup(seed: int, vertices: int, faces: int, bits: int) -> Octree:
    """Random triangles between random grid points."""
    generator = np.random.default_rng(seed)
    points = generator.integers(0, 1 << bits, (vertices, 3)).astype(float)
    return octree_of(Mesh.checked(points, generator.integers(0, vertices, (faces, 3))), bits)


def cloud(seed: int, count: int, size: int) -> npt.NDArray[np.int32]:
    """Pairwise different random grid points."""
    points = np.random.default_rng(seed).integers(0, size, (count, 3)).astype(np.int32)
    return np.unique(points, axis=0)
