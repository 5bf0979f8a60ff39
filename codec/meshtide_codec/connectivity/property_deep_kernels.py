"""Properties of the candidates at a gate, where faces are coded deeply: nineteen for each, as places in one table.

Besides what `score_kernels` looks at: the angles at the gate's ends, how the face would bend at the edges that it
closes, whether the families of its corners still lack faces, whether another candidate lies in the smallest sphere
through its corners (B. Delaunay, "Sur la sphère vide", 1934), and how far it is from a parallelogram. What is said of
the two ends of a gate shares its places, since a mesh and its mirror image are equally likely.
Cost: O(candidates * min(candidates, SPHERE_LIMIT)) for a gate.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compilation import borrowing_kernel, inlined_kernel, merged_kernel
from meshtide_codec.connectivity import half_edge_kernels as half_edges
from meshtide_codec.connectivity import shape_kernels as shapes
from meshtide_codec.connectivity.candidate_kernels import CLOSINGS, CORNERS, KINDS, NEW_FACE_APEX, STATES

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.connectivity.candidate_kernels import Candidates
    from meshtide_codec.connectivity.coarse_kernels import CoarseMesh
    from meshtide_codec.connectivity.half_edge_kernels import FineMesh
    from meshtide_codec.connectivity.shape_kernels import GateShape

    Point = tuple[float, float, float]
    Properties = NDArray[np.int32]
    Table = NDArray[np.int32]

MOST_FACES = 9  # faces at a candidate are counted up to this
MOST_END_FACES = 7  # and at the ends of a gate
FAMILY_SCAN_LIMIT = 32  # coarse faces around a family that are looked at
MOST_LACKING = 4  # coarse faces without a fine one around a family are counted up to this
SPHERE_LIMIT = 24  # other candidates that are looked for in a sphere
MOST_INSIDE = 4
MOST_NEAR = 2
INNER = 1.0 - 1.0 / 32.0  # squared distances from this share of the squared radius on count as near the sphere
OUTER = 1.0 + 1.0 / 32.0
MARGINS = 16  # classes of the squared distance of the innermost candidate, in eighths of the squared radius
MARGIN_STEPS = 8.0
NO_BEND = shapes.ANGLES  # class of an edge that is not closed

ENDS = 2 * (MOST_END_FACES + 1)  # faces at an end, and whether the edge there is closed
ANGLE_SUMS = 32
HALF_CLASSES = shapes.ANGLES // 4
FAMILY = 3 * (MOST_LACKING + 1)

PROPERTIES = 19

# Where the places of each property start.
KIND = 0
VALENCE = KIND + KINDS * CORNERS
BOTH_ENDS = VALENCE + (MOST_FACES + 1) * 4 * CORNERS
LENGTH = BOTH_ENDS + ENDS * ENDS
SHORT_LENGTH = LENGTH + KINDS * shapes.LENGTHS * shapes.ANGLES
ANGLE_SUM = SHORT_LENGTH + shapes.SHORT_LENGTHS**3
BEND = ANGLE_SUM + CORNERS * 8 * ANGLE_SUMS
END_ANGLE_SUM = BEND + CORNERS * shapes.ANGLES * HALF_CLASSES
END_FAMILY = END_ANGLE_SUM + ENDS * 4 * ANGLE_SUMS
APEX_FAMILY = END_FAMILY + 2 * FAMILY * 2
SPHERE = APEX_FAMILY + 2 * FAMILY * CLOSINGS
ACROSS = SPHERE + (MOST_INSIDE + 1) * (MOST_NEAR + 1) * KINDS
CLOSED_BEND = ACROSS + shapes.SHORT_LENGTHS**3
PARALLELOGRAM = CLOSED_BEND + (shapes.ANGLES + 1) * HALF_CLASSES
BEND_AND_ANGLE = PARALLELOGRAM + shapes.LENGTHS * shapes.ANGLES
MARGIN = BEND_AND_ANGLE + shapes.ANGLES * shapes.ANGLES
PLACES = MARGIN + MARGINS * 4 * CORNERS


@borrowing_kernel
def measure_candidates(
    properties: Properties,
    candidates: Candidates,
    count: int,
    coarse: CoarseMesh,
    fine: FineMesh,
    first: int,
    second: int,
    known_apex: int,
) -> None:
    """Write the places of the first `count` candidates' properties into the rows of `properties`."""
    vertices = fine.vertices
    gate = shapes.gate_shape(vertices, first, second, known_apex)
    shared = 1 if fine.parents[first] == fine.parents[second] else 0
    first_family = _family(coarse, fine.parents[first])
    second_family = _family(coarse, fine.parents[second])
    for row in range(count):
        vertex = int(candidates.vertex[row])
        kind = int(candidates.kind[row])
        corner = int(candidates.corner[row])
        closes_first = int(candidates.flags[row]) & half_edges.CLOSES_FIRST
        closes_second = (int(candidates.flags[row]) & half_edges.CLOSES_SECOND) >> 1
        own = 1 if kind == NEW_FACE_APEX else 0
        faces = int(vertices[vertex, half_edges.FACES])
        open_pairs = min(int(vertices[vertex, half_edges.OPEN_EDGES]) >> 1, 3)
        one = _end(vertices, first, closes_first)
        other = _end(vertices, second, closes_second)
        completes = 1 if closes_first and closes_second and open_pairs == 1 else 0
        places = properties[row]
        places[0] = KIND + kind * CORNERS + corner
        places[1] = VALENCE + (min(faces, MOST_FACES) * 4 + open_pairs) * CORNERS + corner
        places[2] = BOTH_ENDS + max(one, other) * ENDS + min(one, other)
        places[3] = END_FAMILY + _lacking(first_family, closes_first, own) * 2 + shared
        places[4] = END_FAMILY + _lacking(second_family, closes_second, own) * 2 + shared
        apex_family = _lacking(_family(coarse, fine.parents[vertex]), completes, own)
        places[5] = APEX_FAMILY + apex_family * CLOSINGS + corner // STATES
        apex = shapes.position(vertices, vertex)
        _measure_lengths(places, vertices, gate, apex, kind, corner, vertex, first, one, second, other)
        _measure_bends(places, fine, gate, apex, corner, vertex, closes_first, closes_second)
        inside, near, margin = _look_in_sphere(candidates, min(count, SPHERE_LIMIT), vertices, gate, apex, vertex)
        places[17] = SPHERE + (inside * (MOST_NEAR + 1) + near) * KINDS + kind
        places[18] = MARGIN + (margin * 4 + min(inside, 3)) * CORNERS + corner


