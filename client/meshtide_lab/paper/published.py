"""The published figures of section 5, from published.json: tables 3 to 17, as printed."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

SPHERE = "sphere"


@dataclass(frozen=True, slots=True)
class PublishedRow:
    """One column of a printed table.

    Args:
        coarsest: bytes of the coarsest mesh.
        coefficients: bytes of the coefficients.
        differences: bytes of the Diffs.
        total: bytes.
        rate: bits per vertex.
        l2_error: l2 norm of the Diffs per vertex, in `PublishedMesh.l2_unit` of the unit cube; None where not printed.
    """

    coarsest: int
    coefficients: int
    differences: int
    total: int
    rate: float
    l2_error: float | None = None


@dataclass(frozen=True, slots=True)
class PublishedMesh:
    """What is printed about one mesh.

    Args:
        name: of the mesh.
        description: what it looks like.
        vertices: of the finest level.
        faces: of the finest level, None where not printed.
        levels: how many.
        coarsest_vertices: of the coarsest level.
        multi_table: number of the table of the basic algorithm.
        multi: its columns by filter.
        degree_table: number of the table by degree.
        degrees: bits per vertex of degrees 1 to 7.
        single_table: number of the table of the single resolution variant.
        l2_unit: what one unit of `PublishedRow.l2_error` stands for.
        single: its columns by filter.
    """

    name: str
    description: str
    vertices: int
    faces: int | None
    levels: int
    coarsest_vertices: int
    multi_table: int
    multi: dict[str, PublishedRow]
    degree_table: int
    degrees: tuple[float, ...]
    single_table: int
    l2_unit: float
    single: dict[str, PublishedRow]


@dataclass(frozen=True, slots=True)
class Published:
    """All published figures.

    Args:
        source: where they are printed.
        remarks: on what is printed.
        meshes: by name.
    """

    source: str
    remarks: tuple[str, ...]
    meshes: dict[str, PublishedMesh]


@cache
def published() -> Published:
    """The published figures.

    >>> published().meshes["sphere"].multi["degree 3"].rate
    11.28
    """
    text = resources.files(__package__).joinpath("published.json").read_text(encoding="utf-8")
    document = json.loads(text)
    meshes = {}
    for name, entry in document["meshes"].items():
        fields: dict[str, Any] = dict(entry, name=name, degrees=tuple(entry["degrees"]))
        for scheme in ("multi", "single"):
            fields[scheme] = {filter_name: PublishedRow(**row) for filter_name, row in entry[scheme].items()}
        meshes[name] = PublishedMesh(**fields)
    return Published(document["source"], tuple(document["remarks"]), meshes)


def published_mesh(name: str) -> PublishedMesh | None:
    """The figures of the mesh that is the paper's own under this name; None for all others.

    >>> published_mesh("fandisk") is None
    True
    """
    return published().meshes.get(SPHERE) if name == SPHERE else None
