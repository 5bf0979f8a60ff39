"""Kernels of the closest-point search: a tree of boxes over triangles, walked nearest box first.

Triangles are sorted along a Morton curve and cut into leaves of a few; the tree over the leaves is a heap without
pointers, so it is built in one pass from the leaves up. Distances are those of real points of the triangles, found
among the interior and the three sides: triangles without area, and points as triangles of one corner, need no case
of their own. Building is O(m log m), a search O(log m) on surfaces. Plain doubles in a fixed order: the same bits on
every machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer

    Points = NDArray[np.float64]
    Tree = tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]  # vertices, faces along the curve, boxes
    Found = tuple[float, Integer, float, float]  # squared distance, place of the face, weights of its later corners

LEAF_SIZE = 2  # triangles: the least time for building and searching together
STACK_SIZE = 128  # a heap of 2^31 leaves is 32 deep and leaves one box a step behind
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
def build_boxes(vertices: Points, faces: NDArray[np.int32]) -> Points:
    """Boxes (2 leaves, 6) of a heap over `faces` in the order of the curve: node i has the children 2i and 2i + 1.

    Nodes from `leaves` on are the leaves, LEAF_SIZE triangles each; node 0 is not used.
    """
    leaves = (len(faces) + LEAF_SIZE - 1) // LEAF_SIZE
    boxes = np.empty((2 * leaves, 6))
    for leaf in range(leaves):
        node = leaves + leaf
        for axis in range(3):
            low, high = np.inf, -np.inf
            for face in range(leaf * LEAF_SIZE, min(len(faces), (leaf + 1) * LEAF_SIZE)):
                for corner in range(3):
                    coordinate = vertices[faces[face, corner], axis]
                    low = min(low, coordinate)
                    high = max(high, coordinate)
            boxes[node, axis] = low
            boxes[node, 3 + axis] = high
    for node in range(leaves - 1, 0, -1):
        for axis in range(3):
            boxes[node, axis] = min(boxes[2 * node, axis], boxes[2 * node + 1, axis])
            boxes[node, 3 + axis] = max(boxes[2 * node, 3 + axis], boxes[2 * node + 1, 3 + axis])
    return boxes


@kernel
def _squared_distance_to_box(boxes: Points, node: Integer, x: float, y: float, z: float) -> float:
    dx = max(boxes[node, 0] - x, x - boxes[node, 3], 0.0)
    dy = max(boxes[node, 1] - y, y - boxes[node, 4], 0.0)
    dz = max(boxes[node, 2] - z, z - boxes[node, 5], 0.0)
    return float(dx * dx + dy * dy + dz * dz)


@kernel
def closest_on_triangle(
    vertices: Points, faces: NDArray[np.int32], face: Integer, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Squared distance of a point to a triangle, and the weights of the second and third corner in its closest point."""
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
) -> Found:
    """The closest triangle, or the first found that is no farther than the square root of `enough`.

    The search begins in the leaf of the triangle at place `hint` and climbs to the root, looking into the siblings on
    the way that are closer than what was found: short when the hint is near.
    """
    leaf = len(tree[2]) // 2 + hint // LEAF_SIZE
    found = _search_below(tree, leaf, x, y, z, (np.inf, hint, 0.0, 0.0), enough, nodes, bounds)
    while leaf > 1 and found[0] > enough:
        if _squared_distance_to_box(tree[2], leaf ^ 1, x, y, z) < found[0]:
            found = _search_below(tree, leaf ^ 1, x, y, z, found, enough, nodes, bounds)
        leaf >>= 1
    return found


@kernel
def _search_below(
    tree: Tree,
    root: Integer,
    x: float,
    y: float,
    z: float,
    found: Found,
    enough: float,
    nodes: NDArray[np.int64],
    bounds: Points,
) -> Found:
    """The closest triangle below the node `root`, nearest boxes first, or `found` when none is closer."""
    vertices, faces, boxes = tree
    leaves = len(boxes) // 2
    best, place, second, third = found
    nodes[0] = root
    bounds[0] = 0.0
    height = 1
    while height > 0 and best > enough:
        height -= 1
        node = nodes[height]
        if bounds[height] >= best:
            continue
        while node < leaves:
            near, far = 2 * node, 2 * node + 1
            near_bound = _squared_distance_to_box(boxes, near, x, y, z)
            far_bound = _squared_distance_to_box(boxes, far, x, y, z)
            if far_bound < near_bound:
                near, far = far, near
                near_bound, far_bound = far_bound, near_bound
            if far_bound < best:
                nodes[height] = far
                bounds[height] = far_bound
                height += 1
            if near_bound >= best:
                break
            node = near
        if node < leaves:
            continue
        first = (node - leaves) * LEAF_SIZE
        for face in range(first, min(first + LEAF_SIZE, len(faces))):
            squared, v, w = closest_on_triangle(vertices, faces, face, x, y, z)
            if squared < best:
                best, place, second, third = squared, face, v, w
    return best, place, second, third


