"""Options of the compact profile: what a person chooses, and what of it the decoder is told in the header."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from meshtide_codec.compact.display_filter import STRENGTHS, UNFILTERED, Strength
from meshtide_codec.compact.effort import DeepLayers, Effort
from meshtide_codec.compact.mirror import Mirror
from meshtide_codec.compact.slices import Slices
from meshtide_codec.errors import ContainerError, OptionError
from meshtide_codec.quantize import DEFAULT_B, LARGEST_B, SMALLEST_B
from meshtide_codec.stream import plain_values
from meshtide_codec.stream.packets import PacketKind

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from meshtide_codec.stream.header import StreamHeader

PROFILE = "compact"
MAXIMUM_SLICES = 4096
MAXIMUM_PREVIEWS = 8
MAXIMUM_DEEP_SLICES = 512
"""Slices at effort high: each has models of its own, six times as large as at effort default."""


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
        effort: whether time counts (default) or size (high); "default" and "high" are understood too.

    Raises:
        OptionError: a value outside its range.
    """

    bits: int = DEFAULT_B
    previews: tuple[int, ...] | None = None
    slices: int = 1
    mirror: bool = True
    effort: Effort = Effort.DEFAULT

    def __post_init__(self) -> None:
        if self.effort not in tuple(Effort):
            raise OptionError(f"effort is {' or '.join(Effort)}, not {self.effort!r}")
        object.__setattr__(self, "effort", Effort(self.effort))
        if not SMALLEST_B <= self.bits <= LARGEST_B:
            raise OptionError(f"B must be {SMALLEST_B}..{LARGEST_B} bits per coordinate, not {self.bits}")
        if not 1 <= self.slices <= MAXIMUM_SLICES:
            raise OptionError(f"the Diffs can be cut into 1..{MAXIMUM_SLICES} slices, not {self.slices}")
        if DeepLayers.DIFFS in self.effort.deep_layers and self.slices > MAXIMUM_DEEP_SLICES:
            raise OptionError(f"effort {self.effort} takes at most {MAXIMUM_DEEP_SLICES} slices, not {self.slices}")
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
        strengths: the display filter's strength for each depth from `base_depth` to B.
        diff_depths: the depths at which Diff packets end, ascending; each holds the bit planes since the one before.
        mirror: the plane of symmetry, if one is used.
        slices: where the slices begin.
        previews: how many previews there are.
        deep: the layers that are coded deeply.
    """

    base_depth: int
    strengths: tuple[Strength, ...]
    diff_depths: tuple[int, ...]
    mirror: Mirror | None
    slices: Slices
    previews: int
    deep: DeepLayers = DeepLayers.NONE

    def to_options(self) -> dict[str, Any]:
        """The fields as plain msgpack values, for `StreamHeader.options`; not those that the packet table tells."""
        options: dict[str, Any] = {}
        if any(strength != UNFILTERED for strength in self.strengths):
            options["f"] = _pack_strengths(self.strengths)
        if self.mirror is not None:
            options["m"] = [self.mirror.axis, self.mirror.coordinate_sum]
        if len(self.slices) > 1:
            options["s"] = list(self.slices.starts)
        if self.deep:
            options["e"] = int(self.deep)
        return options

    @classmethod
    def from_header(cls, header: StreamHeader) -> CompactHeader:
        """The fields that a stream's header tells: by the options that `to_options` wrote, and by its packets.

        Raises:
            ContainerError: a field is missing, unknown or out of range.
        """
        try:
            return cls._checked(header)
        except (plain_values.BadValueError, OptionError) as error:
            raise ContainerError(f"damaged stream header: {error}") from error

    @classmethod
    def _checked(cls, header: StreamHeader) -> CompactHeader:
        options, bits = header.options, header.bits
        if not set(options) <= {"f", "m", "s", "e"}:
            raise plain_values.BadValueError(f"options of a compact stream are not {plain_values.shown(options)}")
        levels: dict[PacketKind, list[int]] = {kind: [] for kind in PacketKind}
        for entry in header.packets:
            levels[entry.kind].append(entry.level)
        if len(levels[PacketKind.BASE]) != 1:
            raise plain_values.BadValueError(f"{len(levels[PacketKind.BASE])} Base packets instead of one")
        base_depth = plain_values.integer(bits - levels[PacketKind.BASE][0], "base depth", 0, bits)
        depths = sorted({bits - level for level in levels[PacketKind.DIFF]})
        if depths and not base_depth <= depths[0]:
            raise plain_values.BadValueError(f"a Diff of depth {depths[0]} before the base depth {base_depth}")
        previews = len(levels[PacketKind.PREVIEW])
        if previews > MAXIMUM_PREVIEWS:
            raise plain_values.BadValueError(f"{previews} previews, more than {MAXIMUM_PREVIEWS}")
        count = bits - base_depth + 1
        slices = _slices(options, bits, header.vertices)
        deep = DeepLayers(plain_values.integer(options.get("e", 0), "deep layers", 0, DeepLayers.ALL))
        if DeepLayers.DIFFS in deep and len(slices) > MAXIMUM_DEEP_SLICES:
            raise plain_values.BadValueError(f"{len(slices)} slices, more than {MAXIMUM_DEEP_SLICES}")
        packed = plain_values.binary(options.get("f", b""), "strengths", (count + 1) // 2)
        return cls(
            base_depth=base_depth,
            strengths=_unpack_strengths(packed, count),
            diff_depths=tuple(depths),
            mirror=_mirror(options, bits),
            slices=slices,
            previews=previews,
            deep=deep,
        )


def _mirror(options: Mapping[str, Any], bits: int) -> Mirror | None:
    if "m" not in options:
        return None
    axis, coordinate_sum = plain_values.array(options["m"], "mirror", 2)
    return Mirror(
        plain_values.integer(axis, "mirror axis", 0, 2),
        plain_values.integer(coordinate_sum, "mirror sum", 0, (2 << bits) - 1),
        bits,
    )


def _slices(options: Mapping[str, Any], bits: int, vertices: int) -> Slices:
    starts = plain_values.array(options.get("s", [0]), "slices")
    most = min(MAXIMUM_SLICES, vertices + 1)  # besides the first one, each begins at a vertex
    if len(starts) > most:
        raise plain_values.BadValueError(f"{len(starts)} slices, more than {most}")
    return Slices(bits, tuple(plain_values.integer(start, "start of a slice") for start in starts))


def _pack_strengths(strengths: Sequence[Strength]) -> bytes:
    """Two in a byte, each by its place in `STRENGTHS`, the first one in the upper half; zeros at the end left out.

    >>> _pack_strengths([STRENGTHS[8], STRENGTHS[4], STRENGTHS[1], STRENGTHS[0], STRENGTHS[0]]).hex()
    '8410'
    """
    places = [STRENGTHS.index(strength) for strength in strengths] + [0]
    packed = bytes(upper << 4 | lower for upper, lower in zip(places[0::2], places[1::2], strict=False))
    return packed.rstrip(b"\0")


def _unpack_strengths(packed: bytes, count: int) -> tuple[Strength, ...]:
    places = [place for byte in packed for place in (byte >> 4, byte & 15)] + [0] * count
    return tuple(STRENGTHS[place] for place in places[:count])
