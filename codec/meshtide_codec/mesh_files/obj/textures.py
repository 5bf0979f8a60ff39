"""Lines of an MTL file that name an image: `map_Kd -s 2 2 -o 0.5 0 wood grain.png`, taken apart and put together."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

WORDS = frozenset(
    {
        "map_kd",
        "map_ka",
        "map_ks",
        "map_ke",
        "map_ns",
        "map_d",
        "map_tr",
        "map_bump",
        "bump",
        "disp",
        "decal",
        "refl",
        "norm",
        "map_pr",
        "map_pm",
        "map_ps",
        "map_aat",
        "map_disp",
        "map_norm",
        "map_refl",
    }
)
"""The words, in lower case, that an image follows."""

_ARGUMENTS = {
    "-blendu": (1, 1),
    "-blendv": (1, 1),
    "-boost": (1, 1),
    "-bm": (1, 1),
    "-cc": (1, 1),
    "-clamp": (1, 1),
    "-imfchan": (1, 1),
    "-mm": (2, 2),
    "-o": (1, 3),
    "-s": (1, 3),
    "-t": (1, 3),
    "-texres": (1, 1),
    "-type": (1, 1),
}
"""Options, and how many values each may have: those of which there may be several are numbers."""

_WORD = re.compile(r"\s*(\S+)")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


@dataclass(frozen=True, slots=True)
class TextureLine:
    """A line that names an image.

    Args:
        before: all that stands before the name, the word and the options.
        name: of the image file, blanks in it included.
        options: values of the options by their names.
    """

    before: str
    name: str
    options: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def texture_line(line: str) -> TextureLine | None:
    """A line of an MTL file as one that names an image; None if it is none.

    >>> texture_line("map_Kd -s 2 2 wood grain.png").name
    'wood grain.png'
    >>> texture_line("Kd 1 0 0") is None
    True
    """
    word = _WORD.match(line)
    if word is None or word[1].lower() not in WORDS:
        return None
    at = word.end()
    options: dict[str, tuple[str, ...]] = {}
    while (option := _WORD.match(line, at)) is not None and option[1].lower() in _ARGUMENTS:
        least, most = _ARGUMENTS[option[1].lower()]
        at = option.end()
        values: list[str] = []
        while len(values) < most and (value := _WORD.match(line, at)) is not None:
            # A number may also begin the name: the last word is never taken.
            last = not line[value.end() :].strip()
            if (len(values) >= least and not _NUMBER.fullmatch(value[1])) or last:
                break
            values.append(value[1])
            at = value.end()
        options[option[1].lower()] = tuple(values)
    name = line[at:].strip()
    return TextureLine(line[:at].strip(), name, options) if name else None
