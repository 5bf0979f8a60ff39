"""What was found for one mesh, and how regular the mesh is: the paper's conclusions differ by that."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic.hierarchy import hierarchy_of
from meshtide_codec.graph import build_adjacency
from meshtide_lab.paper.published import published_mesh

if TYPE_CHECKING:
    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.quantize import QuantizedMesh
    from meshtide_lab.paper.experiment import FilterResult
    from meshtide_lab.paper.noise_experiment import NoiseResult
    from meshtide_lab.paper.norm_experiment import NormResult
    from meshtide_lab.paper.published import PublishedMesh

PICTURED_FILTERS = ("zeroth", "gaussian", "degree 1", "degree 3")
"""The four filters of the paper's tables and pictures."""

REGULAR_DEGREE = 6
EVEN_VARIATION = 0.5
"""A mesh whose edges' lengths vary less than this is called even here; constructed parts vary by more than 1."""


@dataclass(frozen=True, slots=True)
class Regularity:
    """How even a mesh is.

    Args:
        six_neighbours: share of the vertices that have six neighbours.
        edge_variation: standard deviation of the edges' lengths divided by their mean.
    """

    six_neighbours: float
    edge_variation: float

    @property
    def is_even(self) -> bool:
        """Whether the mesh is called even here."""
        return self.edge_variation < EVEN_VARIATION


@dataclass(frozen=True, slots=True)
class MeshResult:
    """One mesh.

    Args:
        name: of the mesh.
        origin: where it comes from.
        quantized: the mesh on the grid.
        level_vertices: vertices of each level, finest first.
        level_shifts: bits per coordinate that each level has dropped.
        regularity: how even it is.
        filters: results by filter.
        norms: results of the norms.
        noises: results with perturbed Diffs, by filter.
    """

    name: str
    origin: str
    quantized: QuantizedMesh
    level_vertices: tuple[int, ...]
    level_shifts: tuple[int, ...]
    regularity: Regularity
    filters: dict[str, FilterResult] = field(default_factory=dict)
    norms: list[NormResult] = field(default_factory=list)
    noises: dict[str, NoiseResult] = field(default_factory=dict)

    @property
    def published(self) -> PublishedMesh | None:
        """The published figures of this very mesh, if it is in the paper."""
        return published_mesh(self.name)


def new_mesh_result(name: str, origin: str, quantized: QuantizedMesh, options: ClassicOptions) -> MeshResult:
    """A mesh without results yet."""
    levels = hierarchy_of(quantized, options)
    return MeshResult(
        name,
        origin,
        quantized,
        tuple(len(level.cells) for level in levels),
        tuple(level.shift for level in levels),
        regularity(quantized),
    )


def regularity(quantized: QuantizedMesh) -> Regularity:
    """How even the finest level is."""
    adjacency = build_adjacency(quantized.faces, len(quantized.positions))
    degree = adjacency.degree
    starts = quantized.positions[np.repeat(np.arange(len(degree)), degree)]
    lengths = np.linalg.norm(starts - quantized.positions[adjacency.neighbours], axis=1)
    variation = float(lengths.std() / lengths.mean()) if len(lengths) else 0.0
    return Regularity(float((degree == REGULAR_DEGREE).mean()), variation)
