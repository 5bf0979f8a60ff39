"""Kernels of the closest-point search: a tree of boxes over triangles, walked nearest box first.

Triangles are sorted along a Morton curve, and the tree halves the curve where its keys' uppermost bit changes, until
a few triangles are left (Karras, "Maximizing parallelism in the construction of BVHs, octrees, and k-d trees", High
Performance Graphics 2012, section 3, top down). Distances are those of real points of the triangles, found
among the interior and the three sides: triangles without area, and points as triangles of one corner, need no case
of their own. Long thin triangles are bounded by beams too (`beam_kernels`). Building is O(m log m), a search O(log m)
on surfaces, whatever the shape of their triangles. Plain doubles in a fixed order: the same bits on every machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.beam_kernels import BEAM, COUNT, LINK, LINK_COLUMNS, NONE, find_beams, squared_distance_to_beam
from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer

    Points = NDArray[np.float64]
    Tree = tuple[Points, NDArray[np.int32], NDArray[np.int32], Points, Points]
    """Vertices, faces along the curve, links, boxes, beams."""

LEAF_SIZE = 2  # triangles: the least time for building and searching together
VISITS = 72  # place in the scratch of node numbers where visited nodes are counted
STACK_SIZE = 72  # the tree is no deeper than a key has bits, and one box a step is left behind
PROBES = 32  # searches that tell how long all of them would take
ORDINARY = 100.0  # visited nodes of a search that is no reason to look at fewer points; on surfaces there are about 50
VISITS_ALLOWED = 1e6  # nodes visited in all, about a tenth of a second, before fewer points are looked at
WELL_SHAPED = 1e-10  # (sine of a corner)^2 below which the sides have a say even if the interior seems closest


@kernel
def _spread(value: Integer) -> Integer:
    """The lowest 20 bits of a uint64 with two zeros between neighbours."""
    value &= np.uint64(0xFFFFF)
    value = (value | (value << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
    value = (value | (value << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
    value = (value | (value << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    value = (value | (value << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (value | (value << np.uint64(2))) & np.uint64(0x1249249249249249)


@kernel
def curve_keys(
    vertices: Points, faces: NDArray[np.int32], axis_bits: Integer, index_bits: Integer
) -> NDArray[np.uint64]:
    """(m,) keys that sort the triangles along a Morton curve: the middle's cell, then the triangle's own number."""
    low = np.full(3, np.inf)
    high = np.full(3, -np.inf)
    for face in range(len(faces)):
        for axis in range(3):
            middle = _middle(vertices, faces, face, axis)
            low[axis] = min(low[axis], middle)
            high[axis] = max(high[axis], middle)
    side = max(high[0] - low[0], high[1] - low[1], high[2] - low[2])
    last = float((1 << axis_bits) - 1)
    scale = last / side if side > 0.0 else 0.0
    keys = np.empty(len(faces), np.uint64)
    for face in range(len(faces)):
        code = np.uint64(0)
        for axis in range(3):
            cell = min(last, (_middle(vertices, faces, face, axis) - low[axis]) * scale)
            code = (code << np.uint64(1)) | _spread(np.uint64(cell))
        keys[face] = (code << np.uint64(index_bits)) | np.uint64(face)
    return keys


@kernel
def _middle(vertices: Points, faces: NDArray[np.int32], face: Integer, axis: Integer) -> float:
    total = vertices[faces[face, 0], axis] + vertices[faces[face, 1], axis] + vertices[faces[face, 2], axis]
    return float(total / 3.0)


@kernel
def build_tree(
    vertices: Points, faces: NDArray[np.int32], keys: NDArray[np.uint64]
) -> tuple[NDArray[np.int32], Points, Points]:
    """Links (nodes, 3), boxes (nodes, 6: lowest, highest corner) and beams of the tree over faces in their keys' order.

    The keys (m,) are strictly increasing, m >= 1. The root is node 0.
    """
    links = np.empty((2 * len(faces), LINK_COLUMNS), np.int32)
    ranges = np.empty((STACK_SIZE, 3), np.int64)  # first face, end, node that it is the second child of
    ranges[0, 0] = 0
    ranges[0, 1] = len(faces)
    ranges[0, 2] = -1
    height = 1
    nodes = 0
    while height > 0:
        height -= 1
        first, end = ranges[height, 0], ranges[height, 1]
        if ranges[height, 2] >= 0:
            links[ranges[height, 2], LINK] = nodes
        if end - first <= LEAF_SIZE:
            links[nodes, LINK] = first
            links[nodes, COUNT] = end - first
        else:
            middle = _split(keys, first, end)
            links[nodes, COUNT] = 0
            ranges[height, 0] = middle
            ranges[height, 2] = nodes
            ranges[height + 1, 0] = first
            ranges[height + 1, 1] = middle
            ranges[height + 1, 2] = -1
            height += 2
        nodes += 1
    boxes = np.empty((nodes, 6))
    for node in range(nodes - 1, -1, -1):
        _enclose(vertices, faces, links, boxes, node)
    used = links[:nodes].copy()
    return used, boxes, find_beams(vertices, faces, used, boxes)


@kernel
def _split(keys: NDArray[np.uint64], first: Integer, end: Integer) -> Integer:
    """Where the uppermost bit changes in which the keys of a range differ."""
    difference = keys[first] ^ keys[end - 1]
    bit = np.uint64(1)
    while difference > np.uint64(1):
        difference >>= np.uint64(1)
        bit <<= np.uint64(1)
    low, high = first, end - 1
    while low < high:
        middle = (low + high) // 2
        if keys[middle] & bit:
            high = middle
        else:
            low = middle + 1
    return low


@kernel
def _enclose(
    vertices: Points, faces: NDArray[np.int32], links: NDArray[np.int32], boxes: Points, node: Integer
) -> None:
    """Make the box of a node around its triangles, or its children's boxes, which come later in the list."""
    if links[node, COUNT] == 0:
        second = links[node, LINK]
        for axis in range(3):
            boxes[node, axis] = min(boxes[node + 1, axis], boxes[second, axis])
            boxes[node, 3 + axis] = max(boxes[node + 1, 3 + axis], boxes[second, 3 + axis])
        return
    for axis in range(3):
        low, high = np.inf, -np.inf
        for face in range(links[node, LINK], links[node, LINK] + links[node, COUNT]):
            for corner in range(3):
                coordinate = vertices[faces[face, corner], axis]
                low = min(low, coordinate)
                high = max(high, coordinate)
        boxes[node, axis] = low
        boxes[node, 3 + axis] = high


