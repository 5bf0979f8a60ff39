"""Semilogarithmic histograms of the Diffs with the fitted power law, as in figs. 3, 7, 11, 15 and 19; and rates."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.extras import extra
from meshtide_codec.printable import shown
from meshtide_codec.statistics import PowerLaw
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS

if TYPE_CHECKING:
    from meshtide_lab.paper.mesh_result import MeshResult

FIGURE = "matplotlib.figure"
BACKEND = "matplotlib.backends.backend_agg"
LIBRARIES = (FIGURE, BACKEND)
EXTRA = "lab"
DOTS_PER_INCH = 100
SHOWN_SHARE = 0.995
"""The axis ends where this share of all Diffs, of the four filters together, lies inside."""

MOST_BINS = 121
_CURVE_POINTS = 400
_LINES = {
    "zeroth": {"color": "0.6", "linestyle": ":", "marker": "s"},
    "gaussian": {"color": "0.45", "linestyle": "--", "marker": "^"},
    "polynomial": {"color": "black", "linestyle": "-", "marker": "o"},
}


def histogram_plot(mesh: MeshResult) -> bytes:
    """Four histograms of the single resolution's Diffs, all coordinates together, as a PNG file.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    figure = extra(FIGURE, EXTRA).Figure(figsize=(11, 7.5), layout="constrained")
    title = f"{shown(mesh.name)}: Diffs of the single resolution scheme and fitted power law"
    figure.suptitle(title, parse_math=False)
    magnitudes = np.concatenate([np.abs(_differences(mesh, name)) for name in PICTURED_FILTERS])
    reach = max(1, int(np.quantile(magnitudes, SHOWN_SHARE)))
    width = -(-(2 * reach + 1) // MOST_BINS)
    bins = reach // width
    edges = (np.arange(-bins, bins + 2) - 0.5) * width
    for axes, name in zip(figure.subplots(2, 2, sharex=True, sharey=True).flat, PICTURED_FILTERS, strict=True):
        differences = _differences(mesh, name)
        shares = np.histogram(differences, edges)[0] / len(differences) / width
        axes.bar((edges[:-1] + edges[1:]) / 2, shares, width, color="0.75", edgecolor="0.55", linewidth=0.3)
        _draw_law(axes, mesh, name, edges)
        axes.set_yscale("log")
        axes.set_ylim(0.3 / len(differences), 1.0)
        axes.set_title(name)
    figure.supxlabel("Diff of a coordinate / finest steps")
    figure.supylabel("share of all Diffs per step")
    return _png(figure)


def rate_plot(mesh: MeshResult) -> bytes:
    """Rates by degree in both schemes, with those of zeroth order and Gaussian filters as lines, as a PNG file.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    figure = extra(FIGURE, EXTRA).Figure(figsize=(11, 4.3), layout="constrained")
    degrees = [int(name.removeprefix("degree ")) for name in mesh.filters if name.startswith("degree ")]
    for axes, (scheme, title) in zip(
        figure.subplots(1, 2), (("multi", "multi-resolution"), ("single", "single resolution")), strict=True
    ):
        rates = {name: found.schemes[scheme].sizes.rate for name, found in mesh.filters.items()}
        for name in ("zeroth", "gaussian"):
            axes.plot(degrees, [rates[name]] * len(degrees), label=name, markersize=3, **_LINES[name])
        values = [rates[f"degree {degree}"] for degree in degrees]
        axes.plot(degrees, values, label="least squares", markersize=5, **_LINES["polynomial"])
        published = mesh.published
        if published is not None and scheme == "multi":
            axes.plot(degrees, published.degrees, "x", color="black", label="least squares, published")
        axes.set_title(f"{shown(mesh.name)}, {title}", parse_math=False)
        axes.set_xlabel("degree")
        axes.set_ylabel("geometry / bits per vertex")
        axes.grid(visible=True, color="0.9")
        if scheme == "multi":
            figure.legend(loc="outside lower center", ncols=4)
    return _png(figure)


def _differences(mesh: MeshResult, name: str) -> np.ndarray:
    arrays = mesh.filters[name].arrays
    assert arrays is not None  # noqa: S101 - those of the pictured filters are kept
    return arrays.differences.ravel()


def _draw_law(axes: Any, mesh: MeshResult, name: str, edges: np.ndarray) -> None:  # noqa: ANN401
    found = mesh.filters[name]
    law = PowerLaw(found.alpha, found.a)
    if not np.isfinite(law.a):
        return
    places = np.linspace(edges[0], edges[-1], _CURVE_POINTS)
    densities = [law.density(float(place)) for place in places]
    axes.plot(places, densities, color="black", linewidth=1.2, label=f"power law, alpha = {law.alpha:.2f}")
    axes.legend(loc="upper right")


def _png(figure: Any) -> bytes:  # noqa: ANN401
    extra(BACKEND, EXTRA).FigureCanvasAgg(figure)
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return picture.getvalue()
