"""The decisions of Maps that are coded deeply: contexts, numbers and neurons (docs/format.md, section 8.4.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from meshtide_codec.reference.deep_mixing import DeepNeurons
    from meshtide_codec.reference.map_surface import CellSurfaces
    from meshtide_codec.reference.map_surroundings import Surroundings
    from meshtide_codec.reference.range_decoder import RangeDecoder

INPUTS = 4 * 12 + 2

# Where each block of contexts begins.
ANSWERS = 28805
ABOVE = ANSWERS + 256 * 7 * 6
MIRRORED = ABOVE + 17 * 4 * 27 * 4
OVER = MIRRORED + 3 * 17 * 5 * 5
OVER_SIBLINGS = OVER + 24 * 4 * 12
OVER_ANSWERS = OVER_SIBLINGS + 24 * 27 * 4
LEAF_PATTERN = OVER_ANSWERS + 256 * 24
LEAF_SIBLINGS = LEAF_PATTERN + 256 * 4 * 4
LEAF_AGE = LEAF_SIBLINGS + 8 * 4 * 16 * 6
LEAF_FIT = LEAF_AGE + 7 * 6 * 6 * 16
LEAF_DEGREE = LEAF_FIT + 12 * 2 * 6 * 16
LEAF_RATIOS = LEAF_DEGREE + 16 * 16 * 16

# Where each set of neurons begins.
BY_RANK = 0
BY_NORMAL = BY_RANK + 96
BY_DENSITY = BY_NORMAL + 7 * 4 * 4
BY_HEIGHT = BY_DENSITY + 7 * 6
BY_SIBLINGS = BY_HEIGHT + 17 * 4
BY_OVER = BY_SIBLINGS + 27
BY_PLACE = BY_OVER + 24 * 12
BY_RATIOS = BY_PLACE + 48
BY_DEGREE = BY_RATIOS + 6 * 6
BY_AGE = BY_DEGREE + 16 * 4
BY_LEAF_SIBLINGS = BY_AGE + 7 * 16
BY_FIT = BY_LEAF_SIBLINGS + 8 * 4


class OctantClasses(NamedTuple):
    """What an octant's decision looks at, in the words of section 8.4."""

    octant: int
    rank: int
    found: int
    answers: int
    inner: int
    vote: int
    height: int
    density: int
    answer: int
    mirror_state: int


class ChildClasses(NamedTuple):
    """What the decision whether a child is a leaf looks at, in the words of section 8.4."""

    octant: int
    pattern: int
    canonical: int
    split: int
    leaves: int
    size: int
    vote: int
    coded_ratio: int
    degree: int
    age: int


def octant_bit(
    decoder: RangeDecoder,
    neurons: DeepNeurons,
    neuron: int,
    places: list[int],
    own: OctantClasses,
    around: Surroundings,
    surfaces: CellSurfaces,
) -> int:
    """Whether an octant is occupied; `places` and `neuron` are those of effort default."""
    fit = surfaces.fit_class
    distance, over = 0.0, 23
    if fit < 11:  # there is a surface
        distance = abs(surfaces.over(own.octant))
        over = min(int(distance * 12.0), 22)
    few = min(own.found, 3)
    mirrored = ((own.answer * 17 + own.height) * 5 + min(own.found, 4)) * 5 + own.mirror_state
    added = [
        ANSWERS + (own.answers * 7 + own.density) * 6 + around.leaf_ratio,
        ABOVE + ((own.height * 4 + own.vote) * 27 + own.inner) * 4 + few,
        MIRRORED + mirrored,
        OVER + (over * 4 + few) * 12 + fit,
        OVER_SIBLINGS + (over * 27 + own.inner) * 4 + own.vote,
        OVER_ANSWERS + own.answers * 24 + over,
    ]
    chosen = [
        BY_RANK + neuron,
        BY_NORMAL + (around.normal_class * 4 + own.vote) * 4 + few,
        BY_DENSITY + own.density * 6 + around.leaf_ratio,
        BY_HEIGHT + own.height * 4 + few,
        BY_SIBLINGS + own.inner,
        BY_OVER + over * 12 + fit,
    ]
    heard = [(place, 1) for place in places + added]
    numbers = [256, min(int(distance * 256.0), 2047)]
    return neurons.bit(decoder, chosen, own.rank, min(own.found, 4) * 7 + own.density, heard, numbers)


def leaf_bit(
    decoder: RangeDecoder,
    neurons: DeepNeurons,
    neuron: int,
    places: list[int],
    own: ChildClasses,
    around: Surroundings,
    surfaces: CellSurfaces,
) -> int:
    """Whether a child is a leaf; `places` and `neuron`, from 0, are those of effort default."""
    faces = sum(own.pattern >> (own.octant ^ bit) & 1 for bit in (4, 2, 1))
    edges = sum(own.pattern >> (own.octant ^ 7 ^ bit) & 1 for bit in (4, 2, 1))
    beside = 2 * faces + (edges > 1)
    place = own.size * 4 + own.split
    crowded = own.pattern.bit_count() > 3
    ratio, spacing, fit = around.leaf_ratio, around.spacing, surfaces.fit_class
    added = [
        LEAF_PATTERN + (own.canonical * 4 + own.leaves) * 4 + own.split,
        LEAF_SIBLINGS + ((beside * 4 + own.vote) * 16 + place) * 6 + ratio,
        LEAF_AGE + ((own.age * 6 + own.coded_ratio) * 6 + ratio) * 16 + place,
        LEAF_FIT + ((fit * 2 + crowded) * 6 + ratio) * 16 + place,
        LEAF_DEGREE + (own.degree * 16 + spacing) * 16 + place,
        LEAF_RATIOS + ((own.coded_ratio * 6 + ratio) * 16 + spacing) * 4 + own.split,
    ]
    chosen = [
        BY_PLACE + neuron,
        BY_RATIOS + ratio * 6 + own.coded_ratio,
        BY_DEGREE + own.degree * 4 + own.leaves,
        BY_AGE + own.age * 16 + spacing,
        BY_LEAF_SIBLINGS + beside * 4 + own.vote,
        BY_FIT + fit,
    ]
    heard = [(context, 1) for context in places + added]
    share = 512 * around.leaf_count // len(around.members) - 256 if around.members else 0
    return neurons.bit(decoder, chosen, 8 + place, 35 + own.age, heard, [256, share])
