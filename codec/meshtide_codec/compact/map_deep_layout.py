"""Where the Map coder's contexts and neurons stand in its arrays where Maps are coded deeply.

The contexts of effort default (`map_layout`) come first, then those that are added; for occupancy decisions and for
leaf flags there are as many of them, and of neurons.
"""

from __future__ import annotations

from meshtide_codec.compact import map_layout as default
from meshtide_codec.compact.map_survey_kernels import HEIGHTS, NORMAL_CLASSES
from meshtide_codec.entropy.deep_mixing_kernels import HEARD
from meshtide_codec.entropy.mixing_kernels import INPUTS as DEFAULT_INPUTS

RATE = 16  # shift of the weights' steps

FIT_CLASSES = 12  # how well the surface fitted the neighbours; 10: none of them is known, 11: there is no surface
NO_NEIGHBOUR_FITTED = FIT_CLASSES - 2
NO_SURFACE = FIT_CLASSES - 1
OVER_CLASSES = 24  # twelfths of half a cell that an octant's centre is away from the surface; 23: there is none

HEARD_CONTEXTS = DEFAULT_INPUTS + 6
NUMBERS = HEARD * HEARD_CONTEXTS  # where the plain numbers begin among the inputs
INPUTS = NUMBERS + 2

ANSWERS = default.CONTEXTS
ABOVE = ANSWERS + 256 * 7 * 6
MIRRORED = ABOVE + HEIGHTS * 4 * 27 * 4
OVER = MIRRORED + default.MIRROR_ANSWERS * HEIGHTS * 5 * default.MIRROR_STATES
OVER_SIBLINGS = OVER + OVER_CLASSES * 4 * FIT_CLASSES
OVER_ANSWERS = OVER_SIBLINGS + OVER_CLASSES * 27 * 4
LEAF_PATTERN = OVER_ANSWERS + 256 * OVER_CLASSES
LEAF_SIBLINGS = LEAF_PATTERN + 256 * 4 * 4
LEAF_AGE = LEAF_SIBLINGS + 4 * 2 * 4 * 16 * 6
LEAF_FIT = LEAF_AGE + 7 * 6 * 6 * 16
LEAF_DEGREE = LEAF_FIT + FIT_CLASSES * 2 * 6 * 16
LEAF_RATIOS = LEAF_DEGREE + 16 * 16 * 16
CONTEXTS = LEAF_RATIOS + 6 * 6 * 16 * 4

CHOICES = 6  # neurons that mix each decision
BY_RANK = 0
BY_NORMAL = BY_RANK + default.OCCUPANCY_NEURONS
BY_DENSITY = BY_NORMAL + NORMAL_CLASSES * 4 * 4
BY_HEIGHT = BY_DENSITY + 7 * 6
BY_SIBLINGS = BY_HEIGHT + HEIGHTS * 4
BY_OVER = BY_SIBLINGS + 27
BY_PLACE = BY_OVER + OVER_CLASSES * FIT_CLASSES
BY_RATIOS = BY_PLACE + default.LEAF_NEURONS
BY_DEGREE = BY_RATIOS + 6 * 6
BY_AGE = BY_DEGREE + 16 * 4
BY_LEAF_SIBLINGS = BY_AGE + 7 * 16
BY_FIT = BY_LEAF_SIBLINGS + 4 * 2 * 4
NEURONS = BY_FIT + FIT_CLASSES

LEAF_FINALS = 8
FINALS = LEAF_FINALS + 16
LEAF_CORRECTIONS = 5 * 7
CORRECTIONS = LEAF_CORRECTIONS + 7
