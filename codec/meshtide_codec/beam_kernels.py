"""Kernels of beams: tight bounds of long thin triangles, where boxes along the axes are loose.

Thousands of slivers around one vertex, or along a turned cylinder, have boxes that all hold the same points, and a
search among boxes alone visits most of them. A beam is the set of points within a radius of a line. A node of the
search tree gets one if its triangles fit a beam that is much thinner than the box of the node: then a wedge of a fan
keeps away all points outside of its angle. In the spirit of Gottschalk, Lin, Manocha, "OBBTree: a hierarchical
structure for rapid interference detection", SIGGRAPH 1996, but only where it pays. O(m) without slivers; with them
O(m) for each depth of the tree.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compilation import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compilation import Integer

    Points = NDArray[np.float64]
    Integers = NDArray[np.int32]

NONE = -1
LINK = 0  # of an inner node: its second child, the first one follows it; of a leaf: its first triangle
COUNT = 1  # of a leaf: its triangles; 0 in inner nodes
BEAM = 2  # row of the node's beam, or NONE
LINK_COLUMNS = 3

BEAM_SIZE = 7  # a point of the line, its direction of length 1, the radius
RADIUS = 6

THIN = 8.0  # diagonals of a node's box are at least so many radii long
SPANNED = 4.0  # and at most so many longest edges
WORTH = 4.0  # a beam pays where the second longest side of the box is so many radii
ROUNDING = 1e-9  # of lengths: what is left of a beam to be sure that no triangle sticks out


@kernel
def find_beams(vertices: Points, faces: Integers, links: Integers, boxes: Points) -> Points:
    """Give beams to the nodes of a tree where they pay, and return them, (k, BEAM_SIZE).

    Children stand behind their parents; a node's triangles are consecutive.
    """
    nodes = len(links)
    first = np.empty(nodes, np.int32)
    end = np.empty(nodes, np.int32)
    longest = np.empty(nodes, np.int32)  # corner (3 face + corner) where the node's longest edge begins
    thin = np.zeros(nodes, np.bool_)
    beams = np.empty((nodes, BEAM_SIZE))
    count = 0
    for node in range(nodes - 1, -1, -1):
        links[node, BEAM] = NONE
        if links[node, COUNT]:
            first[node] = links[node, LINK]
            end[node] = first[node] + links[node, COUNT]
            longest[node] = 3 * first[node]
            for slot in range(3 * first[node], 3 * end[node]):
                if _squared_length(vertices, faces, slot) > _squared_length(vertices, faces, longest[node]):
                    longest[node] = slot
        else:
            second = links[node, LINK]
            first[node] = first[node + 1]
            end[node] = end[second]
            longest[node] = longest[node + 1]
            if _squared_length(vertices, faces, longest[second]) > _squared_length(vertices, faces, longest[node]):
                longest[node] = longest[second]
            if not (thin[node + 1] or thin[second]):
                continue
        diagonal, middle_side = _sides(boxes, node)
        length = np.sqrt(_squared_length(vertices, faces, longest[node]))
        if diagonal == 0.0 or diagonal > SPANNED * length:
            continue
        _aim(vertices, faces, longest[node], length, beams[count])
        radius = _radius(vertices, faces, first[node], end[node], beams[count], diagonal / THIN)
        thin[node] = radius <= diagonal / THIN
        if thin[node] and middle_side >= WORTH * radius:
            beams[count, RADIUS] = radius + ROUNDING * diagonal
            links[node, BEAM] = count
            count += 1
    return beams[:count].copy()


@kernel
def squared_distance_to_beam(beams: Points, beam: Integer, x: float, y: float, z: float) -> float:
    """The square of a distance that all triangles of a beam have at least from a point."""
    px, py, pz = x - beams[beam, 0], y - beams[beam, 1], z - beams[beam, 2]
    dx, dy, dz = beams[beam, 3], beams[beam, 4], beams[beam, 5]
    along = px * dx + py * dy + pz * dz
    px, py, pz = px - along * dx, py - along * dy, pz - along * dz
    distance = np.sqrt(px * px + py * py + pz * pz) - beams[beam, RADIUS] - ROUNDING * abs(along)
    return float(distance * distance) if distance > 0.0 else 0.0


@kernel
def _squared_length(vertices: Points, faces: Integers, slot: Integer) -> float:
    """Squared length of the edge that begins at corner `slot` (3 face + corner)."""
    face, corner = slot // 3, slot % 3
    start, end = faces[face, corner], faces[face, (corner + 1) % 3]
    total = 0.0
    for axis in range(3):
        total += (vertices[end, axis] - vertices[start, axis]) * (vertices[end, axis] - vertices[start, axis])
    return total


@kernel
def _sides(boxes: Points, node: Integer) -> tuple[float, float]:
    """The diagonal of a node's box, and the second longest of its sides."""
    x, y, z = boxes[node, 3] - boxes[node, 0], boxes[node, 4] - boxes[node, 1], boxes[node, 5] - boxes[node, 2]
    return float(np.sqrt(x * x + y * y + z * z)), float(max(min(x, y), min(max(x, y), z)))


@kernel
def _aim(vertices: Points, faces: Integers, slot: Integer, length: float, beam: Points) -> None:
    """Lay a beam's line through the edge that begins at corner `slot`."""
    face, corner = slot // 3, slot % 3
    start, end = faces[face, corner], faces[face, (corner + 1) % 3]
    for axis in range(3):
        beam[axis] = vertices[start, axis]
        beam[3 + axis] = (vertices[end, axis] - vertices[start, axis]) / length


@kernel
def _radius(vertices: Points, faces: Integers, first: Integer, end: Integer, beam: Points, limit: float) -> float:
    """The largest distance of triangles' corners from a line; when it is beyond `limit`, any number beyond it."""
    squared_limit = limit * limit
    largest = 0.0
    for face in range(first, end):
        for corner in range(3):
            vertex = faces[face, corner]
            px, py, pz = vertices[vertex, 0] - beam[0], vertices[vertex, 1] - beam[1], vertices[vertex, 2] - beam[2]
            along = px * beam[3] + py * beam[4] + pz * beam[5]
            px, py, pz = px - along * beam[3], py - along * beam[4], pz - along * beam[5]
            largest = max(largest, px * px + py * py + pz * pz)
        if largest > squared_limit:
            return float(2.0 * limit)
    return float(np.sqrt(largest))
