"""The Diff coder: one more bit per coordinate for each leaf that is coarser than the depth being coded.

Vertices come in Morton order; each takes three binary decisions, first along the axis to which the surface's normal
is most nearly perpendicular, last along the one nearest to it. Each decision is mixed from six contexts:
the plane through the neighbours; the neighbours' alignment with the two possible coordinates; parallelograms inside
the ring, over its edges; midpoints of opposite neighbours; the mirror image, or, without one, all of these at once.
A context speaks about the direction its prediction points to: its sign. O(degree) per vertex.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact import diff_prediction_kernels as prediction
from meshtide_codec.compact.quantizers import SATURATING_ENTRIES, STEPS, saturating_classes
from meshtide_codec.compact.ring_kernels import RING_LIMIT
from meshtide_codec.compilation import borrowing_kernel, inlined_kernel, kernel
from meshtide_codec.entropy.mixing_kernels import INPUTS, code_mixed_bit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.diff_prediction_kernels import Classes, Predictions, Rows
    from meshtide_codec.compact.ring_kernels import Rings
    from meshtide_codec.entropy.mixing_kernels import Opinions, Weights
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

RATE = 17
LIMIT = 100

MIRROR_STATES = 9  # 0: no partner; partner unknown (1..4) or known (5..8) x verdict of the neighbours' partners
MIRROR_TRUSTED = 7  # from this state on, the partner is known and the neighbours' partners mostly agree
UNDECIDED, DIFFERS, AGREES = 0, 1, 2  # outcome of a vertex' comparison with its partner
_PARTNER_SLACK = 1.01  # half cells within which an image counts as agreeing

PLANE_STATES = 12 * 12 * 2 * 6
ALIGNMENT_STATES = 5 * 4 * 3 * 8
EXPERT_STATES = 16 * 8 * 4 * 4
ACROSS_STATES = 10 * 8 * 9 * 5
JOINT_STATES = 4 * 4 * 7 * 40
MIRRORED_STATES = 8 * MIRROR_STATES * 2
PLANE = 0
ALIGNMENT = PLANE + PLANE_STATES
RING = ALIGNMENT + ALIGNMENT_STATES
MIDPOINT = RING + EXPERT_STATES
ACROSS = MIDPOINT + EXPERT_STATES
JOINT = ACROSS + ACROSS_STATES
MIRRORED = JOINT + JOINT_STATES
CONTEXTS = MIRRORED + MIRRORED_STATES
NEURONS = 12 * 4 * 3

_FOUR = saturating_classes(4, 2)
_EIGHT = saturating_classes(8, 2)
_TEN = saturating_classes(10, 2)
_TEN_WIDE = saturating_classes(10, 3)
_TWELVE = saturating_classes(12, 2)
_SIXTEEN = saturating_classes(16, 2)

NEW_ERROR = 1.0  # ERROR of a vertex that has just become a leaf
FOREIGN_ERROR = 4.0  # ERROR of a vertex of another slice, known by its leaf cell only
ERROR_GROWTH = 1.4  # what happens to the ERROR of a vertex from one depth to the next, whose cells are half as large


@inlined_kernel
def table_index(value: float) -> int:
    """Where a saturating table stands for |value|."""
    return np.uintp(min(int(abs(value) * STEPS), SATURATING_ENTRIES - 1))  # type: ignore[return-value]


@inlined_kernel
def towards(value: float) -> int:
    """+1 when the value is not negative, else -1."""
    return 1 if value >= 0.0 else -1


@inlined_kernel
def plane_offset(axis: int, predictions: Predictions, carried: float) -> float:
    """The plane's offset along an axis, corrected for where the axes before have taken the vertex off the plane."""
    normal = predictions[prediction.NORMAL + axis]
    offset: float = predictions[prediction.PLANE + axis] - carried * normal / (normal * normal + 0.15)
    return offset


@inlined_kernel
def half_steps(value: float, lowest: float, classes: int) -> int:
    """Classes of width 1/2 around 0 for values above `lowest`, 0 below."""
    return min(int(value * 2.0 + 3.5), classes - 1) if value > lowest else 0


