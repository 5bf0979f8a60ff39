"""What is encoded for a sweep: profiles x filters x norms x S x slices, each combination once."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.errors import OptionError
from meshtide_codec.filters import FIXED_DEGREES, FilterSpec

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_codec.profile import Profile

PROFILES = ("classic", "compact")


@dataclass(frozen=True, slots=True)
class Variant:
    """One way to encode a mesh, and what the tables call it.

    Args:
        profile: classic or compact.
        filter: name of the filter, empty in profile compact.
        variable_from: S of the variable length algorithm, 0 for the basic one.
        slices: parts of each Diff, 1 in profile classic.
        options: for the encoder; None for a stream that is encoded already.
    """

    profile: str
    filter: str
    variable_from: int
    slices: int
    options: Profile | None

    @property
    def label(self) -> str:
        """A short name."""
        parts = [self.profile, self.filter]
        if self.variable_from:
            parts.append(f"S={self.variable_from}")
        if self.profile == "compact":
            parts.append(f"{self.slices} slice{'s' if self.slices > 1 else ''}")
        return " ".join(part for part in parts if part)


def make_variants(
    profiles: Sequence[str],
    filters: Sequence[str],
    norms: Sequence[float],
    variable_from: Sequence[int],
    slices: Sequence[int],
    bits: int,
) -> list[Variant]:
    """All combinations, in the order of the arguments; those that act alike once.

    Args:
        profiles: of `PROFILES`.
        filters: zeroth, gaussian, taubin, or degree-1, degree-2 and so on; for profile classic.
        norms: p of fitted filters, 1 to 2 or infinity.
        variable_from: values of S, 0 for the basic algorithm.
        slices: numbers of slices, for profile compact.
        bits: B.

    Raises:
        OptionError: an unknown profile or filter, or a value out of range.

    >>> found = make_variants(["classic", "compact"], ["zeroth", "degree-2"], [2], [0], [1, 8], 12)
    >>> [variant.label for variant in found]
    ['classic zeroth', 'classic degree-2', 'compact 1 slice', 'compact 8 slices']
    """
    found: dict[Profile, Variant] = {}
    for profile in profiles:
        if profile not in PROFILES:
            raise OptionError(f"profile {profile!r} is not one of {', '.join(PROFILES)}")
        if profile == "compact":
            for count in slices:
                compact = CompactOptions(bits=bits, slices=count)
                found.setdefault(compact, Variant(profile, "", 0, count, compact))
            continue
        for name in filters:
            for norm in norms:
                spec = filter_spec(name, norm)
                suffix = "" if spec.norm == 2 or spec.kind in FIXED_DEGREES else f" l{spec.norm:g}"
                for start in variable_from:
                    classic = ClassicOptions(bits=bits, filter=spec, variable_from=start or None)
                    found.setdefault(classic, Variant(profile, f"{name}{suffix}", start, 1, classic))
    return list(found.values())


def filter_spec(name: str, norm: float = 2.0) -> FilterSpec:
    """The filter of that name.

    Raises:
        OptionError: there is none.

    >>> filter_spec("degree-3", math.inf).norm
    inf
    """
    if name in FIXED_DEGREES:
        return FilterSpec(name)  # type: ignore[arg-type]
    degree = re.fullmatch(r"degree-(\d{1,2})", name)
    if degree is None:
        raise OptionError(f"filter {name!r} is not zeroth, gaussian, taubin, or degree-N such as degree-3")
    return FilterSpec("polynomial", degree=int(degree[1]), norm=norm)


def parse_norm(text: str) -> float:
    """A norm's p: a number or inf.

    Raises:
        OptionError: anything else.
    """
    try:
        norm = math.inf if text == "inf" else float(text)
    except ValueError:
        raise OptionError(f"a norm is a number from 1 to 2, or inf, not {text!r}") from None
    FilterSpec("polynomial", norm=norm)
    return norm
