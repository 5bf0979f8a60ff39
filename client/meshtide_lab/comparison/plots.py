"""The picture of a comparison, as a PNG file: distance against bytes, as `meshtide_codec.report.plots` draws it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.extras import extra
from meshtide_codec.report.plots import DASHED, DOTTED, FIGURE, SOLID, draw_curve, exact_floor, finish, png_file
from meshtide_lab.comparison.mesh_comparison import FITTED_LADDER, LADDER, MESHTIDE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from meshtide_codec.report.states import StreamState

_LINES = {MESHTIDE: SOLID, LADDER: DASHED, FITTED_LADDER: DOTTED}


def comparison_plot(title: str, curves: Mapping[str, Sequence[StreamState]], draco_bytes: int | None) -> bytes:
    """Distance against bytes of all candidates: RMS on the left, maximum on the right.

    Args:
        title: of the picture.
        curves: states by candidate.
        draco_bytes: size of the single Draco file, marked by a line; None if there is none.

    Returns:
        A PNG file.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    figure = extra(FIGURE).Figure(figsize=(12, 5), layout="constrained")
    figure.suptitle(title, parse_math=False)
    for axes, field, name in zip(
        figure.subplots(1, 2), ("rms", "maximum"), ("RMS distance", "maximum distance"), strict=True
    ):
        floor = exact_floor(curves.values(), field)
        for candidate, states in curves.items():
            draw_curve(axes, states, field, floor, {"label": candidate} | _LINES[candidate])
        if draco_bytes is not None:
            axes.axvline(draco_bytes, color="0.3", linestyle="-.", linewidth=1, label="Draco: one file")
        finish(axes, f"{name} / diagonal", floor)
    return png_file(figure)