@inlined_kernel
def set_contexts(
    axis: int,
    plane: float,
    predictions: Predictions,
    classes: Classes,
    mirror_axis: int,
    places: Opinions,
    signs: Opinions,
) -> None:
    """Fill `places` and `signs` of the six inputs for the decision along `axis`."""
    below = classes[prediction.BELOW + axis]
    level = classes[prediction.LEVEL + axis]
    above = classes[prediction.ABOVE + axis]
    smoothed = predictions[prediction.SMOOTHED + axis]
    mean = predictions[prediction.MEAN + axis]
    ring = predictions[prediction.RING + axis]
    midpoint = predictions[prediction.MIDPOINT + axis]
    across = predictions[prediction.ACROSS + axis]
    ring_trust = classes[prediction.RING_TRUST]
    midpoint_trust = classes[prediction.MIDPOINT_TRUST]
    known = classes[prediction.KNOWN_CLASS]
    steepness = int(abs(predictions[prediction.NORMAL + axis]) * 3.999)

    sign = towards(plane)
    alike = 1 if plane * mean > 0.0 else 0
    place = (_TWELVE[table_index(plane)] * 12 + _TEN_WIDE[table_index(mean)]) * 2 + alike
    signs[0] = sign
    places[0] = PLANE + place * 6 + (classes[prediction.ERROR_CLASS] >> 2)

    sign = 1 if above > below or (above == below and smoothed >= 0.0) else -1
    more, fewer = max(above, below), min(above, below)
    alike = 1 if smoothed * sign > 0.0 else 0
    place = (min(more, 4) * 4 + min(fewer, 3)) * 3 + min(level, 2)
    signs[1] = sign
    places[1] = ALIGNMENT + place * 8 + _FOUR[table_index(smoothed)] * 2 + alike

    signs[2] = towards(ring)
    places[2] = RING + ((_SIXTEEN[table_index(ring)] * 8 + ring_trust) * 4 + steepness) * 4 + known

    signs[3] = towards(midpoint)
    places[3] = MIDPOINT + ((_SIXTEEN[table_index(midpoint)] * 8 + midpoint_trust) * 4 + steepness) * 4 + known

    sign = towards(across)
    agreeing, opposing = (above, below) if sign > 0 else (below, above)
    plane_ahead = plane * sign
    ahead = 0
    if plane_ahead > -1.0:
        ahead = 4 if plane_ahead >= 0.75 else int(2.5 + 2.0 * plane_ahead)
    place = (_TEN[table_index(across)] * 8 + classes[prediction.ACROSS_TRUST]) * 9
    signs[4] = sign
    places[4] = ACROSS + (place + min(agreeing, 2) * 3 + min(opposing, 2)) * 5 + ahead

    if classes[prediction.MIRROR_STATE] > 0:
        mirrored = predictions[prediction.MIRRORED + axis]
        distance = min(int(abs(mirrored) * 2.0 + 0.5), 7)
        signs[5] = towards(mirrored)
        place = (distance * MIRROR_STATES + classes[prediction.MIRROR_STATE]) * 2
        places[5] = MIRRORED + place + (1 if axis == mirror_axis else 0)
    else:
        guess = midpoint if midpoint_trust > 0 else (ring if ring_trust > 0 else plane)
        sign = towards(guess)
        agreeing, opposing = (above, below) if sign > 0 else (below, above)
        place = (min(agreeing, 3) * 4 + min(opposing, 3)) * 7 + half_steps(plane * sign, -1.7, 7)
        signs[5] = sign
        places[5] = JOINT + place * 40 + _EIGHT[table_index(guess)] * 5 + min(midpoint_trust, 4)


@inlined_kernel
def choose_neuron(classes: Classes) -> int:
    """The neuron for all decisions of a vertex: by error, by how much is known, by trust in the mirror image."""
    state = classes[prediction.MIRROR_STATE]
    trust = 0 if state == 0 else (2 if state >= MIRROR_TRUSTED else 1)
    row = (classes[prediction.ERROR_CLASS] >> 1) * 4 + classes[prediction.KNOWN_CLASS]
    return int(row) * 3 + trust


@borrowing_kernel
def look_in_mirror(
    vertex: int,
    rows: Rows,
    partner: int,
    mirror_axis: int,
    mirror_plane: float,
    outcomes: NDArray[np.uint8],
    rings: Rings,
    predictions: Predictions,
    classes: Classes,
) -> None:
    """Set MIRRORED from the partner's image, MIRROR_STATE by what is known of it and of the neighbours' partners."""
    if partner < 0:
        classes[prediction.MIRROR_STATE] = 0
        return
    starts, members, _ = rings
    agreeing = differing = 0
    first = starts[vertex]
    for slot in range(first, min(starts[vertex + 1], first + RING_LIMIT)):
        outcome = outcomes[members[slot]]
        agreeing += outcome == AGREES
        differing += outcome == DIFFERS
    verdict = 3
    if agreeing + differing > 0:
        verdict = 0 if differing > agreeing else (1 if differing > 0 else 2)
    for axis in range(3):
        image = rows[partner, axis]
        if axis == mirror_axis:
            image = mirror_plane - image
        predictions[prediction.MIRRORED + axis] = image - rows[vertex, axis]
    known = rows[partner, prediction.KNOWN] > 0.0
    classes[prediction.MIRROR_STATE] = 1 + verdict + (4 if known else 0)


