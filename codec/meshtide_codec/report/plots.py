"""The picture of a stream as a PNG file, and what pictures of states have in common.

Lines differ in dash and marker, bars in shade and hatch. Distances are drawn as steps: what is on the screen stays as
it is until a state that is closer is complete. Markers beside a line are states that are not, such as the first levels
behind a preview.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from meshtide_codec.extras import extra
from meshtide_codec.report.layers import HEADER, totals
from meshtide_codec.report.states import improving

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from meshtide_codec.report.layers import LayerBytes
    from meshtide_codec.report.states import StreamState

FIGURE = "matplotlib.figure"
BACKEND = "matplotlib.backends.backend_agg"
LIBRARIES = (FIGURE, BACKEND)
DOTS_PER_INCH = 120
EXACT_FLOOR = 0.4
"""Exact states, which a logarithmic axis cannot show, are drawn at so many times the least distance of all others."""

SOLID = {"color": "black", "linestyle": "-", "marker": "o"}
DASHED = {"color": "0.45", "linestyle": "--", "marker": "s"}
DOTTED = {"color": "0.6", "linestyle": ":", "marker": "^"}
_SHADES = (("0.15", ""), ("0.85", "//"), ("0.45", ""), ("0.7", "\\\\"), ("0.95", ""), ("0.3", ".."), ("0.6", "xx"))


def stream_plot(title: str, rows: Sequence[LayerBytes], states: Sequence[StreamState]) -> bytes:
    """Bytes of each level by layer on the left, distance against bytes on the right.

    Args:
        title: of the picture.
        rows: of `layers.layer_bytes`.
        states: of the stream.

    Returns:
        A PNG file.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    figure = extra(FIGURE).Figure(figsize=(12, 5), layout="constrained")
    figure.suptitle(title, parse_math=False)
    left, right = figure.subplots(1, 2)
    _draw_layers(left, rows)
    floor = min(exact_floor([states], "rms"), exact_floor([states], "maximum"))
    draw_curve(right, states, "rms", floor, {"label": "RMS"} | SOLID)
    draw_curve(right, states, "maximum", floor, {"label": "maximum"} | DASHED)
    finish(right, "distance / diagonal", floor)
    return png_file(figure)


def draw_curve(axes: Any, states: Sequence[StreamState], field: str, floor: float, style: Mapping[str, Any]) -> None:  # noqa: ANN401
    """Draw states as steps, and those that are not closer than all before them as markers.

    Args:
        axes: of matplotlib.
        states: in the order in which they are complete.
        field: "rms" or "maximum".
        floor: where exact states are drawn.
        style: of the line, with its label.
    """
    shown = improving(states)
    for drawn, look in (
        (shown, {"drawstyle": "steps-post", "linewidth": 1.2, **style}),
        ([state for state in states if state not in shown], {**style, "label": None, "linestyle": ""}),
    ):
        distances = [getattr(state, field) or floor for state in drawn]
        axes.plot([state.size for state in drawn], distances, markersize=4, **look)


def _draw_layers(axes: Any, rows: Sequence[LayerBytes]) -> None:  # noqa: ANN401
    levels = list(dict.fromkeys(row.level for row in rows))
    labels = [HEADER.lower() if level is None else f"level {level}" for level in levels]
    starts = [0] * len(levels)
    for (layer, size), (shade, hatch) in zip(totals(rows).items(), _SHADES, strict=False):
        sums = [sum(row.size for row in rows if row.level == level and row.layer == layer) for level in levels]
        name = f"{layer}, {size} bytes"
        axes.barh(labels, sums, left=starts, color=shade, hatch=hatch, edgecolor="black", linewidth=0.5, label=name)
        starts = [start + more for start, more in zip(starts, sums, strict=True)]
    axes.invert_yaxis()
    axes.set_xlabel("bytes")
    axes.legend()


def finish(axes: Any, label: str, floor: float) -> None:  # noqa: ANN401
    """Label the axes of distances against bytes, and mark where exact states are."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("bytes from the start")
    axes.set_ylabel(label)
    axes.grid(visible=True, which="major", color="0.9")
    axes.axhline(floor, color="0.5", linewidth=0.6)
    axes.annotate("exact", (0.01, floor), xycoords=("axes fraction", "data"), va="bottom", fontsize="small")
    axes.legend()


def exact_floor(curves: Iterable[Sequence[StreamState]], field: str) -> float:
    """Where exact states are drawn, which a logarithmic axis cannot show."""
    distances = [getattr(state, field) for states in curves for state in states]
    return EXACT_FLOOR * min((distance for distance in distances if distance > 0), default=1.0)


def png_file(figure: Any) -> bytes:  # noqa: ANN401
    """A figure as a PNG file, of the same bytes each time.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    extra(BACKEND).FigureCanvasAgg(figure)
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return picture.getvalue()
