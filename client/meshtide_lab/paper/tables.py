"""The tables of the report as rows of plain values: for CSV files, JSON, the terminal and the page."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.statistics import PowerLaw
from meshtide_lab.paper.conclusions import SENTENCES
from meshtide_lab.paper.experiment import SCHEMES
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from meshtide_lab.paper.mesh_result import MeshResult

Row = dict[str, Any]


def mesh_rows(meshes: Sequence[MeshResult]) -> list[Row]:
    """What the meshes are."""
    return [
        {
            "mesh": mesh.name,
            "origin": mesh.origin,
            "vertices": len(mesh.quantized.positions),
            "faces": len(mesh.quantized.faces),
            "welded_vertices": mesh.quantized.welded_vertices,
            "levels": len(mesh.level_vertices),
            "level_vertices": " ".join(map(str, mesh.level_vertices)),
            "level_bits": " ".join(str(mesh.quantized.bits - shift) for shift in mesh.level_shifts),
            "six_neighbours": mesh.regularity.six_neighbours,
            "edge_variation": mesh.regularity.edge_variation,
            "even": mesh.regularity.is_even,
        }
        for mesh in meshes
    ]


def rate_rows(mesh: MeshResult) -> list[Row]:
    """Sizes by scheme and filter, beside the published ones where the mesh is the paper's."""
    rows = []
    for scheme in SCHEMES:
        for name, found in mesh.filters.items():
            result = found.schemes[scheme]
            rows.append(
                {
                    "mesh": mesh.name,
                    "scheme": scheme,
                    "filter": name,
                    "coarsest": result.sizes.coarsest,
                    "coefficients": result.sizes.coefficients,
                    "differences": result.sizes.differences,
                    "total": result.sizes.total,
                    "rate": result.sizes.rate,
                    "shannon_rate": result.shannon_rate,
                    "fine_shannon_rate": result.fine_shannon_rate,
                    **_published_figures(mesh, scheme, name),
                }
            )
    return rows


def accuracy_rows(mesh: MeshResult) -> list[Row]:
    """Errors of the finest level without its Diff, by scheme and filter, in units of the cube."""
    return [
        {
            "mesh": mesh.name,
            "scheme": scheme,
            "filter": name,
            "mean": found.schemes[scheme].lost.mean,
            "rms": found.schemes[scheme].lost.rms,
            "largest_coordinate": found.schemes[scheme].lost.largest_coordinate,
            "largest_vertex": found.schemes[scheme].lost.largest_vertex,
            "surface_rms": found.surface.rms if scheme == "single" else None,
            "surface_hausdorff": found.surface.hausdorff if scheme == "single" else None,
        }
        for scheme in SCHEMES
        for name, found in mesh.filters.items()
    ]


def difference_rows(mesh: MeshResult) -> list[Row]:
    """The single resolution's Diffs: error, power law, rates."""
    rows = []
    for name, found in mesh.filters.items():
        rows.append(
            {
                "mesh": mesh.name,
                "filter": name,
                "l2_error": found.l2_error,
                "published_l2_error": _published_error(mesh, name),
                "alpha": found.alpha,
                "a": found.a,
                "gap": found.gap,
                "modelled_rate": found.modelled_rate,
                "shannon_rate": found.schemes["single"].shannon_rate,
                "coded_rate": 8 * found.schemes["single"].sizes.differences / len(mesh.quantized.positions),
            }
        )
    return rows


def norm_rows(mesh: MeshResult) -> list[Row]:
    """The norms of section 4, in units of the cube and bits per vertex."""
    return [
        {
            "mesh": mesh.name,
            "scheme": row.scheme,
            "degree": row.degree,
            "norm": row.norm,
            "mean": row.lost.mean,
            "rms": row.lost.rms,
            "largest_coordinate": row.lost.largest_coordinate,
            "largest_vertex": row.lost.largest_vertex,
            "total": row.total,
            "rate": row.rate,
            "shannon_rate": row.shannon_rate,
        }
        for row in mesh.norms
    ]


def noise_rows(mesh: MeshResult) -> list[Row]:
    """Perturbed Diffs by filter and level, finest first: root mean squares of a coordinate in units of the cube."""
    return [
        {
            "mesh": mesh.name,
            "filter": name,
            "level": level,
            "difference_rms": found.differences[level],
            "injected_rms": found.injected[level],
            "reconstructed_rms": found.reconstructed[level],
        }
        for name, found in mesh.noises.items()
        for level in range(len(found.differences))
    ]


def conclusion_rows(mesh: MeshResult) -> list[Row]:
    """Which of the paper's sentences hold for the mesh."""
    rows = []
    for number, sentence in enumerate(SENTENCES, start=1):
        finding = sentence.find(mesh)
        rows.append(
            {
                "mesh": mesh.name,
                "number": number,
                "section": sentence.section,
                "sentence": sentence.quote,
                "test": sentence.test,
                "holds": finding.holds,
                "figures": finding.figures,
            }
        )
    return rows


def histogram_rows(mesh: MeshResult) -> list[Row]:
    """How often each value of the single resolution's Diffs occurs, all coordinates together, and by the fitted law."""
    rows = []
    for name in PICTURED_FILTERS:
        found = mesh.filters[name]
        assert found.arrays is not None  # noqa: S101 - those of the pictured filters are kept
        law = PowerLaw(found.alpha, found.a)
        values, counts = np.unique(found.arrays.differences, return_counts=True)
        rows += [
            {
                "mesh": mesh.name,
                "filter": name,
                "difference": int(value),
                "count": int(count),
                "power_law_share": law.density(float(value)) if np.isfinite(law.a) else None,
            }
            for value, count in zip(values, counts, strict=True)
        ]
    return rows


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows of the same keys as a CSV file; what is None stays empty."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _published_error(mesh: MeshResult, name: str) -> float | None:
    """The printed l2 error per vertex in units of the cube."""
    published = mesh.published
    row = published.single.get(name) if published is not None else None
    if published is None or row is None or row.l2_error is None:
        return None
    return row.l2_error * published.l2_unit


def _published_figures(mesh: MeshResult, scheme: str, name: str) -> Row:
    """What is printed for this filter: all of four filters, and the rates of all degrees in multi-resolution."""
    published = mesh.published
    row = getattr(published, scheme).get(name) if published is not None else None
    rate = row.rate if row is not None else None
    if published is not None and scheme == "multi" and name.startswith("degree "):
        rate = published.degrees[int(name.removeprefix("degree ")) - 1]
    names = ("coarsest", "coefficients", "differences", "total")
    return {f"published_{field}": getattr(row, field) if row is not None else None for field in names} | {
        "published_rate": rate
    }
