"""From the options of `meshtide encode` to those of a profile; an option of the other profile is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.errors import OptionError
from meshtide_codec.filters import FilterSpec
from meshtide_codec.grid import Grid

if TYPE_CHECKING:
    from collections.abc import Mapping

PROFILES = ("compact", "classic")
FILTER_FIELDS = {"filter": "kind", "degree": "degree", "basis": "basis", "norm": "norm"}

_OWN_NAMES = {"variable_from": "-S", "sent_levels": "--diff-levels"}
"""Options whose names on the command line are not those of their fields."""


def profile_options(
    profile: str, bits: int, compact: Mapping[str, Any], classic: Mapping[str, Any]
) -> CompactOptions | ClassicOptions:
    """The options of `profile`.

    Args:
        profile: "compact" or "classic".
        bits: B.
        compact: options of the compact profile by name; None where the person said nothing.
        classic: the same of the classic profile.

    Raises:
        OptionError: an unknown profile, an option of the other profile, or a value out of range.

    >>> profile_options("compact", 10, {"slices": 4}, {"degree": None}).slices
    4
    """
    if profile not in PROFILES:
        raise OptionError(f"--profile is {' or '.join(PROFILES)}, not {profile!r}")
    chosen, other = (compact, classic) if profile == "compact" else (classic, compact)
    foreign = [option_name(name) for name, value in other.items() if value is not None]
    if foreign:
        wanted = PROFILES[1 - PROFILES.index(profile)]
        verb = "belongs" if len(foreign) == 1 else "belong"
        raise OptionError(f"{' and '.join(foreign)} {verb} to profile {wanted}; add --profile {wanted}")
    given = {name: value for name, value in chosen.items() if value is not None}
    if profile == "compact":
        if "previews" in given:
            given["previews"] = () if given["previews"] == "none" else number_list(given["previews"])
        return CompactOptions(bits=bits, **given)
    spec = {field: given.pop(name) for name, field in FILTER_FIELDS.items() if name in given}
    if "sent_levels" in given:
        given["sent_levels"] = frozenset(number_list(given["sent_levels"]))
    return ClassicOptions(bits=bits, filter=FilterSpec(**spec), **given)


def option_name(name: str) -> str:
    """How an option of a profile is written on the command line.

    >>> option_name("degree"), option_name("variable_from"), option_name("coarsest_vertices")
    ('--degree', '-S', '--coarsest-vertices')
    """
    return _OWN_NAMES.get(name, f"--{name.replace('_', '-')}")


def chosen_grid(origin: str | None, extent: float | None, step: float | None, bits: int | None) -> Grid | None:
    """The grid that --origin, --extent and --step describe; None where the person said nothing of it.

    Raises:
        OptionError: a value that makes no sense, or a step beside B.

    >>> chosen_grid("0,0,-1.5", 100.0, None, 12)
    Grid(origin=(0.0, 0.0, -1.5), extent=100.0, step=None)
    """
    if step is not None and bits is not None:
        raise OptionError("--step decides how many bits there are, and so does -B; give one of them")
    if origin is None and extent is None and step is None:
        return None
    try:
        x, y, z = (None, None, None) if origin is None else (float(part) for part in origin.split(","))
    except ValueError as error:
        raise OptionError(f"--origin is written like 0,0,-1.5, not {origin!r}") from error
    place = None if x is None or y is None or z is None else (x, y, z)
    return Grid(place, extent, step)


def number_list(text: str) -> tuple[int, ...]:
    """Numbers written like 0,2,3.

    Raises:
        OptionError: anything else.
    """
    try:
        return tuple(int(part) for part in text.split(",") if part.strip())
    except ValueError as error:
        raise OptionError(f"a list of numbers is written like 0,2,3, not {text!r}") from error