@merged_kernel
def _family(coarse: CoarseMesh, parent: int) -> tuple[int, int]:
    """Class of the number of a coarse vertex' children, and how many coarse faces around it lack a fine one."""
    start = int(coarse.edges.start[parent])
    lacking = 0
    for place in range(start, min(int(coarse.edges.start[parent + 1]), start + FAMILY_SCAN_LIMIT)):
        lacking += 1 - int(coarse.covered[coarse.edges.face[place]])
    return min(int(coarse.children[parent + 1] - coarse.children[parent]), 3) - 1, lacking


@inlined_kernel
def _lacking(family: tuple[int, int], closed: int, own: int) -> int:
    """A family, whether something closes there, and what it lacks besides the `own` coarse face, in one number."""
    return (closed * 3 + family[0]) * (MOST_LACKING + 1) + min(max(family[1] - own, 0), MOST_LACKING)


@inlined_kernel
def _end(vertices: Table, vertex: int, closed: int) -> int:
    """The faces at an end of the gate, and whether the candidate's face closes the edge there."""
    return closed * (MOST_END_FACES + 1) + min(int(vertices[vertex, half_edges.FACES]), MOST_END_FACES)


@inlined_kernel
def _end_angle_sum(vertices: Table, vertex: int, end: int, angle: int) -> int:
    """Place of the sum of the angles at an end of the gate, with that of the candidate's face."""
    open_edges = min(int(vertices[vertex, half_edges.OPEN_EDGES]), 3)
    angle_sum = min((int(vertices[vertex, half_edges.ANGLE]) + angle) >> 1, ANGLE_SUMS - 1)
    return END_ANGLE_SUM + (end * 4 + open_edges) * ANGLE_SUMS + angle_sum


@merged_kernel
def _measure_lengths(
    places: Table,
    vertices: Table,
    gate: GateShape,
    apex: Point,
    kind: int,
    corner: int,
    vertex: int,
    first: int,
    one_end: int,
    second: int,
    other_end: int,
) -> None:
    """The properties that only lengths and angles matter for."""
    one = shapes.squared_distance(gate.first, apex)
    other = shapes.squared_distance(gate.second, apex)
    across = shapes.squared_distance(gate.known, apex)
    angle = shapes.angle_class(gate.squared, one, other)
    length = shapes.length_class(across, gate.ratio_scale)
    sides = min(shapes.short_length(one), shapes.short_length(other)) * shapes.SHORT_LENGTHS
    sides = (sides + max(shapes.short_length(one), shapes.short_length(other))) * shapes.SHORT_LENGTHS
    faces = min(int(vertices[vertex, half_edges.FACES]), 7)
    angle_sum = min((int(vertices[vertex, half_edges.ANGLE]) + angle) >> 1, ANGLE_SUMS - 1)
    places[6] = LENGTH + (kind * shapes.LENGTHS + length) * shapes.ANGLES + angle
    places[7] = SHORT_LENGTH + sides + shapes.short_length(gate.squared)
    places[8] = ACROSS + sides + shapes.short_length(across)
    places[9] = ANGLE_SUM + (corner * 8 + faces) * ANGLE_SUMS + angle_sum
    places[10] = _end_angle_sum(vertices, first, one_end, shapes.angle_class(other, one, gate.squared))
    places[11] = _end_angle_sum(vertices, second, other_end, shapes.angle_class(one, other, gate.squared))


