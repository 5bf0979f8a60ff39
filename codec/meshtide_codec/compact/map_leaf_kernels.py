"""Which children of a cell are leaves: one binary decision a child, mixed from six contexts.

They tell how many children there are and have turned out to be leaves, how the neighbours fared, how far away they
are, how many there are and how old those that are leaves, where the octant lies, and what the mirror image says.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compact import map_layout as layout
from meshtide_codec.compact import map_survey_kernels as surveys
from meshtide_codec.compact.map_deep_kernels import code_leaf_flag_deeply
from meshtide_codec.compilation import borrowing_kernel
from meshtide_codec.entropy.mixing_kernels import code_mixed_bit

if TYPE_CHECKING:
    from meshtide_codec.compact.map_deep_kernels import DeepMap
    from meshtide_codec.compact.map_survey_kernels import Scratch
    from meshtide_codec.entropy.mixing_kernels import Opinions, Weights
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder


@borrowing_kernel
def code_leaf_flags(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    deep: DeepMap | None,
    pattern: int,
    given: int,
    survey: Scratch,
    votes: Scratch,
    mirrored: int,
    mirror_state: int,
    places: Opinions,
    signs: Opinions,
) -> int:
    """Code which of the children in `pattern` (two at least) are leaves; returns them as bits.

    `deep` is None at effort default.
    """
    count = canonical = 0
    for rank in range(8):
        occupied = (pattern >> surveys.canonical_octant(rank, survey)) & 1
        count += occupied
        canonical |= occupied << rank
    size_class = min(count, 5) - 2
    leaf_ratio = surveys.leaf_ratio_class(survey)
    coded_ratio = 5
    if survey[surveys.CODED_CHILDREN] > 0:
        coded_ratio = min(5 * survey[surveys.CODED_LEAVES] // survey[surveys.CODED_CHILDREN], 4)
    degree = min(survey[surveys.NEIGHBOURS], 15)
    age = 6
    if survey[surveys.LEAF_NEIGHBOURS] > 0:
        age = min(3 * survey[surveys.LEAF_AGE] // (2 * survey[surveys.LEAF_NEIGHBOURS]), 5)
    spacing = surveys.quarter_logarithm(survey[surveys.LENGTH], survey[surveys.NEIGHBOURS])
    trust = 0 if mirrored < 0 else (1 if mirror_state < 4 else 2)
    flags = 0
    asked = 0
    found = 0
    for rank in range(8):
        octant = surveys.canonical_octant(rank, survey)
        if (pattern >> octant) & 1 == 0:
            continue
        split_class = min(asked - found, 3)
        found_class = min(found, 3)
        vote = min(votes[octant], 3)
        places[0] = (
            layout.LEAF_RATIO + (((size_class * 4 + split_class) * 4 + found_class) * 6 + leaf_ratio) * 6 + coded_ratio
        )
        places[1] = layout.LEAF_SPACING + ((degree * 16 + spacing) * 4 + size_class) * 4 + split_class
        places[2] = layout.LEAF_VOTES + (vote * 4 + split_class) * 6 + leaf_ratio
        answer = 0 if mirrored < 0 else 1 + ((mirrored >> (8 + octant)) & 1)
        place_class = size_class * 4 + split_class
        places[3] = layout.LEAF_MIRROR + (answer * layout.MIRROR_STATES + mirror_state) * 16 + place_class
        places[4] = layout.LEAF_AGE + ((age * 16 + spacing) * 4 + size_class) * 4 + split_class
        places[5] = layout.LEAF_CODED + ((coded_ratio * 16 + degree) * 4 + size_class) * 4 + found_class
        neuron = place_class * 3 + trust
        told = (given >> octant) & 1
        if deep is not None:
            bit = code_leaf_flag_deeply(
                coder,
                buffer,
                deep,
                neuron,
                octant,
                pattern,
                canonical,
                found_class,
                place_class,
                vote,
                leaf_ratio,
                coded_ratio,
                degree,
                age,
                spacing,
                1 if count > 3 else 0,
                survey,
                places,
                signs,
                told,
            )
        else:
            neuron += layout.OCCUPANCY_NEURONS
            bit = code_mixed_bit(
                coder, buffer, contexts, weights, neuron, places, signs, layout.RATE, layout.LIMIT, told
            )
        asked += 1
        found += bit
        flags |= bit << octant
    return flags