@kernel
def _squared_distance_to_box(boxes: Points, node: Integer, x: float, y: float, z: float) -> float:
    dx = max(boxes[node, 0] - x, x - boxes[node, 3], 0.0)
    dy = max(boxes[node, 1] - y, y - boxes[node, 4], 0.0)
    dz = max(boxes[node, 2] - z, z - boxes[node, 5], 0.0)
    return float(dx * dx + dy * dy + dz * dz)


@kernel
def _bound(
    links: NDArray[np.int32], boxes: Points, beams: Points, node: Integer, x: float, y: float, z: float
) -> float:
    """The square of a distance that all triangles of a node have at least from a point."""
    squared = _squared_distance_to_box(boxes, node, x, y, z)
    if links[node, BEAM] != NONE:
        squared = max(squared, squared_distance_to_beam(beams, links[node, BEAM], x, y, z))
    return squared


@kernel
def closest_on_triangle(
    vertices: Points, faces: NDArray[np.int32], face: Integer, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Squared distance of a point to a triangle, and the weights of the last two corners in the closest point."""
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
    bx, by, bz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
    cx, cy, cz = vertices[c, 0] - ax, vertices[c, 1] - ay, vertices[c, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    bb = bx * bx + by * by + bz * bz
    bc = bx * cx + by * cy + bz * cz
    cc = cx * cx + cy * cy + cz * cz
    pb = px * bx + py * by + pz * bz
    pc = px * cx + py * cy + pz * cz
    best, second, third = np.inf, 0.0, 0.0
    determinant = bb * cc - bc * bc
    if determinant > 0.0:
        v = (cc * pb - bc * pc) / determinant
        w = (bb * pc - bc * pb) / determinant
        if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
            dx, dy, dz = px - v * bx - w * cx, py - v * by - w * cy, pz - v * bz - w * cz
            best, second, third = dx * dx + dy * dy + dz * dz, v, w
            if determinant > WELL_SHAPED * bb * cc:
                return best, second, third
    along = min(1.0, max(0.0, pb / bb)) if bb > 0.0 else 0.0
    dx, dy, dz = px - along * bx, py - along * by, pz - along * bz
    squared = dx * dx + dy * dy + dz * dz
    if squared < best:
        best, second, third = squared, along, 0.0
    along = min(1.0, max(0.0, pc / cc)) if cc > 0.0 else 0.0
    dx, dy, dz = px - along * cx, py - along * cy, pz - along * cz
    squared = dx * dx + dy * dy + dz * dz
    if squared < best:
        best, second, third = squared, 0.0, along
    ex, ey, ez = cx - bx, cy - by, cz - bz
    qx, qy, qz = px - bx, py - by, pz - bz
    length = ex * ex + ey * ey + ez * ez
    along = min(1.0, max(0.0, (qx * ex + qy * ey + qz * ez) / length)) if length > 0.0 else 0.0
    dx, dy, dz = qx - along * ex, qy - along * ey, qz - along * ez
    squared = dx * dx + dy * dy + dz * dz
    if squared < best:
        best, second, third = squared, 1.0 - along, along
    return best, second, third


@kernel
def _search(
    tree: Tree, x: float, y: float, z: float, hint: Integer, enough: float, nodes: NDArray[np.int64], bounds: Points
) -> tuple[float, Integer, float, float]:
    """The closest triangle, or the first found that is no farther than the square root of `enough`.

    Args:
        tree: what to search.
        x: first coordinate of the point.
        y: second.
        z: third.
        hint: place of a triangle to begin with; the search is short when it is close.
        enough: squared distance.
        nodes: scratch of STACK_SIZE + 1; the last element counts visited nodes.
        bounds: scratch of STACK_SIZE.

    Returns:
        the squared distance, the triangle's place, the weights of its second and third corner.
    """
    vertices, faces, links, boxes, beams = tree
    place = hint
    best, second, third = closest_on_triangle(vertices, faces, hint, x, y, z)
    nodes[0] = 0
    bounds[0] = 0.0
    height = 1
    while height > 0 and best > enough:
        height -= 1
        if bounds[height] >= best:
            continue
        node = nodes[height]
        bound = bounds[height]
        while links[node, COUNT] == 0 and bound < best:
            near, far = node + 1, links[node, LINK]
            nodes[VISITS] += 1
            bound = _bound(links, boxes, beams, near, x, y, z)
            far_bound = _bound(links, boxes, beams, far, x, y, z)
            if far_bound < bound:
                near, far = far, near
                bound, far_bound = far_bound, bound
            if far_bound < best:
                nodes[height] = far
                bounds[height] = far_bound
                height += 1
            node = near
        if bound >= best:
            continue
        for face in range(links[node, LINK], links[node, LINK] + links[node, COUNT]):
            squared, v, w = closest_on_triangle(vertices, faces, face, x, y, z)
            if squared < best:
                best, place, second, third = squared, face, v, w
    return best, place, second, third


@kernel
def closest(tree: Tree, points: Points, places: NDArray[np.int32], weights: Points) -> None:
    """For each point (k, 3): the place of the closest triangle, and the weights (k, 3) of its corners.

    Neighbours in space that are neighbours in the list are found fast: each search begins with the last one's result.
    """
    nodes = np.zeros(STACK_SIZE + 1, np.int64)
    bounds = np.empty(STACK_SIZE)
    place = 0
    for point in range(len(points)):
        _, place, second, third = _search(
            tree, points[point, 0], points[point, 1], points[point, 2], place, 0.0, nodes, bounds
        )
        places[point] = place
        weights[point, 0] = max(0.0, 1.0 - second - third)
        weights[point, 1] = second
        weights[point, 2] = third


@kernel
def visits_per_search(tree: Tree, points: Points) -> float:
    """How many nodes a search visits, averaged over PROBES of the points (k, 3), k >= 1."""
    nodes = np.zeros(STACK_SIZE + 1, np.int64)
    bounds = np.empty(STACK_SIZE)
    probes = min(PROBES, len(points))
    for probe in range(probes):
        point = probe * len(points) // probes
        _search(tree, points[point, 0], points[point, 1], points[point, 2], 0, 0.0, nodes, bounds)
    return float(nodes[VISITS] / probes)


@kernel
def _stride(tree: Tree, points: Points) -> Integer:
    """Which of the points to look at: every one, or so many fewer that the search ends in reasonable time."""
    if len(points) == 0:
        return 1
    return 1 + int(visits_per_search(tree, points) * len(points) / max(VISITS_ALLOWED, ORDINARY * len(points)))


@kernel
def mean_and_largest(tree: Tree, points: Points) -> tuple[float, float]:
    """Mean and maximum of the squared distances of points (k, 3), k >= 1, or of a part, see `_stride`."""
    nodes = np.zeros(STACK_SIZE + 1, np.int64)
    bounds = np.empty(STACK_SIZE)
    place, done = 0, 0
    total, largest = 0.0, 0.0
    for point in range(0, len(points), _stride(tree, points)):
        squared, place, _, _ = _search(
            tree, points[point, 0], points[point, 1], points[point, 2], place, 0.0, nodes, bounds
        )
        total += squared
        largest = max(largest, squared)
        done += 1
    return total / done, largest


@kernel
def largest_above(tree: Tree, points: Points, floor: float) -> float:
    """The largest of `floor` and the squared distances of points (k, 3), or of a part, see `_stride`.

    A search ends as soon as it is clear that the point is not farther than the farthest so far.
    """
    nodes = np.zeros(STACK_SIZE + 1, np.int64)
    bounds = np.empty(STACK_SIZE)
    place = 0
    largest = floor
    for point in range(0, len(points), _stride(tree, points)):
        squared, place, _, _ = _search(
            tree, points[point, 0], points[point, 1], points[point, 2], place, largest, nodes, bounds
        )
        largest = max(largest, squared)
    return largest
