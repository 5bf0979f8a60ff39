"""Small multiples: pictures of meshes side by side, each with its caption, and the legend of their colours below."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import OptionError
from meshtide_codec.rendering.lettering import ROWS, Image, draw_text, text_width
from meshtide_codec.rendering.png import png
from meshtide_codec.rendering.rasterizer import PAPER, render
from meshtide_codec.rendering.view import Framing, View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_codec.mesh import Mesh
    from meshtide_codec.rendering.colour_scale import ColourScale

TILE = 360
COLUMNS = 3
_CAPTION = 28
_LEGEND = 66
_BAR = 14
_INK = (60, 60, 64)
_LARGE_LETTERS = 2


@dataclass(frozen=True, slots=True)
class Style:
    """How meshes are drawn.

    Args:
        view: from where.
        size: width and height of each in pixels.
        columns: how many stand side by side.
        smooth: whether faces are shaded smoothly.
        edges: whether edges are drawn.
    """

    view: View = field(default_factory=View)
    size: int = TILE
    columns: int = COLUMNS
    smooth: bool = False
    edges: bool = False

    def __post_init__(self) -> None:
        if self.columns < 1:
            raise OptionError(f"a picture needs at least one column, not {self.columns}")


@dataclass(frozen=True, slots=True)
class Subject:
    """A mesh to draw, what to write below it, and the values (n,) that colour its vertices, if any."""

    caption: str
    mesh: Mesh
    values: NDArray[np.float64] | None = None


def levels_picture(captioned: Sequence[tuple[str, Mesh]]) -> bytes:
    """Levels side by side, all in the scale of the last, as a PNG file."""
    subjects = [Subject(caption, mesh) for caption, mesh in captioned]
    return png(draw_subjects(subjects, captioned[-1][1]))


def draw_subjects(
    subjects: Sequence[Subject],
    framed: Mesh | None = None,
    scale: ColourScale | None = None,
    style: Style | None = None,
) -> Image:
    """One tile a subject.

    Args:
        subjects: at least one.
        framed: the mesh whose place and scale all are drawn in; None for each its own.
        scale: the colours of the values; its legend is drawn below.
        style: how to draw.

    Returns:
        (h, w, 3) uint8.

    Raises:
        OptionError: there is nothing to draw, or values without a scale or of another length.
    """
    style = style or Style()
    if not subjects:
        raise OptionError("there is no mesh to draw")
    tiles = []
    for subject in subjects:
        frame = Framing.fitting(framed or subject.mesh, style.view)
        tiles.append((subject.caption, _tile(subject, frame, scale, style)))
    return sheet(tiles, style.columns, scale)


def sheet(tiles: Sequence[tuple[str, Image]], columns: int = COLUMNS, scale: ColourScale | None = None) -> Image:
    """Pictures (s, s, 3) of one size side by side, captions below each, a legend below all."""
    size = len(tiles[0][1])
    columns = min(columns, len(tiles))
    rows = -(-len(tiles) // columns)
    height = rows * (size + _CAPTION)
    whole = np.empty((height + (_LEGEND if scale is not None else 0), columns * size, 3), np.uint8)
    whole[:] = PAPER
    for i, (caption, image) in enumerate(tiles):
        top, left = i // columns * (size + _CAPTION), i % columns * size
        whole[top : top + size, left : left + size] = image
        _centred(whole[:, left : left + size], caption, size // 2, top + size + _CAPTION // 2)
    if scale is not None:
        _draw_legend(whole[height:], scale)
    return whole


def _tile(subject: Subject, frame: Framing, scale: ColourScale | None, style: Style) -> Image:
    colours = None
    if subject.values is not None:
        if scale is None:
            raise OptionError("values need a colour scale")
        if subject.values.shape != (len(subject.mesh.vertices),):
            raise OptionError(f"{subject.mesh} needs one value per vertex, not {subject.values.shape}")
        colours = scale.colours(subject.values)
    return render(subject.mesh, frame, style.size, colours=colours, smooth=style.smooth, edges=style.edges)


def _draw_legend(strip: Image, scale: ColourScale) -> None:
    """A bar of all colours in the middle half, its ends and middle in numbers, and the label."""
    width = strip.shape[1]
    left, right = width // 4, width - width // 4
    bar = scale.colours(np.linspace(scale.low, scale.high, right - left))
    strip[6 : 6 + _BAR, left:right] = np.rint(bar).astype(np.uint8)
    for share in (0.0, 0.5, 1.0):
        value = scale.low + share * (scale.high - scale.low)
        place = left + round(share * (right - left - 1))
        strip[6 + _BAR : 10 + _BAR, place] = _INK
        _centred(strip, f"{value:.3g}", place, 19 + _BAR)
    _centred(strip, scale.label, width // 2, 39 + _BAR)


def _centred(image: Image, text: str, middle: int, line: int) -> None:
    """Write `text` around a column and a row, in large letters where they fit."""
    size = _LARGE_LETTERS if text_width(text, _LARGE_LETTERS) <= image.shape[1] else 1
    left = max(0, middle - text_width(text, size) // 2)
    draw_text(image, text, left, line - ROWS * size // 2, scale=size, colour=_INK)
