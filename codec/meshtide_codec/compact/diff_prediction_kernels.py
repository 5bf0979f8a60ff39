"""What the Diff coder expects of a vertex before it codes its next bits: positions predicted in several ways.

All positions are in half cells of the depth being coded. A vertex whose bits are coded stands at the middle of the cell
that is known, four half cells wide; its bits will move it by +1 or -1 along each axis. Predictions are offsets from
that middle: the neighbours' mean, filtered; the plane through the neighbours; and three kinds of experts made of
few vertices each, weighted by how well each agrees with the known cell. O(degree) per vertex.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.quantizers import LOGARITHM_ENTRIES, STEPS, half_octave_classes
from meshtide_codec.compact.ring_kernels import RING_LIMIT
from meshtide_codec.compilation import borrowing_kernel, inlined_kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Rows = NDArray[np.float64]
    Predictions = NDArray[np.float64]
    Classes = NDArray[np.int64]

# Columns of the working rows, one row per vertex, float64.
X = 0  # three coordinates
KNOWN = 3  # 1 when the position is exact for this depth, 0 when its bits are still to come
LAPLACIAN = 4  # three coordinates: the neighbours' mean minus the position, when the Diff begins
ERROR = 7  # mean distance by which this vertex was mispredicted lately
ROW_SIZE = 8

# Predicted offsets of the vertex, three coordinates each.
SMOOTHED = 0  # neighbours' mean, filtered and drawn towards the cell's middle
MEAN = 3  # neighbours' mean, filtered
NORMAL = 6  # unit normal of the ring, or zero
PLANE = 9  # SMOOTHED, moved along the normal to where MEAN is
RING = 12  # parallelograms inside the ring
MIDPOINT = 15  # midpoints of opposite ring members
ACROSS = 18  # parallelograms over the edges of the ring
MIRRORED = 21  # the mirror image of the partner
PREDICTIONS = 24

# Classes, int64.
BELOW = 0  # per axis, neighbours at offset -1
LEVEL = 3  # per axis, neighbours at offset 0
ABOVE = 6  # per axis, neighbours at offset +1
ERROR_CLASS = 9
KNOWN_CLASS = 10  # quarters of the neighbours that are known
RING_TRUST = 11  # 0: no expert of that kind, 1: best one agrees, 7: none agrees
MIDPOINT_TRUST = 12
ACROSS_TRUST = 13
AXES = 14  # the axes from the normal's smallest component to its largest
MIRROR_STATE = 17
CLASSES = 18

ERROR_CLASSES = 24
_ERROR_TABLE = half_octave_classes(ERROR_CLASSES, 12)

SMOOTHED_MEAN, SMOOTHED_SPREAD, SMOOTHED_OWN = 0.3, 0.15, 0.35
MEAN_SPREAD = 0.7
_TRUST_SLACK = 0.3
_TRUST_DRIFT = 0.025
FAR = 1e9  # distance of no guess at all


@inlined_kernel
def error_class(error: float) -> int:
    """0..23 by half octaves of the error."""
    return int(_ERROR_TABLE[np.uintp(min(int(error * STEPS), LOGARITHM_ENTRIES - 1))])


@borrowing_kernel
def set_laplacians(rows: Rows, begin: int, end: int, starts: NDArray[np.int32], members: NDArray[np.int32]) -> None:
    """Store the neighbours' mean minus the position for the vertices in [begin, end)."""
    for vertex in range(begin, end):
        x = y = z = 0.0
        first, last = int(starts[vertex]), int(starts[vertex + 1])
        if last > first:
            for slot in range(first, last):
                neighbour = np.uintp(members[np.uintp(slot)])
                x += rows[neighbour, 0]
                y += rows[neighbour, 1]
                z += rows[neighbour, 2]
            share = 1.0 / (last - first)
            x = x * share - rows[vertex, 0]
            y = y * share - rows[vertex, 1]
            z = z * share - rows[vertex, 2]
        rows[vertex, LAPLACIAN] = x
        rows[vertex, LAPLACIAN + 1] = y
        rows[vertex, LAPLACIAN + 2] = z


