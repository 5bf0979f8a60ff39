"""What the Map coder knows of a cell before it codes its children: its neighbours, and its surface's local frame.

All of it comes from reliable data: the centres of the cells of the coarser depth, which of them are leaves and how
old, the triangles of that depth, and the Map so far. O(degree) per cell.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compact.ring_kernels import RING_LIMIT
from meshtide_codec.compilation import borrowing_kernel, inlined_kernel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Scratch = NDArray[np.int64]

# Fields of a cell's survey, an int64 array.
NEIGHBOURS = 0  # ring members looked at, at most RING_LIMIT
LEAF_NEIGHBOURS = 1  # of them, leaves
CODED_NEIGHBOURS = 2  # of them, cells whose children are already known
CODED_CHILDREN = 3  # children of those
CODED_LEAVES = 4  # leaves among those children
LENGTH = 5  # sum of the neighbours' Manhattan distances, in half cells
MEAN = 6  # three sums of the neighbours' offsets, in half cells
NORMAL_CLASS = 9  # 0..5 by how the normal's components compare, NO_NORMAL when there is none
FLIP = 10  # octant that the canonical order counts down from
AXES = 11  # the three axes, from the normal's largest component to its smallest
CLOSED = 14  # whether the ring is one closed turn
LEAF_AGE = 15  # sum over the leaf neighbours of the depths since they became leaves
SURVEY_SIZE = 16

NORMAL_CLASSES = 7
NO_NORMAL = 6
HEIGHTS = 17  # classes of how far an octant's centre lies above the plane through the neighbours' mean
VOTES = 8  # one number per octant follows in its own array
FACE_NEIGHBOURS = 6  # cells that share a face: -x, +x, -y, +y, -z, +z

_FLAT_NUMERATOR = 19  # an offset counts as flat along an axis when that component is
_FLAT_DENOMINATOR = 100  # below 19 % of its Manhattan length


@inlined_kernel
def vote_for_octants(votes: Scratch, dx: int, dy: int, dz: int, length: int) -> None:
    """Count a neighbour at offset (dx, dy, dz) for the octants of the cell that lie towards it."""
    flat = _FLAT_NUMERATOR * length
    octant = (4 if dx > 0 else 0) | (2 if dy > 0 else 0) | (1 if dz > 0 else 0)
    flat_x = _FLAT_DENOMINATOR * abs(dx) < flat
    flat_y = _FLAT_DENOMINATOR * abs(dy) < flat
    flat_z = _FLAT_DENOMINATOR * abs(dz) < flat
    votes[octant] += 1
    if flat_x:
        votes[octant ^ 4] += 1
        if flat_y:
            votes[octant ^ 6] += 1
        if flat_z:
            votes[octant ^ 5] += 1
    if flat_y:
        votes[octant ^ 2] += 1
        if flat_z:
            votes[octant ^ 3] += 1
    if flat_z:
        votes[octant ^ 1] += 1


@inlined_kernel
def face_side(dx: int, dy: int, dz: int) -> int:
    """0..5 when the offset leads to the cell across a face (-x, +x, -y, +y, -z, +z), else -1."""
    if abs(dx) + abs(dy) + abs(dz) != 2:
        return -1
    if abs(dx) == 2:
        return 1 if dx > 0 else 0
    if abs(dy) == 2:
        return 3 if dy > 0 else 2
    if abs(dz) == 2:
        return 5 if dz > 0 else 4
    return -1


@borrowing_kernel
def survey_neighbours(
    vertex: int,
    centres: NDArray[np.int32],
    leaves: NDArray[np.bool_],
    ages: NDArray[np.uint8],
    rings: tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.uint8]],
    child_counts: NDArray[np.uint8],
    leaf_counts: NDArray[np.uint8],
    survey: Scratch,
    votes: Scratch,
    sides: Scratch,
    offsets: Scratch,
) -> None:
    """Fill `survey`, `votes` and `sides` from the ring of `vertex`; `offsets` (3 RING_LIMIT) gets its offsets.

    Centres are in half cells; the children of vertices below `vertex` are known, as counts per cell.
    """
    starts, members, closed = rings
    survey[:] = 0
    votes[:] = 0
    sides[:] = -1
    begin = int(starts[vertex])
    count = min(int(starts[vertex + 1]) - begin, RING_LIMIT)
    survey[NEIGHBOURS] = count
    survey[CLOSED] = closed[vertex]
    x, y, z = int(centres[vertex, 0]), int(centres[vertex, 1]), int(centres[vertex, 2])
    sum_x = sum_y = sum_z = sum_length = 0
    leaf_neighbours = leaf_age = coded_neighbours = coded_children = coded_leaves = 0
    for place in range(count):
        neighbour = members[begin + place]
        dx, dy, dz = centres[neighbour, 0] - x, centres[neighbour, 1] - y, centres[neighbour, 2] - z
        offsets[3 * place] = dx
        offsets[3 * place + 1] = dy
        offsets[3 * place + 2] = dz
        length = abs(dx) + abs(dy) + abs(dz)
        sum_x += dx
        sum_y += dy
        sum_z += dz
        sum_length += length
        vote_for_octants(votes, dx, dy, dz, length)
        if leaves[neighbour]:
            leaf_neighbours += 1
            leaf_age += ages[neighbour]
            continue
        side = face_side(dx, dy, dz)
        if side >= 0:
            sides[side] = neighbour
        if neighbour < vertex:
            coded_neighbours += 1
            coded_children += child_counts[neighbour]
            coded_leaves += leaf_counts[neighbour]
    survey[MEAN] = sum_x
    survey[MEAN + 1] = sum_y
    survey[MEAN + 2] = sum_z
    survey[LENGTH] = sum_length
    survey[LEAF_AGE] = leaf_age
    survey[LEAF_NEIGHBOURS] = leaf_neighbours
    survey[CODED_NEIGHBOURS] = coded_neighbours
    survey[CODED_CHILDREN] = coded_children
    survey[CODED_LEAVES] = coded_leaves


@borrowing_kernel
def orient_frame(survey: Scratch, offsets: Scratch, heights: Scratch) -> None:
    """Fill the survey's frame from the ring's offsets: normal class, canonical order, and the octants' `heights`.

    The normal is the sum of the cross products of consecutive offsets, turned so that the neighbours' mean lies on
    its positive side. In the canonical order octant i has, for the largest, middle and smallest component of the
    normal, the bits 4, 2 and 1 of i; set bits mean the side away from the surface offset.
    """
    count = survey[NEIGHBOURS]
    normal_x = normal_y = normal_z = 0
    if count > 2:
        last = 3 * (count - 1) if survey[CLOSED] else 0
        before_x, before_y, before_z = offsets[last], offsets[last + 1], offsets[last + 2]
        for place in range(0 if survey[CLOSED] else 1, count):
            x, y, z = offsets[3 * place], offsets[3 * place + 1], offsets[3 * place + 2]
            normal_x += before_y * z - before_z * y
            normal_y += before_z * x - before_x * z
            normal_z += before_x * y - before_y * x
            before_x, before_y, before_z = x, y, z
    first, second, third = abs(normal_x), abs(normal_y), abs(normal_z)
    total = first + second + third
    survey[NORMAL_CLASS] = NO_NORMAL
    offset = 0.0
    if total > 0:
        half = 0.5 / count
        mean_x = min(max(survey[MEAN] * half, -1.0), 1.0)
        mean_y = min(max(survey[MEAN + 1] * half, -1.0), 1.0)
        mean_z = min(max(survey[MEAN + 2] * half, -1.0), 1.0)
        offset = (normal_x * mean_x + normal_y * mean_y + normal_z * mean_z) / total
    if offset < 0.0:
        offset = -offset
        normal_x, normal_y, normal_z = -normal_x, -normal_y, -normal_z
    positive = (4 if normal_x >= 0 else 0) | (2 if normal_y >= 0 else 0) | (1 if normal_z >= 0 else 0)
    survey[FLIP] = positive ^ 7
    for octant in range(8):
        height = 0.0
        if total > 0:
            side_x = normal_x if octant & 4 else -normal_x
            side_y = normal_y if octant & 2 else -normal_y
            side_z = normal_z if octant & 1 else -normal_z
            height = (side_x + side_y + side_z) / total - 2.0 * offset
        heights[octant] = min(int((height + 3.0) * 4.0), HEIGHTS - 1)
    axis_a, axis_b, axis_c = 0, 1, 2
    if first < second:
        axis_a, axis_b = axis_b, axis_a
        first, second = second, first
    if second < third:
        axis_b, axis_c = axis_c, axis_b
        second, third = third, second
        if first < second:
            axis_a, axis_b = axis_b, axis_a
            first, second = second, first
    survey[AXES] = axis_a
    survey[AXES + 1] = axis_b
    survey[AXES + 2] = axis_c
    if total > 0:
        middle = 3 * second // (first + 1)  # 0..2
        smallest = min(3 * third // (first + 1), middle)
        survey[NORMAL_CLASS] = ((middle * (middle + 1)) >> 1) + smallest


@inlined_kernel
def canonical_octant(rank: int, survey: Scratch) -> int:
    """The octant at place `rank` of the canonical order."""
    octant = 0
    if rank & 4:
        octant |= 4 >> survey[AXES]
    if rank & 2:
        octant |= 4 >> survey[AXES + 1]
    if rank & 1:
        octant |= 4 >> survey[AXES + 2]
    return octant ^ int(survey[FLIP])


@inlined_kernel
def leaf_ratio_class(survey: Scratch) -> int:
    """Quarters of the neighbours that are leaves, 5 when there are no neighbours."""
    if survey[NEIGHBOURS] == 0:
        return 5
    return 4 * int(survey[LEAF_NEIGHBOURS]) // int(survey[NEIGHBOURS])


@inlined_kernel
def quarter_logarithm(total: int, count: int) -> int:
    """floor(4 log2(total / count)), 0 to 15."""
    if count == 0:
        return 0
    value = total / count
    value *= value
    value *= value
    logarithm = 0
    while value >= 2.0 and logarithm < 15:
        value *= 0.5
        logarithm += 1
    return logarithm
