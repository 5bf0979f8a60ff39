"""Where the Map coder's contexts and neurons stand in its arrays, how many there are, and how fast they learn.

The contexts of the occupancy decisions come first, those of the leaf flags after them; within a block, a context's
index is made of its classes as the coder (`map_octant_kernels`, `map_leaf_kernels`) writes it down.
"""

from __future__ import annotations

from meshtide_codec.compact.map_survey_kernels import HEIGHTS, NORMAL_CLASSES

RATE = 16  # shift of the weights' steps
LIMIT = 60  # cap of the contexts' counts

MIRROR_STATES = 5  # no symmetry, no mirrored cell known, mirror seldom, sometimes, mostly right
MIRROR_ANSWERS = 3  # nothing known, mirrored octant empty, occupied
MIRROR_TRUST_LIMIT = 4

PARTIAL = 0
PARTIAL_SIZE = 256 * NORMAL_CLASSES * 4
SIDES = PARTIAL + PARTIAL_SIZE
SIDES_SIZE = 64 * 27
DENSITY = SIDES + SIDES_SIZE
DENSITY_SIZE = 8 * 5 * 7 * 6
MIRROR = DENSITY + DENSITY_SIZE
MIRROR_SIZE = MIRROR_ANSWERS * MIRROR_STATES * 8 * 5
HEIGHT = MIRROR + MIRROR_SIZE
HEIGHT_SIZE = HEIGHTS * 27 * NORMAL_CLASSES
SHELL = HEIGHT + HEIGHT_SIZE
SHELL_SIZE = 64 * HEIGHTS * 4
LEAF_RATIO = SHELL + SHELL_SIZE
LEAF_RATIO_SIZE = 4 * 4 * 4 * 6 * 6
LEAF_SPACING = LEAF_RATIO + LEAF_RATIO_SIZE
LEAF_SPACING_SIZE = 16 * 16 * 4 * 4
LEAF_VOTES = LEAF_SPACING + LEAF_SPACING_SIZE
LEAF_VOTES_SIZE = 4 * 4 * 6
LEAF_MIRROR = LEAF_VOTES + LEAF_VOTES_SIZE
LEAF_MIRROR_SIZE = MIRROR_ANSWERS * MIRROR_STATES * 16
LEAF_AGE = LEAF_MIRROR + LEAF_MIRROR_SIZE
LEAF_AGE_SIZE = 7 * 16 * 4 * 4
LEAF_CODED = LEAF_AGE + LEAF_AGE_SIZE
LEAF_CODED_SIZE = 6 * 16 * 4 * 4
CONTEXTS = LEAF_CODED + LEAF_CODED_SIZE

OCCUPANCY_NEURONS = 8 * 4 * 3
LEAF_NEURONS = 4 * 4 * 3
NEURONS = OCCUPANCY_NEURONS + LEAF_NEURONS