@borrowing_kernel
def gather_ring(
    vertex: int,
    rows: Rows,
    starts: NDArray[np.int32],
    members: NDArray[np.int32],
    offsets: Rows,
    predictions: Predictions,
    classes: Classes,
) -> int:
    """Collect the ring's offsets (x, y, z, 1 - known) and all that is summed over it; returns its length.

    Sets SMOOTHED, MEAN, the counts, ERROR_CLASS and KNOWN_CLASS.
    """
    row = np.uintp(vertex)
    begin = int(starts[vertex])
    count = min(int(starts[vertex + 1]) - begin, RING_LIMIT)
    x, y, z = rows[row, 0], rows[row, 1], rows[row, 2]
    sum_x = sum_y = sum_z = spread_x = spread_y = spread_z = known = error = 0.0
    below_x = below_y = below_z = level_x = level_y = level_z = above_x = above_y = above_z = 0
    for place in range(count):
        neighbour = np.uintp(members[np.uintp(begin + place)])
        dx, dy, dz = rows[neighbour, 0] - x, rows[neighbour, 1] - y, rows[neighbour, 2] - z
        offsets[place, 0] = dx
        offsets[place, 1] = dy
        offsets[place, 2] = dz
        offsets[place, 3] = 1.0 - rows[neighbour, KNOWN]
        sum_x += dx
        sum_y += dy
        sum_z += dz
        known += rows[neighbour, KNOWN]
        error += rows[neighbour, ERROR]
        spread_x += rows[neighbour, LAPLACIAN]
        spread_y += rows[neighbour, LAPLACIAN + 1]
        spread_z += rows[neighbour, LAPLACIAN + 2]
        below_x += dx == -1.0
        below_y += dy == -1.0
        below_z += dz == -1.0
        level_x += dx == 0.0
        level_y += dy == 0.0
        level_z += dz == 0.0
        above_x += dx == 1.0
        above_y += dy == 1.0
        above_z += dz == 1.0
    classes[BELOW], classes[BELOW + 1], classes[BELOW + 2] = below_x, below_y, below_z
    classes[LEVEL], classes[LEVEL + 1], classes[LEVEL + 2] = level_x, level_y, level_z
    classes[ABOVE], classes[ABOVE + 1], classes[ABOVE + 2] = above_x, above_y, above_z
    classes[ERROR_CLASS] = ERROR_CLASSES - 1
    classes[KNOWN_CLASS] = 0
    share = 0.0
    if count > 0:
        share = 1.0 / count
        classes[ERROR_CLASS] = error_class((error + 0.5 * rows[row, ERROR]) / (count + 0.5))
        classes[KNOWN_CLASS] = int(4.0 * known) // (count + 1)
    set_means(predictions, 0, sum_x * share, spread_x * share, rows[row, LAPLACIAN])
    set_means(predictions, 1, sum_y * share, spread_y * share, rows[row, LAPLACIAN + 1])
    set_means(predictions, 2, sum_z * share, spread_z * share, rows[row, LAPLACIAN + 2])
    return count


@inlined_kernel
def set_means(predictions: Predictions, axis: int, mean: float, spread: float, own: float) -> None:
    """Both filtered means on one axis, from the neighbours' mean offset, mean Laplacian, and the own Laplacian."""
    predictions[SMOOTHED + axis] = SMOOTHED_MEAN * mean - SMOOTHED_SPREAD * spread + SMOOTHED_OWN * own
    predictions[MEAN + axis] = mean - MEAN_SPREAD * spread


@borrowing_kernel
def fit_plane(count: int, closed: bool, offsets: Rows, predictions: Predictions, classes: Classes) -> None:
    """Set NORMAL from the ring's offsets, PLANE, and the order of the axes."""
    normal_x = normal_y = normal_z = 0.0
    if count > 2:
        last = count - 1 if closed else 0
        before_x, before_y, before_z = offsets[last, 0], offsets[last, 1], offsets[last, 2]
        for place in range(0 if closed else 1, count):
            x, y, z = offsets[place, 0], offsets[place, 1], offsets[place, 2]
            normal_x += before_y * z - before_z * y
            normal_y += before_z * x - before_x * z
            normal_z += before_x * y - before_y * x
            before_x, before_y, before_z = x, y, z
        square = normal_x * normal_x + normal_y * normal_y + normal_z * normal_z
        if square > 0.0:
            scale = 1.0 / np.sqrt(square)
            normal_x *= scale
            normal_y *= scale
            normal_z *= scale
    predictions[NORMAL] = normal_x
    predictions[NORMAL + 1] = normal_y
    predictions[NORMAL + 2] = normal_z
    along = (predictions[MEAN] - predictions[SMOOTHED]) * normal_x
    along += (predictions[MEAN + 1] - predictions[SMOOTHED + 1]) * normal_y
    along += (predictions[MEAN + 2] - predictions[SMOOTHED + 2]) * normal_z
    predictions[PLANE] = predictions[SMOOTHED] + along * normal_x
    predictions[PLANE + 1] = predictions[SMOOTHED + 1] + along * normal_y
    predictions[PLANE + 2] = predictions[SMOOTHED + 2] + along * normal_z
    first, second, third = abs(normal_x), abs(normal_y), abs(normal_z)
    axis_a, axis_b, axis_c = 0, 1, 2
    if first > second:
        axis_a, axis_b = 1, 0
        first, second = second, first
    if second > third:
        axis_b, axis_c = axis_c, axis_b
        second, third = third, second
        if first > second:
            axis_a, axis_b = axis_b, axis_a
    classes[AXES] = axis_a
    classes[AXES + 1] = axis_b
    classes[AXES + 2] = axis_c


@inlined_kernel
def trust_class(distance: float) -> int:
    """1 + floor(2 log2(1 + 4 distance)), at most 7."""
    grown = 1.0 + 4.0 * distance
    grown *= grown
    steps = 1
    while grown >= 2.0 and steps < 7:
        grown *= 0.5
        steps += 1
    return steps