@kernel
def closest(tree: Tree, points: Points, squared_distances: Points, places: NDArray[np.int32], weights: Points) -> None:
    """For each point (k, 3): squared distance, place of the closest triangle, (k, 3) weights of its corners.

    Neighbours in space that are neighbours in the list are found fast: each search begins with the last one's result.
    """
    nodes = np.empty(STACK_SIZE, np.int64)
    bounds = np.empty(STACK_SIZE)
    place = 0
    for point in range(len(points)):
        squared, place, second, third = _search(
            tree, points[point, 0], points[point, 1], points[point, 2], place, 0.0, nodes, bounds
        )
        squared_distances[point] = squared
        places[point] = place
        weights[point, 0] = 1.0 - second - third
        weights[point, 1] = second
        weights[point, 2] = third


@kernel
def total_and_largest(tree: Tree, points: Points) -> tuple[float, float]:
    """Sum and maximum of the squared distances of points (k, 3)."""
    nodes = np.empty(STACK_SIZE, np.int64)
    bounds = np.empty(STACK_SIZE)
    place = 0
    total, largest = 0.0, 0.0
    for point in range(len(points)):
        squared, place, _, _ = _search(
            tree, points[point, 0], points[point, 1], points[point, 2], place, 0.0, nodes, bounds
        )
        total += squared
        largest = max(largest, squared)
    return total, largest


@kernel
def largest_above(tree: Tree, points: Points, floor: float) -> float:
    """The largest of `floor` and the squared distances of points (k, 3).

    A search ends as soon as it is clear that the point is not farther than the farthest so far.
    """
    nodes = np.empty(STACK_SIZE, np.int64)
    bounds = np.empty(STACK_SIZE)
    place = 0
    largest = floor
    for point in range(len(points)):
        squared, place, _, _ = _search(
            tree, points[point, 0], points[point, 1], points[point, 2], place, largest, nodes, bounds
        )
        largest = max(largest, squared)
    return largest


@kernel
def vertices_along(faces: NDArray[np.int32], vertex_count: Integer) -> NDArray[np.int32]:
    """The vertices that the faces use, each once, in the order of their first faces, which are in range."""
    seen = np.zeros(vertex_count, np.bool_)
    order = np.empty(vertex_count, np.int32)
    count = 0
    for face in range(len(faces)):
        for corner in range(3):
            vertex = faces[face, corner]
            if not seen[vertex]:
                seen[vertex] = True
                order[count] = vertex
                count += 1
    return order[:count].copy()


@kernel
def sample_triangles(vertices: Points, faces: NDArray[np.int32], numbers: Points) -> Points:
    """Points (k, 3) on the triangles, evenly by area, in the triangles' order; by count when none has any area.

    Args:
        vertices: (n, 3).
        faces: (m, 3), m >= 1, indices in range.
        numbers: (3, k) random numbers in [0, 1): the place in the sample's share of area, and two in the triangle.
    """
    count = numbers.shape[1]
    ends = np.empty(len(faces))
    total = 0.0
    for face in range(len(faces)):
        total += _area(vertices, faces, face)
        ends[face] = total
    if total == 0.0:
        for face in range(len(faces)):
            ends[face] = face + 1.0
        total = float(len(faces))
    points = np.empty((count, 3))
    face = 0
    for sample in range(count):
        target = (sample + numbers[0, sample]) * (total / count)
        while face < len(faces) - 1 and ends[face] < target:
            face += 1
        root = np.sqrt(numbers[1, sample])
        second = root * (1.0 - numbers[2, sample])
        third = root * numbers[2, sample]
        for axis in range(3):
            points[sample, axis] = (
                (1.0 - root) * vertices[faces[face, 0], axis]
                + second * vertices[faces[face, 1], axis]
                + third * vertices[faces[face, 2], axis]
            )
    return points


@kernel
def _area(vertices: Points, faces: NDArray[np.int32], face: Integer) -> float:
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    bx, by, bz = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
    cx, cy, cz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
    nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    return float(0.5 * np.sqrt(nx * nx + ny * ny + nz * nz))
