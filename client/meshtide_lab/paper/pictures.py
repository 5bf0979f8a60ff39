"""Pictures of one mesh: finest and coarsest level, predictions without Diffs, and where they are wrong.

As figs. 1, 5, 9, 13, 17 (levels), 2, 6, 10, 14, 18 (predictions) and 4, 8, 12, 16, 20 (errors) of the paper. Colours
are errors divided by the mean error of their filter, as there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic.hierarchy import cell_centres, hierarchy_of
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import grid_steps
from meshtide_codec.rendering.colour_scale import ColourScale
from meshtide_codec.rendering.picture import Style, Subject, draw_subjects
from meshtide_codec.rendering.png import png
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS

if TYPE_CHECKING:
    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_lab.paper.experiment import Arrays
    from meshtide_lab.paper.mesh_result import MeshResult

STYLE = Style(size=440, columns=2)
ERRORS = ColourScale(0.0, 3.0, "error of a vertex / mean error of its filter")


def levels_picture(mesh: MeshResult, options: ClassicOptions) -> bytes:
    """The finest and the coarsest level as a PNG file."""
    quantized = mesh.quantized
    coarsest = hierarchy_of(quantized, options)[-1]
    finest = _mesh(mesh, quantized.positions.astype(np.float64))
    coarse = Mesh(cell_centres(coarsest.cells, coarsest.shift), coarsest.faces.astype(np.int64))
    subjects = [
        Subject(f"finest: {len(finest.vertices)} vertices", finest),
        Subject(f"coarsest: {len(coarse.vertices)} vertices", coarse),
    ]
    return png(draw_subjects(subjects, finest, style=STYLE))


def predictions_picture(mesh: MeshResult) -> bytes:
    """The finest level as the four filters predict it from the coarsest, no Diff sent, as a PNG file."""
    subjects = [Subject(name, _mesh(mesh, _arrays(mesh, name).prediction)) for name in PICTURED_FILTERS]
    finest = _mesh(mesh, mesh.quantized.positions.astype(np.float64))
    return png(draw_subjects(subjects, finest, style=STYLE))


def errors_picture(mesh: MeshResult) -> bytes:
    """The finest level, coloured by the size of the single resolution's Diffs of the four filters, as a PNG file."""
    finest = _mesh(mesh, mesh.quantized.positions.astype(np.float64))
    subjects = []
    for name in PICTURED_FILTERS:
        sizes = np.linalg.norm(_arrays(mesh, name).differences.astype(np.float64), axis=1)
        mean = float(sizes.mean())
        caption = f"{name}: mean {mean / grid_steps(mesh.quantized.bits):.4f}"
        subjects.append(Subject(caption, finest, sizes / (mean or 1.0)))
    return png(draw_subjects(subjects, finest, ERRORS, STYLE))


def _mesh(mesh: MeshResult, positions: np.ndarray) -> Mesh:
    return Mesh(positions, mesh.quantized.faces.astype(np.int64))


def _arrays(mesh: MeshResult, name: str) -> Arrays:
    arrays = mesh.filters[name].arrays
    assert arrays is not None  # noqa: S101 - those of the pictured filters are kept
    return arrays