@inlined_kernel
def distance_from_agreeing(x: float, y: float, z: float) -> float:
    """How far a guess lies outside of the known cell (two half cells around its middle), squared, plus some drift."""
    far_x, far_y, far_z = abs(x), abs(y), abs(z)
    over_x, over_y, over_z = max(far_x - 2.0, 0.0), max(far_y - 2.0, 0.0), max(far_z - 2.0, 0.0)
    outside = over_x * over_x + over_y * over_y + over_z * over_z
    return 0.25 * outside + _TRUST_DRIFT * (far_x + far_y + far_z)


@inlined_kernel
def guess_weight(distance: float, unknown: float) -> float:
    """Weight of a guess by its distance from agreeing, and by how many of its vertices are not known yet."""
    slack = _TRUST_SLACK + distance
    return 1.0 / (slack * slack * (1.0 + 2.0 * unknown))


@inlined_kernel
def conclude(
    predictions: Predictions,
    which: int,
    classes: Classes,
    trust: int,
    x: float,
    y: float,
    z: float,
    total: float,
    best: float,
) -> None:
    """Store the weighted mean of a kind of guesses, and how far the best one can be trusted (0: there are none)."""
    scale = 0.0
    classes[trust] = 0
    if total > 0.0:
        scale = 1.0 / total
        classes[trust] = trust_class(best)
    predictions[which] = x * scale
    predictions[which + 1] = y * scale
    predictions[which + 2] = z * scale


@borrowing_kernel
def guess_in_ring(count: int, closed: bool, offsets: Rows, predictions: Predictions, classes: Classes) -> None:
    """Set RING: parallelograms of three consecutive ring members, whose fourth corner is the vertex."""
    sum_x = sum_y = sum_z = total = 0.0
    best = FAR
    first, last = (0, count) if closed else (1, count - 1)
    before = count - 1 if closed else 0
    for place in range(first, last):
        after = place + 1 if place + 1 < count else 0
        x = offsets[before, 0] + offsets[after, 0] - offsets[place, 0]
        y = offsets[before, 1] + offsets[after, 1] - offsets[place, 1]
        z = offsets[before, 2] + offsets[after, 2] - offsets[place, 2]
        unknown = offsets[before, 3] + offsets[after, 3] + offsets[place, 3]
        before = place
        distance = distance_from_agreeing(x, y, z)
        weight = guess_weight(distance, unknown)
        sum_x += weight * x
        sum_y += weight * y
        sum_z += weight * z
        total += weight
        best = min(best, distance)
    conclude(predictions, RING, classes, RING_TRUST, sum_x, sum_y, sum_z, total, best)


@borrowing_kernel
def guess_midpoints(count: int, closed: bool, offsets: Rows, predictions: Predictions, classes: Classes) -> None:
    """Set MIDPOINT: midpoints of opposite ring members."""
    sum_x = sum_y = sum_z = total = 0.0
    best = FAR
    half = count >> 1
    for place in range(count if closed and count & 1 else half):
        other = place + half if closed else count - 1 - place
        if other >= count:
            other -= count
        x = 0.5 * (offsets[place, 0] + offsets[other, 0])
        y = 0.5 * (offsets[place, 1] + offsets[other, 1])
        z = 0.5 * (offsets[place, 2] + offsets[other, 2])
        distance = distance_from_agreeing(x, y, z)
        weight = guess_weight(distance, offsets[place, 3] + offsets[other, 3])
        sum_x += weight * x
        sum_y += weight * y
        sum_z += weight * z
        total += weight
        best = min(best, distance)
    conclude(predictions, MIDPOINT, classes, MIDPOINT_TRUST, sum_x, sum_y, sum_z, total, best)


@borrowing_kernel
def guess_across(
    vertex: int,
    count: int,
    rows: Rows,
    across: NDArray[np.int32],
    begin: int,
    offsets: Rows,
    predictions: Predictions,
    classes: Classes,
) -> None:
    """Set ACROSS: parallelograms over the ring's edges, from the vertices across them; `begin` is the first slot."""
    row = np.uintp(vertex)
    own_x, own_y, own_z = rows[row, 0], rows[row, 1], rows[row, 2]
    sum_x = sum_y = sum_z = total = 0.0
    best = FAR
    for place in range(count):
        opposite = across[np.uintp(begin + place)]
        if opposite < 0:
            continue
        far = np.uintp(opposite)
        after = place + 1 if place + 1 < count else 0
        x = offsets[place, 0] + offsets[after, 0] - (rows[far, 0] - own_x)
        y = offsets[place, 1] + offsets[after, 1] - (rows[far, 1] - own_y)
        z = offsets[place, 2] + offsets[after, 2] - (rows[far, 2] - own_z)
        distance = distance_from_agreeing(x, y, z)
        weight = guess_weight(distance, offsets[place, 3] + offsets[after, 3] + 1.0 - rows[far, KNOWN])
        sum_x += weight * x
        sum_y += weight * y
        sum_z += weight * z
        total += weight
        best = min(best, distance)
    conclude(predictions, ACROSS, classes, ACROSS_TRUST, sum_x, sum_y, sum_z, total, best)
