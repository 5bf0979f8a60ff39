"""The Diff coder where Diffs are coded deeply: the walk and the predictions of `diff_kernels`, and more of both.

To the predictions of effort default come a quadratic surface through two rings and the midpoints of all pairs of
neighbours; each decision is mixed deeply (`entropy.deep_mixing_kernels`) from what `diff_deep_context_kernels` says.
O(two rings) per vertex.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact import diff_deep_context_kernels as deep
from meshtide_codec.compact import diff_kernels as default
from meshtide_codec.compact import diff_prediction_kernels as prediction
from meshtide_codec.compact import surface_fit_kernels as fit
from meshtide_codec.compact.ring_kernels import RING_LIMIT
from meshtide_codec.compilation import borrowing_kernel, kernel
from meshtide_codec.entropy.deep_mixing_kernels import code_deep_bit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.diff_prediction_kernels import Classes, Predictions, Rows
    from meshtide_codec.compact.ring_kernels import Rings
    from meshtide_codec.entropy.deep_mixing_kernels import Inputs, Mixer
    from meshtide_codec.entropy.mixing_kernels import Opinions
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

    Scratch = tuple[
        Rows, Rows, Rows, Rows, Rows, Rows, Predictions, Classes, Opinions, Opinions, Inputs, Opinions, Inputs
    ]

RATE = 17

_NO_ERROR = -1.0  # surface error of a vertex that this bit plane has not coded
_OWN_SHARE = 0.5  # weight of a vertex' own last error among the errors of the surface at its neighbours
_OWN_SCALE = 0.7
_SLANT = 0.15


@kernel
def code_diff_deeply(
    coder: Coder,
    buffer: Buffer,
    mixer: Mixer,
    rows: Rows,
    owners: NDArray[np.int32],
    ages: NDArray[np.int64],
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
    """`diff_kernels.code_diff`, deeply; `ages` (len(owners),): depths since each became a leaf, from 1."""
    scratch = (
        np.zeros((RING_LIMIT, 4)),  # offsets
        np.zeros((fit.PATCH_LIMIT, 4)),  # patch
        np.zeros((fit.TERMS, fit.TERMS)),  # matrix
        np.zeros(fit.TERMS),  # solution
        np.zeros(3),  # surface
        np.zeros(3),  # moved
        np.zeros(deep.PREDICTIONS),
        np.zeros(deep.CLASSES, np.int64),
        np.zeros(deep.HEARD_CONTEXTS, np.int64),  # places
        np.zeros(deep.HEARD_CONTEXTS, np.int64),  # signs
        np.zeros(deep.INPUTS, np.int32),
        np.zeros(deep.CHOICES, np.int64),  # neurons
        np.zeros(deep.CHOICES, np.int32),  # outputs
    )
    predictions, classes, moved = scratch[6], scratch[7], scratch[5]
    stamps = np.full(len(rows), -1, np.int32)
    surface_errors = np.full(len(rows), _NO_ERROR)
    prediction.set_laplacians(rows, begin, end, rings[0], rings[1])
    for index in range(len(owners)):
        vertex = owners[index]
        classes[deep.AGE] = min(ages[index], 8) - 1
        height = _predict(vertex, rows, rings, across, stamps, surface_errors, scratch)
        partner = -1
        if mirror_axis >= 0:
            partner = partners[vertex]
            default.look_in_mirror(
                vertex, rows, partner, mirror_axis, mirror_plane, outcomes, rings, predictions, classes
            )
        surface_errors[vertex] = _code_vertex(
            coder, buffer, mixer, rows[vertex], targets[index], height, mirror_axis, scratch
        )
        if classes[prediction.MIRROR_STATE] > 4:
            default.compare_with_image(vertex, partner, moved, predictions, outcomes)


@borrowing_kernel
def _predict(
    vertex: int,
    rows: Rows,
    rings: Rings,
    across: NDArray[np.int32],
    stamps: NDArray[np.int32],
    surface_errors: NDArray[np.float64],
    scratch: Scratch,
) -> float:
    """Set all predictions and classes but those of the mirror; returns the quadratic surface's height, or 0."""
    starts, members, closed = rings
    offsets, patch, matrix, solution, surface, _, predictions, classes, _, _, _, _, _ = scratch
    turned = closed[vertex] != 0
    first = starts[vertex]
    count = prediction.gather_ring(vertex, rows, starts, members, offsets, predictions, classes)
    prediction.fit_plane(count, turned, offsets, predictions, classes)
    askable = count if starts[vertex + 1] - first <= RING_LIMIT else 0
    prediction.guess_in_ring(askable, turned, offsets, predictions, classes)
    prediction.guess_midpoints(askable, turned, offsets, predictions, classes)
    prediction.guess_across(vertex, askable, rows, across, first, offsets, predictions, classes)
    deep.guess_pairs(count, offsets, predictions, classes)
    size = fit.gather_patch(vertex, count, rows, starts, members, stamps, patch)
    classes[deep.VALENCE] = min(count, 15)
    for axis in range(3):
        below = above = 0
        for place in range(size):
            below += patch[place, axis] == -1.0
            above += patch[place, axis] == 1.0
        classes[deep.FAR_BELOW + axis] = below
        classes[deep.FAR_ABOVE + axis] = above
    normal = predictions[prediction.NORMAL : prediction.NORMAL + 3]
    height = 0.0
    surface[:] = 0.0
    classes[deep.QUADRIC_CLASS] = prediction.ERROR_CLASSES - 1
    if normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2] > 0.0:
        error = _OWN_SHARE * _OWN_SCALE * rows[vertex, prediction.ERROR]
        weight = _OWN_SHARE
        length = 0.0
        for place in range(count):
            x, y, z = offsets[place, 0], offsets[place, 1], offsets[place, 2]
            length += np.sqrt(x * x + y * y + z * z)
            neighbour_error = surface_errors[members[first + place]]
            if neighbour_error >= 0.0:
                error += neighbour_error
                weight += 1.0
        height = fit.fit_surface(size, length / count, normal, patch, matrix, solution, surface)
        classes[deep.QUADRIC_CLASS] = min(prediction.error_class(error / weight), prediction.ERROR_CLASSES - 2)
    along = height
    for axis in range(3):
        along -= surface[axis] * predictions[prediction.SMOOTHED + axis]
    for axis in range(3):
        predictions[deep.SURFACE + axis] = surface[axis]
        predictions[deep.QUADRIC + axis] = predictions[prediction.SMOOTHED + axis] + along * surface[axis]
    return height