@merged_kernel
def _measure_bends(
    places: Table,
    fine: FineMesh,
    gate: GateShape,
    apex: Point,
    corner: int,
    vertex: int,
    closes_first: int,
    closes_second: int,
) -> None:
    """The properties that the direction of the face matters for."""
    one = shapes.squared_distance(gate.first, apex)
    other = shapes.squared_distance(gate.second, apex)
    angle = shapes.angle_class(gate.squared, one, other)
    normal = shapes.normal_of(gate.first, gate.second, apex)
    bend = _bend_between(normal, gate.normal)
    first_bend = second_bend = NO_BEND
    if closes_first:
        first_bend = _bend_at(fine, int(fine.vertices[vertex, half_edges.CLOSING_FIRST]), normal)
    if closes_second:
        second_bend = _bend_at(fine, int(fine.vertices[vertex, half_edges.CLOSING_SECOND]), normal)
    x = apex[0] - (gate.first[0] + gate.second[0] - gate.known[0])
    y = apex[1] - (gate.first[1] + gate.second[1] - gate.known[1])
    z = apex[2] - (gate.first[2] + gate.second[2] - gate.known[2])
    from_parallelogram = shapes.length_class(x * x + y * y + z * z, gate.ratio_scale)
    places[12] = BEND + (corner * shapes.ANGLES + bend) * HALF_CLASSES + (angle >> 2)
    places[13] = CLOSED_BEND + first_bend * HALF_CLASSES + (bend >> 2)
    places[14] = CLOSED_BEND + second_bend * HALF_CLASSES + (bend >> 2)
    places[15] = PARALLELOGRAM + from_parallelogram * shapes.ANGLES + bend
    places[16] = BEND_AND_ANGLE + bend * shapes.ANGLES + angle


@inlined_kernel
def _bend_between(one: Point, other: Point) -> int:
    """Class of the angle between two normals."""
    dot = one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
    one_squared = one[0] * one[0] + one[1] * one[1] + one[2] * one[2]
    other_squared = other[0] * other[0] + other[1] * other[1] + other[2] * other[2]
    return shapes.class_of_cosine(dot * abs(dot), one_squared * other_squared)


@borrowing_kernel
def _bend_at(fine: FineMesh, half_edge: int, normal: Point) -> int:
    """Class of the angle between a normal and that of the face which owns a half-edge."""
    start = half_edges.field(fine.triangles, half_edge, half_edges.CORNER)
    end = half_edges.field(fine.triangles, half_edges.following(half_edge), half_edges.CORNER)
    apex = half_edges.field(fine.triangles, half_edges.preceding(half_edge), half_edges.CORNER)
    behind = shapes.normal_of(
        shapes.position(fine.vertices, start),
        shapes.position(fine.vertices, end),
        shapes.position(fine.vertices, apex),
    )
    return _bend_between(normal, behind)


@borrowing_kernel
def _look_in_sphere(
    candidates: Candidates, count: int, vertices: Table, gate: GateShape, apex: Point, vertex: int
) -> tuple[int, int, int]:
    """How many others of the first `count` candidates lie inside the smallest sphere through the gate and the apex.

    Also how many lie near that sphere, and the class of the innermost one's squared distance from the centre.
    """
    first = gate.first
    e = (gate.second[0] - first[0], gate.second[1] - first[1], gate.second[2] - first[2])
    d = (apex[0] - first[0], apex[1] - first[1], apex[2] - first[2])
    ee = gate.squared
    dd = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    ed = e[0] * d[0] + e[1] * d[1] + e[2] * d[2]
    determinant = 2.0 * (ee * dd - ed * ed)
    if not determinant > 0.0:
        return MOST_INSIDE, 0, 0
    along_e = dd * (ee - ed) / determinant
    along_d = ee * (dd - ed) / determinant
    x = along_e * e[0] + along_d * d[0]
    y = along_e * e[1] + along_d * d[1]
    z = along_e * e[2] + along_d * d[2]
    radius = x * x + y * y + z * z
    if not radius > 0.0:
        return MOST_INSIDE, 0, 0
    centre = (x + first[0], y + first[1], z + first[2])
    inside = near = 0
    nearest = 4.0 * radius
    for row in range(count):
        if candidates.vertex[row] != vertex:
            distance = shapes.squared_distance(shapes.position(vertices, candidates.vertex[row]), centre)
            nearest = min(nearest, distance)
            if distance < radius * INNER:
                inside += 1
            elif distance < radius * OUTER:
                near += 1
    margin = min(int(nearest / radius * MARGIN_STEPS), MARGINS - 1)
    return min(inside, MOST_INSIDE), min(near, MOST_NEAR), margin
