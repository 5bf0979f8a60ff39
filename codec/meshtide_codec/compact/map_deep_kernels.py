"""The decisions of the Map where it is coded deeply: what is mixed besides the contexts of effort default.

To those come joint contexts of the same properties, and where the surface of the cell passes (`map_surface_kernels`).
O(1) per decision.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact import map_deep_layout as layout
from meshtide_codec.compact import map_layout as default
from meshtide_codec.compact import map_survey_kernels as surveys
from meshtide_codec.compact.map_surface_kernels import FIT_CLASS, octant_over_surface
from meshtide_codec.compilation import borrowing_kernel, inlined_kernel
from meshtide_codec.entropy.deep_mixing_kernels import NUMBER_LIMIT, code_deep_bit
from meshtide_codec.entropy.mixing_kernels import INPUTS as DEFAULT_INPUTS

if TYPE_CHECKING:
    from meshtide_codec.compact.map_surface_kernels import CellSurfaces
    from meshtide_codec.compact.map_survey_kernels import Scratch
    from meshtide_codec.entropy.deep_mixing_kernels import Inputs, Mixer
    from meshtide_codec.entropy.mixing_kernels import Opinions
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

    DeepMap = tuple[Mixer, Opinions, Inputs, Inputs, CellSurfaces]
    """All that the Map coder needs to code deeply: the mixer, its neurons, inputs and outputs, and the surfaces."""

_ONE = 256  # a plain number that is always there
_OVER_STEPS = 12.0


def new_deep_map(mixer: Mixer, surfaces: CellSurfaces) -> DeepMap:
    """What `code_map` takes to code a Map deeply."""
    neurons, outputs = np.zeros(layout.CHOICES, np.int64), np.zeros(layout.CHOICES, np.int32)
    return mixer, neurons, np.zeros(layout.INPUTS, np.int32), outputs, surfaces


@inlined_kernel
def fitted_class(deep: DeepMap) -> int:
    """How well the surface of the cell at hand can be trusted."""
    return int(deep[4][6][FIT_CLASS])


@borrowing_kernel
def code_octant_deeply(
    coder: Coder,
    buffer: Buffer,
    deep: DeepMap,
    neuron: int,
    octant: int,
    rank: int,
    count: int,
    answers: int,
    inner: int,
    vote: int,
    height: int,
    density: int,
    leaf_ratio: int,
    normal_class: int,
    answer: int,
    mirror_state: int,
    places: Opinions,
    signs: Opinions,
    bit: int,
) -> int:
    """Whether an octant is occupied; the contexts and the neuron of effort default are set."""
    mixer, neurons, inputs, outputs, surfaces = deep
    fit_class = fitted_class(deep)
    over_class = layout.OVER_CLASSES - 1
    distance = 0.0
    if fit_class < layout.NO_SURFACE:
        distance = abs(octant_over_surface(octant, surfaces[6]))
        over_class = min(int(distance * _OVER_STEPS), layout.OVER_CLASSES - 2)
    few = min(count, 3)
    first = DEFAULT_INPUTS
    places[first] = layout.ANSWERS + (answers * 7 + density) * 6 + leaf_ratio
    places[first + 1] = layout.ABOVE + ((height * 4 + vote) * 27 + inner) * 4 + few
    place = (answer * surveys.HEIGHTS + height) * 5 + min(count, 4)
    places[first + 2] = layout.MIRRORED + place * default.MIRROR_STATES + mirror_state
    places[first + 3] = layout.OVER + (over_class * 4 + few) * layout.FIT_CLASSES + fit_class
    places[first + 4] = layout.OVER_SIBLINGS + (over_class * 27 + inner) * 4 + vote
    places[first + 5] = layout.OVER_ANSWERS + answers * layout.OVER_CLASSES + over_class
    inputs[layout.NUMBERS] = _ONE
    inputs[layout.NUMBERS + 1] = min(int(distance * 256.0), NUMBER_LIMIT)
    neurons[0] = layout.BY_RANK + neuron
    neurons[1] = layout.BY_NORMAL + (normal_class * 4 + vote) * 4 + few
    neurons[2] = layout.BY_DENSITY + density * 6 + leaf_ratio
    neurons[3] = layout.BY_HEIGHT + height * 4 + few
    neurons[4] = layout.BY_SIBLINGS + inner
    neurons[5] = layout.BY_OVER + over_class * layout.FIT_CLASSES + fit_class
    correction = min(count, 4) * 7 + density
    return code_deep_bit(
        coder, buffer, mixer, neurons, rank, correction, places, signs, inputs, outputs, layout.RATE, bit
    )


@borrowing_kernel
def code_leaf_flag_deeply(
    coder: Coder,
    buffer: Buffer,
    deep: DeepMap,
    neuron: int,
    octant: int,
    pattern: int,
    canonical: int,
    found_class: int,
    place_class: int,
    vote: int,
    leaf_ratio: int,
    coded_ratio: int,
    degree: int,
    age: int,
    spacing: int,
    crowded: int,
    survey: Scratch,
    places: Opinions,
    signs: Opinions,
    bit: int,
) -> int:
    """Whether a child is a leaf; the contexts and the neuron of effort default are set."""
    mixer, neurons, inputs, outputs, _ = deep
    fit_class = fitted_class(deep)
    faces = edges = 0
    for axis in range(3):
        faces += (pattern >> (octant ^ (4 >> axis))) & 1
        edges += (pattern >> (octant ^ 7 ^ (4 >> axis))) & 1
    beside = faces * 2 + (1 if edges > 1 else 0)
    split_class = place_class & 3
    first = DEFAULT_INPUTS
    places[first] = layout.LEAF_PATTERN + (canonical * 4 + found_class) * 4 + split_class
    places[first + 1] = layout.LEAF_SIBLINGS + ((beside * 4 + vote) * 16 + place_class) * 6 + leaf_ratio
    places[first + 2] = layout.LEAF_AGE + ((age * 6 + coded_ratio) * 6 + leaf_ratio) * 16 + place_class
    places[first + 3] = layout.LEAF_FIT + ((fit_class * 2 + crowded) * 6 + leaf_ratio) * 16 + place_class
    places[first + 4] = layout.LEAF_DEGREE + (degree * 16 + spacing) * 16 + place_class
    places[first + 5] = layout.LEAF_RATIOS + ((coded_ratio * 6 + leaf_ratio) * 16 + spacing) * 4 + split_class
    inputs[layout.NUMBERS] = _ONE
    inputs[layout.NUMBERS + 1] = 0
    if survey[surveys.NEIGHBOURS] > 0:
        inputs[layout.NUMBERS + 1] = 512 * survey[surveys.LEAF_NEIGHBOURS] // survey[surveys.NEIGHBOURS] - 256
    neurons[0] = layout.BY_PLACE + neuron
    neurons[1] = layout.BY_RATIOS + leaf_ratio * 6 + coded_ratio
    neurons[2] = layout.BY_DEGREE + degree * 4 + found_class
    neurons[3] = layout.BY_AGE + age * 16 + spacing
    neurons[4] = layout.BY_LEAF_SIBLINGS + beside * 4 + vote
    neurons[5] = layout.BY_FIT + fit_class
    final, correction = layout.LEAF_FINALS + place_class, layout.LEAF_CORRECTIONS + age
    return code_deep_bit(
        coder, buffer, mixer, neurons, final, correction, places, signs, inputs, outputs, layout.RATE, bit
    )
