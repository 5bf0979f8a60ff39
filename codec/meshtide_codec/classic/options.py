"""Options of the classic profile: what a person chooses, and what of it the header holds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from meshtide_codec.errors import ContainerError, OptionError
from meshtide_codec.filters import KINDS, USED_FIELDS, FilterSpec
from meshtide_codec.quantize import DEFAULT_B, LARGEST_B, SMALLEST_B

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_codec import core
    from meshtide_codec.classic.encoder import ClassicEncoding
    from meshtide_codec.quantize import QuantizedMesh

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

    def encode(
        self, quantized: QuantizedMesh, progress: Callable[[str, float], None] | None, threads: int
    ) -> ClassicEncoding:
        """The packets of a mesh, see `ClassicEncoding`; one thread makes them."""
        from meshtide_codec.classic.encoder import ClassicEncoding

        del threads
        return ClassicEncoding(quantized, self, progress)

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
    """The fields of a classic stream's header.

    Args:
        shifts: bits per coordinate that each level has dropped, level 0 first.
        filter: the predictor.
        levels_with_diff: the levels that send a Diff.
    """

    shifts: tuple[int, ...]
    filter: FilterSpec
    levels_with_diff: frozenset[int]

    profile: ClassVar[str] = "classic"
    number: ClassVar[int] = 0
    effort: ClassVar[None] = None
    trained_states: ClassVar[tuple[int, ...]] = (2,)

    def plain(self) -> dict[str, Any]:
        """The fields as JSON can hold them, of the filter those that it uses; an infinite norm is "inf"."""
        spec = {name: getattr(self.filter, name) for name in ("kind", *USED_FIELDS[self.filter.kind])}
        if spec.get("norm") == math.inf:
            spec["norm"] = "inf"
        return {"shifts": list(self.shifts), "filter": spec, "diffs": sorted(self.levels_with_diff)}

    def fill(self, header: core.Header) -> None:
        """Copy the fields into the core's header."""
        header.profile = self.number
        header.levels = len(self.shifts)
        header.shifts[: len(self.shifts)] = self.shifts
        header.diffs = sum(1 << level for level in self.levels_with_diff)
        header.filter = KINDS.index(self.filter.kind)
        header.degree = self.filter.degree
        header.denominator_degree = self.filter.denominator_degree
        header.chebyshev = int(self.filter.basis == "chebyshev")
        header.norm = 0.0 if self.filter.norm == math.inf else self.filter.norm
        header.taubin_lambda, header.taubin_mu = self.filter.taubin_lambda, self.filter.taubin_mu

    @classmethod
    def of(cls, header: core.Header) -> ClassicHeader:
        """The fields of one of the core's headers.

        Raises:
            ContainerError: a filter that cannot be.
        """
        try:
            spec = FilterSpec(
                KINDS[header.filter],
                degree=header.degree,
                basis="chebyshev" if header.chebyshev else "power",
                norm=header.norm or math.inf,
                taubin_lambda=header.taubin_lambda,
                taubin_mu=header.taubin_mu,
                denominator_degree=header.denominator_degree,
            )
        except OptionError as error:
            raise ContainerError(f"damaged stream header: {error}") from error
        return cls(
            shifts=tuple(header.shifts[: header.levels]),
            filter=spec,
            levels_with_diff=frozenset(level for level in range(32) if header.diffs >> level & 1),
        )
