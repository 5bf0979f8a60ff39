"""Options of the compact profile: what a person chooses, and what of it the decoder is told in the header."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from meshtide_codec.compact.mirror import Mirror
from meshtide_codec.compact.slices import Slices
from meshtide_codec.errors import ContainerError, OptionError
from meshtide_codec.quantize import DEFAULT_B, LARGEST_B, SMALLEST_B
from meshtide_codec.stream import plain_values

if TYPE_CHECKING:
    from collections.abc import Mapping

PROFILE = "compact"
MAXIMUM_SLICES = 4096
MAXIMUM_PREVIEWS = 8


@dataclass(frozen=True)
class CompactOptions:
    """How a mesh is encoded in the compact profile.

    Args:
        bits: B, quantization bits per coordinate, 4 to 20.
        previews: simplified meshes that open the stream, as ratios of the mesh's vertices to theirs, coarsest first;
            meshes too small for one go without it. None: those that show the mesh at 1e-2, 3e-3 and 1e-3 of its
            diagonal, by measured distance.
        slices: into how many Morton ranges the Diffs are cut, each decodable without the others.
        mirror: whether to look for a plane of symmetry.

    Raises:
        OptionError: a value outside its range.
    """

    bits: int = DEFAULT_B
    previews: tuple[int, ...] | None = None
    slices: int = 1
    mirror: bool = True

    def __post_init__(self) -> None:
        if not SMALLEST_B <= self.bits <= LARGEST_B:
            raise OptionError(f"B must be {SMALLEST_B}..{LARGEST_B} bits per coordinate, not {self.bits}")
        if not 1 <= self.slices <= MAXIMUM_SLICES:
            raise OptionError(f"the Diffs can be cut into 1..{MAXIMUM_SLICES} slices, not {self.slices}")
        if self.previews is None:
            return
        if len(self.previews) > MAXIMUM_PREVIEWS or any(ratio < 2 for ratio in self.previews):
            raise OptionError(f"at most {MAXIMUM_PREVIEWS} previews, of ratios from 2 on, not {self.previews}")
        if any(coarse <= fine for coarse, fine in itertools.pairwise(self.previews)):
            raise OptionError(f"the coarsest preview comes first, so ratios fall; not {self.previews}")


@dataclass(frozen=True)
class CompactHeader:
    """What the decoder of a compact stream is told.

    Args:
        base_depth: octree depth of the coarsest level, which comes whole in the Base packet.
        strengths: the display filter's byte for each depth from `base_depth` to B.
        diff_depths: the depths at which Diff packets end, ascending; each holds the bit planes since the one before.
        mirror: the plane of symmetry, if one is used.
        slices: where the slices begin.
        previews: bits per coordinate of each preview, in the order in which they are sent.
    """

    base_depth: int
    strengths: bytes
    diff_depths: tuple[int, ...]
    mirror: Mirror | None
    slices: Slices
    previews: tuple[int, ...]

    def to_options(self) -> dict[str, Any]:
        """The fields as plain msgpack values, for `StreamHeader.options`; those that say nothing are left out."""
        options: dict[str, Any] = {"b": self.base_depth, "f": self.strengths, "d": bytes(self.diff_depths)}
        if self.mirror is not None:
            options["m"] = [self.mirror.axis, self.mirror.coordinate_sum]
        if len(self.slices) > 1:
            options["s"] = list(self.slices.starts)
        if self.previews:
            options["p"] = bytes(self.previews)
        return options

    @classmethod
    def from_options(cls, options: Mapping[str, Any], bits: int) -> CompactHeader:
        """The fields that `to_options` wrote.

        Raises:
            ContainerError: a field is missing, unknown or out of range.
        """
        try:
            return cls._from_options(options, bits)
        except (plain_values.BadValueError, OptionError) as error:
            raise ContainerError(f"damaged stream header: {error}") from error

    @classmethod
    def _from_options(cls, options: Mapping[str, Any], bits: int) -> CompactHeader:
        if not {"b", "f", "d"} <= set(options) <= {"b", "f", "d", "m", "s", "p"}:
            raise plain_values.BadValueError(f"options of a compact stream are not {plain_values.shown(options)}")
        base_depth = plain_values.integer(options["b"], "base depth", 0, bits)
        depths = plain_values.binary(options["d"], "depths of Diffs", LARGEST_B)
        if any(not base_depth <= depth <= bits for depth in depths) or list(depths) != sorted(set(depths)):
            raise plain_values.BadValueError(f"depths of Diffs must ascend in {base_depth}..{bits}")
        count = bits - base_depth + 1
        mirror = None
        if "m" in options:
            axis, coordinate_sum = plain_values.array(options["m"], "mirror", 2)
            mirror = Mirror(
                plain_values.integer(axis, "mirror axis", 0, 2),
                plain_values.integer(coordinate_sum, "mirror sum", 0, (2 << bits) - 1),
                bits,
            )
        starts = plain_values.array(options.get("s", [0]), "slices")
        if len(starts) > MAXIMUM_SLICES:
            raise plain_values.BadValueError(f"{len(starts)} slices, more than {MAXIMUM_SLICES}")
        previews = plain_values.binary(options.get("p", b""), "previews", MAXIMUM_PREVIEWS)
        if any(not SMALLEST_B <= preview <= bits for preview in previews):
            raise plain_values.BadValueError(f"bits of previews must be {SMALLEST_B}..{bits}")
        return cls(
            base_depth=base_depth,
            strengths=plain_values.binary(options["f"], "strengths", count, count),
            diff_depths=tuple(depths),
            mirror=mirror,
            slices=Slices(bits, tuple(plain_values.integer(start, "start of a slice") for start in starts)),
            previews=tuple(previews),
        )
