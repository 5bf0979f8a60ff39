"""Options of the classic profile: what a person chooses, and what of it the decoder is told in the header."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from meshtide_codec.errors import ContainerError, OptionError
from meshtide_codec.filters import FilterSpec
from meshtide_codec.quantize import DEFAULT_B, LARGEST_B, SMALLEST_B
from meshtide_codec.stream import plain_values

if TYPE_CHECKING:
    from collections.abc import Mapping

PROFILE = "classic"
DEFAULT_COARSEST_VERTICES = 300
DEFAULT_MINIMUM_RATIO = 1.5


@dataclass(frozen=True)
class ClassicOptions:
    """How a mesh is encoded in the classic profile.

    Args:
        bits: B, quantization bits per coordinate, 4 to 20.
        drop_bits: K, bits per coordinate that each level drops (paper, section 3).
        minimum_ratio: a level is skipped when the next finer one has fewer than this many times its vertices.
        coarsest_vertices: the hierarchy ends at the first level with at most so many vertices.
        filter: the predictor.
        variable_from: S of the variable length algorithm (section 3.2): levels S-1 to 1 send no Diff, level 0 does.
            Every S from the number of levels on gives the single resolution variant; None or 1 the basic algorithm.
        sent_levels: the very levels whose Diffs are sent, in place of `variable_from`.

    Raises:
        OptionError: a value outside its range, or both ways to choose levels at once.
    """

    bits: int = DEFAULT_B
    drop_bits: int = 1
    minimum_ratio: float = DEFAULT_MINIMUM_RATIO
    coarsest_vertices: int = DEFAULT_COARSEST_VERTICES
    filter: FilterSpec = field(default_factory=FilterSpec)
    variable_from: int | None = None
    sent_levels: frozenset[int] | None = None

    def __post_init__(self) -> None:
        if not SMALLEST_B <= self.bits <= LARGEST_B:
            raise OptionError(f"B must be {SMALLEST_B}..{LARGEST_B} bits per coordinate, not {self.bits}")
        if not 1 <= self.drop_bits <= self.bits:
            raise OptionError(f"K, the bits that a level drops, must be 1..{self.bits}, not {self.drop_bits}")
        if not self.minimum_ratio >= 1.0:
            raise OptionError(f"the minimum collapse ratio must be at least 1, not {self.minimum_ratio}")
        if self.coarsest_vertices < 1:
            raise OptionError(f"the coarsest level needs at least 1 vertex, not {self.coarsest_vertices}")
        if self.variable_from is not None and self.sent_levels is not None:
            raise OptionError("give either S or the levels whose Diffs are sent, not both")
        if self.variable_from is not None and self.variable_from < 1:
            raise OptionError(f"S must be at least 1, not {self.variable_from}")

    def levels_with_diff(self, level_count: int) -> frozenset[int]:
        """Which of `level_count` levels send a Diff (the coarsest never does: it is sent whole).

        >>> sorted(ClassicOptions(variable_from=3).levels_with_diff(6))
        [0, 3, 4]
        >>> sorted(ClassicOptions(variable_from=6).levels_with_diff(6))
        [0]

        Raises:
            OptionError: `sent_levels` names a level that there is not.
        """
        predicted = frozenset(range(level_count - 1))
        if self.sent_levels is not None:
            if not self.sent_levels <= predicted:
                raise OptionError(
                    f"Diffs were asked for levels {sorted(self.sent_levels)}; this mesh has predicted levels "
                    f"{sorted(predicted)}"
                )
            return self.sent_levels
        return frozenset(level for level in predicted if level == 0 or level >= (self.variable_from or 1))


@dataclass(frozen=True)
class ClassicHeader:
    """What the decoder of a classic stream is told.

    Args:
        shifts: bits per coordinate that each level has dropped, level 0 first.
        filter: the predictor.
        levels_with_diff: the levels that send a Diff.
    """

    shifts: tuple[int, ...]
    filter: FilterSpec
    levels_with_diff: frozenset[int]

    def to_options(self) -> dict[str, Any]:
        """The fields as plain msgpack values, for `StreamHeader.options`."""
        return {
            "shifts": list(self.shifts),
            "filter": self.filter.to_header(),
            "diffs": sorted(self.levels_with_diff),
        }

    @classmethod
    def from_options(cls, options: Mapping[str, Any], bits: int) -> ClassicHeader:
        """The fields that `to_options` wrote.

        Raises:
            ContainerError: a field is missing, unknown or out of range.
        """
        try:
            if set(options) != {"shifts", "filter", "diffs"}:
                raise plain_values.BadValueError(f"options of a classic stream are not {plain_values.shown(options)}")
            shifts: list[int] = []
            for shift in plain_values.array(options["shifts"], "shifts"):
                smallest = shifts[-1] + 1 if shifts else 0
                shifts.append(plain_values.integer(shift, "shift", smallest, bits))
            if not shifts or shifts[0] != 0:
                raise plain_values.BadValueError("level 0 must drop no bits")
            diffs = [
                plain_values.integer(level, "level with Diff", 0, len(shifts) - 2)
                for level in plain_values.array(options["diffs"], "levels with Diff")
            ]
        except plain_values.BadValueError as error:
            raise ContainerError(f"damaged stream header: {error}") from error
        return cls(tuple(shifts), FilterSpec.from_header(options["filter"]), frozenset(diffs))
