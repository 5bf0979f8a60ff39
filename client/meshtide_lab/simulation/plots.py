"""Plots of a sweep: distortion over loss with 95 % intervals, and distortion over bytes; readable in grey."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

from meshtide_codec.extras import extra
from meshtide_codec.printable import shown
from meshtide_lab.link.loss import GilbertElliott, IndependentLoss
from meshtide_lab.link.syntax import parse_models
from meshtide_lab.simulation.summary import grouped, mean_interval

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

FIGURE = "matplotlib.figure"
BACKEND = "matplotlib.backends.backend_agg"
LIBRARIES = (FIGURE, BACKEND)
EXTRA = "lab"
DOTS_PER_INCH = 110
SMALLEST = 1e-9
"""Means below this, which are rounding errors of distances, are not drawn."""

BELOW = 0.2
"""The axis ends at this share of the least mean: intervals that reach zero have no end on a logarithmic axis."""

_STYLES = [
    {"color": color, "linestyle": line, "marker": marker}
    for (line, marker), color in zip(
        (("-", "o"), ("--", "s"), (":", "^"), ("-.", "D"), ("-", "v"), ("--", "x"), (":", "P"), ("-.", "*")),
        ("0.0", "0.35", "0.0", "0.35", "0.55", "0.0", "0.55", "0.35"),
        strict=True,
    )
]


def loss_distortion_plot(summary: Sequence[Mapping[str, Any]]) -> bytes:
    """RMS and largest distance over the mean loss, a line for each stream and family of links, as a PNG file.

    Links that differ in their rate of loss only are a family. The loss is the model's mean where a chain has one
    model of random loss, else the measured share of lost Diffs.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    meshes = grouped(summary, ["mesh"])
    figure = extra(FIGURE, EXTRA).Figure(figsize=(13, 0.6 + 5 * len(meshes)), layout="constrained")
    figure.suptitle("what is left of a mesh: mean over seeds and its 95 % interval")
    rows = figure.subplots(len(meshes), 2, squeeze=False)
    for axes_pair, mesh in zip(rows, meshes, strict=True):
        for axes, measure, label in zip(axes_pair, ("rms", "hausdorff"), ("RMS", "largest"), strict=True):
            lines: dict[str, list[tuple[float, float, float]]] = {}
            for row in mesh:
                family, loss = family_and_loss(row["loss"], row["lost_share"])
                if row[measure] > SMALLEST:
                    lines.setdefault(f"{row['stream']}, {family}", []).append(
                        (100 * loss, row[measure], row[f"{measure}_95"])
                    )
            _draw(axes, lines)
            axes.set_title(shown(mesh[0]["mesh"]), parse_math=False)
            axes.set_yscale("log")
            axes.set_xlabel("mean loss / per cent of packets")
            axes.set_ylabel(f"{label} distance of the surfaces / diagonal")
            _legend(axes, lines)
    return _png(figure)


def rate_distortion_plot(levels: Sequence[Mapping[str, Any]]) -> bytes:
    """RMS distance of each level over the bytes up to it, a line for each stream and link, as a PNG file.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    meshes = grouped(levels, ["mesh"])
    figure = extra(FIGURE, EXTRA).Figure(figsize=(13, 0.6 + 5 * len(meshes)), layout="constrained")
    figure.suptitle("distance of each level that is shown: mean over seeds and its 95 % interval")
    for axes, mesh in zip(figure.subplots(len(meshes), 1, squeeze=False).flat, meshes, strict=True):
        lines: dict[str, list[tuple[float, float, float]]] = {}
        for group in grouped(mesh, ["stream", "loss", "level"]):
            mean, half = mean_interval([row["rms"] for row in group])
            if mean > SMALLEST:
                name = f"{group[0]['stream']}, {group[0]['loss']}"
                lines.setdefault(name, []).append((group[0]["stream_bytes"], mean, half))
        _draw(axes, lines)
        axes.set_title(shown(mesh[0]["mesh"]), parse_math=False)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("bytes of the stream up to the level, before losses")
        axes.set_ylabel("RMS distance of the surfaces / diagonal")
        _legend(axes, lines)
    return _png(figure)


def family_and_loss(text: str, measured: float) -> tuple[str, float]:
    """A link without its rate of loss, and that rate.

    >>> family_and_loss("gilbert:loss=0.05,burst=10", 0.06)
    ('gilbert:burst=10', 0.05)
    >>> family_and_loss("noise:relative=1", 0.0)
    ('noise:relative=1', 0.0)
    """
    models = [model for model in parse_models(text) if isinstance(model, (IndependentLoss, GilbertElliott))]
    if len(models) != 1:
        return text, measured
    model = models[0]
    loss = model.rate if isinstance(model, IndependentLoss) else model.mean_loss
    pattern = r"(loss:)rate=[^,+\s]*,?" if isinstance(model, IndependentLoss) else r"(gilbert:)loss=[^,+\s]*,?"
    return re.sub(pattern, r"\1", text).rstrip(":, "), loss


def _draw(axes: Any, lines: Mapping[str, Sequence[tuple[float, float, float]]]) -> None:  # noqa: ANN401
    for place, (name, points) in enumerate(lines.items()):
        places, means, halves = zip(*sorted(points), strict=True)
        shown = [0.0 if half != half else min(half, 0.999 * mean) for mean, half in zip(means, halves, strict=True)]  # noqa: PLR0124
        axes.errorbar(
            places,
            means,
            yerr=[shown, [0.0 if half != half else half for half in halves]],  # noqa: PLR0124 - NaN: one run has none
            label=name,
            capsize=3,
            linewidth=1.1,
            markersize=5,
            markerfacecolor="white" if place % 2 else None,
            **_STYLES[place % len(_STYLES)],
        )
    axes.grid(visible=True, which="major", color="0.9")
    lowest = min((mean for points in lines.values() for _, mean, _ in points), default=1.0)
    axes.set_ylim(bottom=BELOW * lowest)


def _legend(axes: Any, lines: Mapping[str, Any]) -> None:  # noqa: ANN401
    if lines:
        axes.legend(fontsize="small")
    else:
        axes.annotate("no distances: nothing was lost", (0.5, 0.5), xycoords="axes fraction", ha="center")


def _png(figure: Any) -> bytes:  # noqa: ANN401
    extra(BACKEND, EXTRA).FigureCanvasAgg(figure)
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return picture.getvalue()
