"""Pictures of a comparison and of a stream, as PNG files; lines differ in dash and marker, bars in shade and hatch.

Distances are drawn as steps: what is on the screen stays as it is until a state that is closer is complete. Markers
beside a line are states that are not, such as the first levels behind a preview.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from meshtide_codec.comparison.extras import extra
from meshtide_codec.comparison.layers import HEADER, totals
from meshtide_codec.comparison.mesh_comparison import FITTED_LADDER, LADDER, MESHTIDE
from meshtide_codec.comparison.states import improving

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from meshtide_codec.comparison.layers import LayerBytes
    from meshtide_codec.comparison.states import State

FIGURE = "matplotlib.figure"
BACKEND = "matplotlib.backends.backend_agg"
LIBRARIES = (FIGURE, BACKEND)
DOTS_PER_INCH = 120
EXACT_FLOOR = 0.4
"""Exact states, which a logarithmic axis cannot show, are drawn at so many times the least distance of all others."""

_LINES = {
    MESHTIDE: {"color": "black", "linestyle": "-", "marker": "o"},
    LADDER: {"color": "0.45", "linestyle": "--", "marker": "s"},
    FITTED_LADDER: {"color": "0.6", "linestyle": ":", "marker": "^"},
}
_SHADES = (("0.15", ""), ("0.85", "//"), ("0.45", ""), ("0.7", "\\\\"), ("0.95", ""), ("0.3", ".."), ("0.6", "xx"))


def comparison_plot(title: str, curves: Mapping[str, Sequence[State]], draco_bytes: int | None) -> bytes:
    """Distance against bytes of all candidates: RMS on the left, maximum on the right.

    Args:
        title: of the picture.
        curves: states by candidate.
        draco_bytes: size of the single Draco file, marked by a line; None if there is none.

    Returns:
        A PNG file.

    Raises:
        MeshtideError: matplotlib is not installed.
    """
    figure = extra(FIGURE).Figure(figsize=(12, 5), layout="constrained")
    figure.suptitle(title, parse_math=False)
    for axes, field, name in zip(
        figure.subplots(1, 2), ("rms", "maximum"), ("RMS distance", "maximum distance"), strict=True
    ):
        floor = _floor(curves.values(), field)
        for candidate, states in curves.items():
            _draw_curve(axes, states, field, floor, {"label": candidate} | _LINES[candidate])
        if draco_bytes is not None:
            axes.axvline(draco_bytes, color="0.3", linestyle="-.", linewidth=1, label="Draco: one file")
        _finish(axes, f"{name} / diagonal", floor)
    return _png(figure)


def stream_plot(title: str, rows: Sequence[LayerBytes], states: Sequence[State]) -> bytes:
    """Bytes of each level by layer on the left, distance against bytes on the right.

    Args:
        title: of the picture.
        rows: of `layers.layer_bytes`.
        states: of the stream.

    Returns:
        A PNG file.

    Raises:
        MeshtideError: matplotlib is not installed.
    """
    figure = extra(FIGURE).Figure(figsize=(12, 5), layout="constrained")
    figure.suptitle(title, parse_math=False)
    left, right = figure.subplots(1, 2)
    _draw_layers(left, rows)
    floor = min(_floor([states], "rms"), _floor([states], "maximum"))
    _draw_curve(right, states, "rms", floor, {"label": "RMS"} | _LINES[MESHTIDE])
    _draw_curve(right, states, "maximum", floor, {"label": "maximum"} | _LINES[LADDER])
    _finish(right, "distance / diagonal", floor)
    return _png(figure)


def _draw_curve(axes: Any, states: Sequence[State], field: str, floor: float, style: Mapping[str, Any]) -> None:  # noqa: ANN401
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


def _finish(axes: Any, label: str, floor: float) -> None:  # noqa: ANN401
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("bytes from the start")
    axes.set_ylabel(label)
    axes.grid(visible=True, which="major", color="0.9")
    axes.axhline(floor, color="0.5", linewidth=0.6)
    axes.annotate("exact", (0.01, floor), xycoords=("axes fraction", "data"), va="bottom", fontsize="small")
    axes.legend()


def _floor(curves: Any, field: str) -> float:  # noqa: ANN401
    distances = [getattr(state, field) for states in curves for state in states]
    return EXACT_FLOOR * min((distance for distance in distances if distance > 0), default=1.0)


def _png(figure: Any) -> bytes:  # noqa: ANN401
    extra(BACKEND).FigureCanvasAgg(figure)
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return picture.getvalue()