@borrowing_kernel
def _code_vertex(
    coder: Coder,
    buffer: Buffer,
    mixer: Mixer,
    row: NDArray[np.float64],
    target: NDArray[np.int32],
    height: float,
    mirror_axis: int,
    scratch: Scratch,
) -> float:
    """Three decisions, and what follows from them; returns how far the vertex lies from the quadratic surface."""
    _, _, _, _, surface, moved, predictions, classes, places, signs, inputs, neurons, outputs = scratch
    carried = carried_surface = error = 0.0
    for order in range(3):
        axis = classes[prediction.AXES + order]
        plane = default.plane_offset(axis, predictions, carried)
        quadric = predictions[deep.QUADRIC + axis]
        quadric -= carried_surface * surface[axis] / (surface[axis] * surface[axis] + _SLANT)
        default.set_contexts(axis, plane, predictions, classes, mirror_axis, places, signs)
        deep.set_deep_contexts(axis, quadric, predictions, classes, places, signs)
        deep.set_numbers(axis, plane, quadric, predictions, inputs)
        deep.choose_neurons(order, axis, predictions, classes, neurons)
        middle = row[axis]
        given = 1 if 2 * target[axis] + 1 > middle else 0
        bit = code_deep_bit(
            coder,
            buffer,
            mixer,
            neurons,
            order * 8 + classes[deep.AGE],
            classes[deep.QUADRIC_CLASS],
            places,
            signs,
            inputs,
            outputs,
            RATE,
            given,
        )
        step = 2.0 * bit - 1.0
        error += abs(step - predictions[prediction.SMOOTHED + axis])
        carried += (step - predictions[prediction.PLANE + axis]) * predictions[prediction.NORMAL + axis]
        carried_surface += (step - predictions[deep.QUADRIC + axis]) * surface[axis]
        moved[axis] = step
        target[axis] = (int(middle) + (1 if bit else -1)) >> 1
    missed = -height
    for axis in range(3):
        row[axis] += moved[axis]
        missed += moved[axis] * surface[axis]
    row[prediction.KNOWN] = 1.0
    row[prediction.ERROR] = error / 3.0
    return abs(missed)