@borrowing_kernel
def compare_with_image(
    vertex: int, partner: int, moved: Rows, predictions: Predictions, outcomes: NDArray[np.uint8]
) -> None:
    """Note whether a vertex, moved by `moved` (3,), lies where its partner's image has put it."""
    agrees = True
    for axis in range(3):
        if abs(predictions[prediction.MIRRORED + axis] - moved[axis]) > _PARTNER_SLACK:
            agrees = False
    outcome = AGREES if agrees else DIFFERS
    outcomes[vertex] = outcome
    if outcomes[partner] == UNDECIDED:
        outcomes[partner] = outcome


@kernel
def code_diff(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    rows: Rows,
    owners: NDArray[np.int32],
    targets: NDArray[np.int32],
    rings: Rings,
    across: NDArray[np.int32],
    begin: int,
    end: int,
    mirror_axis: int,
    mirror_plane: float,
    partners: NDArray[np.int32],
    outcomes: NDArray[np.uint8],
) -> None:
    """Code the next bits of the vertices `owners`, all in [begin, end); `rows` and `outcomes` are kept up to date.

    targets (len(owners), 3) are cells of the depth being coded: read when encoding, written when decoding.
    mirror_axis is -1 without symmetry, and partners and outcomes are not looked at then; partners hold a vertex in
    [begin, end) or -1. Vertices out of [begin, end) are never changed.
    """
    offsets = np.zeros((RING_LIMIT, 4))
    moved = np.zeros(3)
    predictions = np.zeros(prediction.PREDICTIONS)
    classes = np.zeros(prediction.CLASSES, np.int64)
    places = np.zeros(INPUTS, np.int64)
    signs = np.zeros(INPUTS, np.int64)
    _code_vertices(
        coder,
        buffer,
        contexts,
        weights,
        rows,
        owners,
        targets,
        rings,
        across,
        begin,
        end,
        mirror_axis,
        mirror_plane,
        partners,
        outcomes,
        offsets,
        moved,
        predictions,
        classes,
        places,
        signs,
    )


@borrowing_kernel
def _code_vertices(
    coder: Coder,
    buffer: Buffer,
    contexts: Contexts,
    weights: Weights,
    rows: Rows,
    owners: NDArray[np.int32],
    targets: NDArray[np.int32],
    rings: Rings,
    across: NDArray[np.int32],
    begin: int,
    end: int,
    mirror_axis: int,
    mirror_plane: float,
    partners: NDArray[np.int32],
    outcomes: NDArray[np.uint8],
    offsets: Rows,
    moved: Rows,
    predictions: Predictions,
    classes: Classes,
    places: Opinions,
    signs: Opinions,
) -> None:
    """`code_diff`, with its scratch given."""
    starts, members, closed = rings
    prediction.set_laplacians(rows, begin, end, starts, members)
    for index in range(len(owners)):
        vertex = owners[index]
        turned = closed[vertex] != 0
        first = starts[vertex]
        count = prediction.gather_ring(vertex, rows, starts, members, offsets, predictions, classes)
        prediction.fit_plane(count, turned, offsets, predictions, classes)
        askable = count if starts[vertex + 1] - first <= RING_LIMIT else 0
        prediction.guess_in_ring(askable, turned, offsets, predictions, classes)
        prediction.guess_midpoints(askable, turned, offsets, predictions, classes)
        prediction.guess_across(vertex, askable, rows, across, first, offsets, predictions, classes)
        if mirror_axis >= 0:
            partner = partners[vertex]
            look_in_mirror(vertex, rows, partner, mirror_axis, mirror_plane, outcomes, rings, predictions, classes)
        neuron = choose_neuron(classes)
        carried = 0.0
        error = 0.0
        for order in range(3):
            axis = classes[prediction.AXES + order]
            plane = plane_offset(axis, predictions, carried)
            set_contexts(axis, plane, predictions, classes, mirror_axis, places, signs)
            middle = rows[vertex, axis]
            given = 1 if 2 * targets[index, axis] + 1 > middle else 0
            bit = code_mixed_bit(coder, buffer, contexts, weights, neuron, places, signs, RATE, LIMIT, given)
            step = 2.0 * bit - 1.0
            error += abs(step - predictions[prediction.SMOOTHED + axis])
            carried += (step - predictions[prediction.PLANE + axis]) * predictions[prediction.NORMAL + axis]
            moved[axis] = step
            targets[index, axis] = (int(middle) + (1 if bit else -1)) >> 1
        for axis in range(3):
            rows[vertex, axis] += moved[axis]
        rows[vertex, prediction.KNOWN] = 1.0
        rows[vertex, prediction.ERROR] = error / 3.0
        if mirror_axis >= 0 and classes[prediction.MIRROR_STATE] > 4:
            compare_with_image(vertex, partners[vertex], moved, predictions, outcomes)
