"""Options of the compact profile: what a person chooses, and what of it the header holds."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from meshtide_codec import core
from meshtide_codec.compact.mirror import Mirror
from meshtide_codec.effort import Effort
from meshtide_codec.errors import OptionError
from meshtide_codec.quantize import DEFAULT_B, LARGEST_B, SMALLEST_B

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_codec.compact.encoder import CompactEncoding
    from meshtide_codec.quantize import QuantizedMesh

MAXIMUM_SLICES = 4096
MAXIMUM_PREVIEWS = 8
MAXIMUM_SLICES_AT_HIGH = 512
"""Each slice has models of its own, several times as large as at effort default."""
VERTICES_OF_A_SLICE = 100_000
"""A mesh of k^2 times as many has k slices: each costs about 3 bytes times the root of the mesh's vertices, as it
learns anew and does not see its neighbours' Diffs."""


@dataclass(frozen=True)
class CompactOptions:
    """How a mesh is encoded in the compact profile.

    Args:
        bits: B, quantization bits per coordinate, 4 to 20.
        previews: simplified meshes that open the stream, as ratios of the mesh's vertices to theirs, coarsest first;
            meshes too small for one go without it. None: those that show the mesh at 1e-2, 3e-3 and 1e-3 of its
            diagonal, by measured distance.
        slices: into how many Morton ranges the Diffs are cut, each decodable without the others. None: as many
            as cost at most 0.3 % of the bytes, see `slice_count`.
        mirror: whether to look for a plane of symmetry.
        effort: whether time counts (default) or size (high); "default" and "high" are understood too.

    Raises:
        OptionError: a value outside its range.
    """

    bits: int = DEFAULT_B
    previews: tuple[int, ...] | None = None
    slices: int | None = None
    mirror: bool = True
    effort: Effort = Effort.DEFAULT

    def __post_init__(self) -> None:
        if self.effort not in tuple(Effort):
            raise OptionError(f"effort is {' or '.join(Effort)}, not {self.effort!r}")
        object.__setattr__(self, "effort", Effort(self.effort))
        if not SMALLEST_B <= self.bits <= LARGEST_B:
            raise OptionError(f"B must be {SMALLEST_B}..{LARGEST_B} bits per coordinate, not {self.bits}")
        if self.slices is not None and not 1 <= self.slices <= MAXIMUM_SLICES:
            raise OptionError(f"the Diffs can be cut into 1..{MAXIMUM_SLICES} slices, not {self.slices}")
        if self.effort is Effort.HIGH and self.slices is not None and self.slices > MAXIMUM_SLICES_AT_HIGH:
            raise OptionError(f"effort {self.effort} takes at most {MAXIMUM_SLICES_AT_HIGH} slices, not {self.slices}")
        if self.previews is None:
            return
        if len(self.previews) > MAXIMUM_PREVIEWS or any(ratio < 2 for ratio in self.previews):
            raise OptionError(f"at most {MAXIMUM_PREVIEWS} previews, of ratios from 2 on, not {self.previews}")
        if any(coarse <= fine for coarse, fine in itertools.pairwise(self.previews)):
            raise OptionError(f"the coarsest preview comes first, so ratios fall; not {self.previews}")

    def encode(
        self, quantized: QuantizedMesh, progress: Callable[[str, float], None] | None, threads: int
    ) -> CompactEncoding:
        """The packets of a mesh, see `CompactEncoding`."""
        from meshtide_codec.compact.encoder import CompactEncoding

        return CompactEncoding(quantized, self, progress, threads)

    def slice_count(self, vertices: int) -> int:
        """How many slices a mesh of so many vertices gets.

        >>> CompactOptions().slice_count(1_000_000), CompactOptions(slices=7).slice_count(1_000_000)
        (3, 7)
        """
        if self.slices is not None:
            return self.slices
        return max(1, math.isqrt(vertices // VERTICES_OF_A_SLICE))


@dataclass(frozen=True)
class CompactHeader:
    """The fields of a compact stream's header.

    Args:
        base_depth: octree depth of the coarsest level, which comes whole in the Base packet.
        strengths: of the display filter for each depth from `base_depth` to B, by their place in the format's table.
        diff_depths: the depths at which Diff packets end, ascending; each holds the bit planes since the one before.
        mirror: the plane of symmetry, if one is used.
        slices: the first Morton code of each slice of the Diffs, ascending from 0.
        previews: how many previews there are.
        effort: at which the layers are coded.
    """

    base_depth: int
    strengths: tuple[int, ...]
    diff_depths: tuple[int, ...]
    mirror: Mirror | None
    slices: tuple[int, ...]
    previews: int
    effort: Effort

    profile: ClassVar[str] = "compact"
    number: ClassVar[int] = 1

    @property
    def trained_states(self) -> tuple[int, ...]:
        """Of its effort, and of effort default, which codes previews."""
        return (0, 1) if self.effort is Effort.HIGH else (0,)

    def plain(self) -> dict[str, Any]:
        """The fields as JSON can hold them, without those that follow from the packet table."""
        return {
            "effort": self.effort.value,
            "strengths": list(self.strengths),
            "mirror": None if self.mirror is None else [self.mirror.axis, self.mirror.coordinate_sum],
            "slices": list(self.slices),
        }

    def fill(self, header: core.Header) -> object:
        """Copy the fields into the core's header; returns what must stay alive until it is written."""
        header.profile = self.number
        header.effort = int(self.effort is Effort.HIGH)
        header.base_depth = self.base_depth
        header.strengths[: len(self.strengths)] = self.strengths
        header.mirror_axis, header.mirror_sum = (
            (-1, 0) if self.mirror is None else (self.mirror.axis, self.mirror.coordinate_sum)
        )
        slices = np.array(self.slices, np.uint64)
        header.slices, header.slice_count = slices.ctypes.data, len(slices)
        return slices

    @classmethod
    def of(cls, header: core.Header) -> CompactHeader:
        """The fields of one of the core's headers."""
        mirror = None
        if header.mirror_axis >= 0:
            mirror = Mirror(header.mirror_axis, header.mirror_sum, header.bits)
        return cls(
            base_depth=header.base_depth,
            strengths=tuple(header.strengths[: header.bits - header.base_depth + 1]),
            diff_depths=tuple(depth for depth in range(header.bits + 1) if header.diff_depths >> depth & 1),
            mirror=mirror,
            slices=tuple(core.copied(header.slices, (header.slice_count,), np.uint64).tolist()),
            previews=header.previews,
            effort=Effort.HIGH if header.effort else Effort.DEFAULT,
        )
