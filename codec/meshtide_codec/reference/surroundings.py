"""What the surroundings of a vertex say about its next bits (docs/format.md, section 8).

An encoder sees the same, and has nothing to decide.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from meshtide_codec.reference.levels import (
    NONE,
    CellTable,
    Point,
    Single,
    Vector,
    cross,
    dot,
    exponent,
    greatest,
    least,
    vector,
)

ERROR_CLASSES = 24
UNDECIDED, DIFFERS, AGREES = range(3)  # of a vertex and its mirror image
REACH, SLACK = Single(3.6), Single(1.01)  # half cells within which a leaf may be an image, and an image agrees
KNOWN = 5  # the mirror state from which on the partner is known
PAIRED = 10
PADDING = [1e6, 1e6, 1e6, 0.0]
NOWHERE = Single(1e12)
BOUND = vector(8, 1, 1)


@dataclass
class Row:
    """One vertex as a slice knows it.

    Attributes:
        position: in half finest steps; the fourth number: the depth up to which it is known.
        laplacian: its neighbours' mean, seen from it; the fourth number: how wrong guesses were, in half cells.
    """

    position: Vector
    laplacian: Vector


@dataclass
class Neighbour:
    """A member of a ring, and the vertex across the edge to the member after it (NONE without one), as rows."""

    member: int
    across: int


@dataclass
class Expert:
    """What many guesses agree on, and how much it is worth: 0 if there are none, else 1 to 7."""

    offset: Vector = field(default_factory=lambda: vector(0, 0, 0))
    trust: int = 0


@dataclass
class Surroundings:
    """What is seen of a vertex; offsets are in half cells, from the middle of the cell that is known to hold it.

    The fourth number of an offset to a vertex is 1 if that is known at this depth, else 0.

    Attributes:
        ring: offsets of the members.
        below, level, above: for each axis, members with an offset of exactly -1, 0, 1.
        smoothed, far_mean: the neighbours' mean, filtered.
        normal: of the ring, of length 1, or 0.
        rank: for each axis: 2 for the one nearest to the normal, 0 for the one farthest from it.
        plane: `smoothed`, moved along the normal to where `far_mean` is.
        across_mean, across_spread: means of the vertices across, and of their Laplacians.
        error_class, known_class: how wrong the guesses of the ring were; how much of it is known, 0 to 3.
        patch: effort high: the ring and what lies across; the fourth number is a weight.
    """

    ring: list[Vector]
    below: list[int]
    level: list[int]
    above: list[int]
    smoothed: Vector
    far_mean: Vector
    normal: Vector
    rank: list[int]
    plane: Vector
    across_mean: Vector
    across_spread: Vector
    in_ring: Expert
    midpoint: Expert
    across: Expert
    error_class: int
    known_class: int
    patch: list[Vector]


@dataclass
class WideView:
    """Effort high: what is seen of a wider surroundings, above all a quadratic surface through it.

    Attributes:
        normal: of the surface, of length 1, or 0.
        height: of the surface over the cell's middle, along the normal.
        surface_class: how wrong the surfaces of the ring were, as an error class; 23 without a surface.
        quadric: the offset to the surface, along its normal, from `smoothed`.
        pairs: an expert more.
        below, above: for each axis, points of the patch with an offset of exactly -1 and 1.
    """

    normal: Vector
    height: Single
    surface_class: int
    quadric: Vector
    pairs: Expert
    below: list[int]
    above: list[int]


def error_class(error: Single) -> int:
    """Errors by half octaves."""
    return min(max(exponent(error * error) + 12, 0), ERROR_CLASSES - 1)


def look_around(rows: list[Row], own: Row, neighbours: list[Neighbour], half: Single, *, closed: bool) -> Surroundings:
    """What the ring says, of which `half` is half a cell, in half finest steps."""
    inverse = Single(1) / half
    unit = vector(inverse, inverse, inverse, 1)
    zero = vector(0, 0, 0)
    ring = [(rows[neighbour.member].position - own.position) * unit for neighbour in neighbours]
    count = len(ring)
    total, laplacians = zero, zero
    for offset, neighbour in zip(ring, neighbours, strict=True):
        total = total + offset
        laplacians = laplacians + rows[neighbour.member].laplacian
    turn, across_total, across_laplacians = zero, zero, zero
    in_ring, across, beyond = [], [], []
    for place, neighbour in enumerate(neighbours):
        this, before, following = ring[place], ring[place - 1], ring[(place + 1) % count]
        if place or closed:
            turn = turn + cross(before, this)
        in_ring.append(before + following - _inverted(this))
        if neighbour.across == NONE:
            continue
        row = rows[neighbour.across]
        offset = (row.position - own.position) * unit
        across.append(this + following - _inverted(offset))
        beyond.append(offset)
        across_total = across_total + offset
        across_laplacians = across_laplacians + row.laplacian
    members, crossed = Single(count), Single(len(across))
    share = Single(1) / members if count else Single(0)
    across_share = Single(1) / crossed if across else Single(0)
    mean, spread = total * share, laplacians * unit * share
    smoothed = mean * Single(0.65) - spread * Single(0.15)
    far_mean = mean - spread * Single(0.7)
    square = dot(turn, turn)
    normal = turn * (Single(1) / np.sqrt(square)) if square > 0 else zero
    error = (laplacians[3] + Single(0.5) * own.laplacian[3]) / (members + Single(0.5))
    return Surroundings(
        ring=ring,
        below=_how_many(ring, -1),
        level=_how_many(ring, 0),
        above=_how_many(ring, 1),
        smoothed=smoothed,
        far_mean=far_mean,
        normal=normal,
        rank=_ranks(normal),
        plane=smoothed + normal * dot(far_mean - smoothed, normal),
        across_mean=across_total * across_share,
        across_spread=across_laplacians * unit * across_share,
        in_ring=conclude(in_ring if closed else in_ring[1:-1], 7, 2),
        midpoint=conclude(_midpoints(ring, closed=closed), 5, 4),
        across=conclude(across, 7, 2),
        error_class=error_class(error) if count else ERROR_CLASSES - 1,
        known_class=int(Single(4) * total[3]) // (count + 1),
        patch=[offset + vector(0, 0, 0, 1) for offset in ring + beyond],
    )


def _inverted(offset: Vector) -> Vector:
    """With the fourth number negated: how many vertices are known adds up in differences, too."""
    return offset * vector(1, 1, 1, -1)


def _how_many(offsets: list[Vector], value: int) -> list[int]:
    """For each axis, offsets of exactly so much."""
    return [sum(bool(offset[axis] == value) for offset in offsets) for axis in range(3)]


def _ranks(normal: Vector) -> list[int]:
    """For each axis how many others the normal is farther from; the last two bits of a component do not count."""
    order = [(int(bits) & ~3) | axis for axis, bits in enumerate(abs(normal[:3]).view(np.int32))]
    return [sum(other < own for other in order) for own in order]


def _midpoints(ring: list[Vector], *, closed: bool) -> list[Vector]:
    """Of opposite members."""
    count = len(ring)
    half = count // 2
    if closed:
        pairs = [(i, (i + half) % count) for i in range(count if count % 2 else half)]
    else:
        pairs = [(i, count - 1 - i) for i in range(half)]
    return [(ring[i] + ring[j]) * Single(0.5) for i, j in pairs]


def conclude(guesses: list[Vector], doubt: float, per_known: float) -> Expert:
    """The mean of guesses: each counts by how near to the middle it lies, and by how many of its vertices are known."""
    if not guesses:
        return Expert()
    padded = np.array([*guesses, *[PADDING] * (-len(guesses) % 4)], Single).reshape(-1, 4, 4)
    sums = np.zeros((4, 4), Single)  # four guesses at a time
    nearest = np.full(4, NOWHERE)
    for x, y, z, known in padded.transpose(0, 2, 1):
        square = x * x + y * y + z * z
        k = square + Single(12)
        weight = Single(1) / (k * k * (Single(doubt) - known * Single(per_known)))
        sums = sums + np.array([weight * x, weight * y, weight * z, weight])
        nearest = least(nearest, square)
    total = _totals(sums)
    w = Single(1) + Single(0.2) * min(nearest)
    return Expert(total * (Single(1) / total[3]), min(exponent(w * w) + 1, 7))


def _totals(sums: Vector) -> Vector:
    """The sums of rows of four."""
    made: Vector = (sums[:, 0] + sums[:, 1]) + (sums[:, 2] + sums[:, 3])
    return made


def look_wide(seen: Surroundings, own: Row, surface_errors: list[Single]) -> WideView:
    """The quadratic surface, and pairs; surface errors are those of members that this bit plane has coded."""
    first = seen.ring[:PAIRED]
    pairs = [(one + other) * Single(0.5) for place, one in enumerate(first) for other in first[place + 1 :]]
    wide = WideView(
        normal=vector(0, 0, 0),
        height=Single(0),
        surface_class=ERROR_CLASSES - 1,
        quadric=vector(0, 0, 0),
        pairs=conclude(pairs, 5, 4),
        below=_how_many(seen.patch, -1),
        above=_how_many(seen.patch, 1),
    )
    if dot(seen.normal, seen.normal) > 0:
        squares = vector(0, 0, 0)
        for offset in seen.ring:
            squares = squares + offset * offset
        square = (squares[0] + squares[1] + squares[2]) / Single(len(seen.ring))
        wide.normal, wide.height = _fit_surface(seen.patch, seen.normal, np.sqrt(square))
        total, weight = Single(0.35) * own.laplacian[3], Single(0.5)
        for error in surface_errors:
            total, weight = total + error, weight + Single(1)
        wide.surface_class = min(error_class(total / weight), ERROR_CLASSES - 2)
    along = wide.height - dot(wide.normal, seen.smoothed)
    wide.quadric = seen.smoothed + wide.normal * along
    return wide


def _fit_surface(patch: list[Vector], normal: Vector, scale: Single) -> tuple[Vector, Single]:
    """Heights of points as a quadratic polynomial: the surface's normal, and its height over the middle.

    The curvatures are eliminated as a block (Schur complement), what is left is solved by Cramer's rule.
    """
    # T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6 (1), 2017.
    sign = Single(-1 if normal[2] < 0 else 1)
    a = Single(-1) / (sign + normal[2])
    b = normal[0] * normal[1] * a
    first = vector(Single(1) + sign * normal[0] * normal[0] * a, sign * b, -sign * normal[0])
    second = vector(b, sign + normal[1] * normal[1] * a, -normal[1])
    nearer = Single(1) / scale
    p, q, n = first * nearer, second * nearer, normal * nearer

    padded = np.array([*patch, *[[0.0] * 4] * (-len(patch) % 4)], Single).reshape(-1, 4, 4)
    sums = np.zeros((21, 4), Single)  # four points at a time
    for x, y, z, weight in padded.transpose(0, 2, 1):
        u, v, h = (x * axis[0] + y * axis[1] + z * axis[2] for axis in (p, q, n))
        uu, uv, vv = u * u, u * v, v * v
        near = uu + vv + Single(0.25)
        w = weight / (near * near)
        wu, wv, wuu, wuv, wvv = w * u, w * v, w * uu, w * uv, w * vv
        second_moments = [w, wu, wv, wuu, wuv, wvv, wuu * u, wuu * v, wuv * v, wvv * v]
        fourth_moments = [wuu * uu, wuu * uv, wuu * vv, wuv * vv, wvv * vv]
        sums = sums + np.array(second_moments + fourth_moments + [w * h, wu * h, wv * h, wuu * h, wuv * h, wvv * h])
    m00, m10, m01, m20, m11, m02, m30, m21, m12, m03, m40, m31, m22, m13, m04, *heights = _totals(sums)
    h00, h10, h01, h20, h11, h02 = heights
    # Of 1, u, v with themselves, with u u, u v, v v, and of the latter with each other.
    slope_damping, damping = Single(0.001) * m00, Single(0.01) * m00
    plain = [vector(m00, m10, m01), vector(m10, m20 + slope_damping, m11), vector(m01, m11, m02 + slope_damping)]
    mixed = [vector(m20, m11, m02), vector(m30, m21, m12), vector(m21, m12, m03)]
    curved = [vector(m40 + damping, m31, m22), vector(m31, m22 + damping, m13), vector(m22, m13, m04 + damping)]
    curved_heights = vector(h20, h11, h02)

    inverse = _inverse(curved)
    factors = [_product(row, inverse) for row in mixed]
    turned = [vector(*(row[column] for row in mixed)) for column in range(3)]
    left = [row - _product(factor, turned) for row, factor in zip(plain, factors, strict=True)]
    plain_heights = vector(h00, h10, h01) - vector(*(dot(factor, curved_heights) for factor in factors))
    solution = greatest(least(_product(plain_heights, _inverse(left)), BOUND), -BOUND)
    tilted = normal - first * solution[1] - second * solution[2]
    shorter = Single(1) / np.sqrt(dot(tilted, tilted))
    return tilted * shorter, solution[0] * scale * shorter


def _inverse(rows: list[Vector]) -> list[Vector]:
    """Of a symmetric matrix: cross products of its rows over its determinant."""
    a, b, c = rows
    first = cross(b, c)
    scale = Single(1) / dot(a, first)
    return [first * scale, cross(c, a) * scale, cross(a, b) * scale]


def _product(row: Vector, rows: list[Vector]) -> Vector:
    made: Vector = row[0] * rows[0] + row[1] * rows[1] + row[2] * rows[2]
    return made


# ---- Mirror


@dataclass
class Reflection:
    """What is known from the image of an owner's partner.

    Attributes:
        offset: from the owner, in half cells.
        state: 0 without a partner; 1 + verdict, and 4 more if the partner is known.
    """

    offset: Vector
    state: int = 0


@dataclass
class Vertex:
    """A vertex of a slice.

    Attributes:
        row: what is known of it.
        leaf_depth: its cell depth if it is a leaf, else None.
        partner: with a mirror: the leaf at its image, or None.
        likeness: UNDECIDED, DIFFERS or AGREES.
    """

    row: Row
    leaf_depth: int | None
    partner: Vertex | None = None
    likeness: int = UNDECIDED


class Mirror:
    """A plane across an axis that takes finest coordinate x to `coordinate_sum` - x."""

    def __init__(self, axis: int, coordinate_sum: int) -> None:
        self.axis = axis
        self._doubled = Single(2 * (coordinate_sum + 1))  # of a coordinate and its image, in half finest steps

    def find_partners(self, vertices: list[Vertex], depth: int, half: Single) -> None:
        """Each owner without a partner gets the leaf nearest to its image, from the same row of cells."""
        per_cell = Single(0.25) / half
        leaves = [vertex for vertex in vertices if vertex.leaf_depth is not None]
        table = CellTable(len(vertices))
        for number, leaf in enumerate(leaves):
            table.put(_cell(leaf.row.position * per_cell), number)
        axis, side = self.axis, 1 << (depth - 1)
        for owner in leaves:
            settled = owner.partner is not None and owner.likeness != DIFFERS
            if settled or owner.leaf_depth is None or owner.leaf_depth >= depth:
                continue
            owner.partner = None
            image, nearest = self._doubled - owner.row.position[axis], REACH * half
            middle = int(image * per_cell + Single(side)) - side
            for k in range(max(middle - 1, 0), min(middle + 2, side)):
                cell = list(_cell(owner.row.position * per_cell))
                cell[axis] = k
                found = table.find((cell[0], cell[1], cell[2]))
                if found == NONE or leaves[found] is owner:
                    continue
                distance = abs(leaves[found].row.position[axis] - image)
                if distance < nearest:
                    nearest, owner.partner = distance, leaves[found]

    def look(self, owner: Vertex, around: list[Vertex], half: Single) -> Reflection:
        """What is known from the image of the owner's partner; around are the members of its ring."""
        if owner.partner is None:
            return Reflection(vector(0, 0, 0))
        agreeing = sum(vertex.likeness == AGREES for vertex in around)
        differing = sum(vertex.likeness == DIFFERS for vertex in around)
        verdict = 3 if agreeing + differing == 0 else 0 if differing > agreeing else 1 if differing else 2
        image = owner.partner.row.position.copy()
        image[self.axis] = self._doubled - image[self.axis]
        offset = (image - owner.row.position) * (Single(1) / half)
        return Reflection(offset, 1 + verdict + (4 if offset[3] > 0 else 0))


def compare(owner: Vertex, reflection: Reflection, steps: Vector) -> None:
    """Note whether the owner lies where the reflection has put it."""
    if reflection.state < KNOWN or owner.partner is None:
        return
    missed = abs(reflection.offset - steps)
    owner.likeness = AGREES if all(missed[:3] <= SLACK) else DIFFERS
    if owner.partner.likeness == UNDECIDED:
        owner.partner.likeness = owner.likeness


def _cell(position: Vector) -> Point:
    x, y, z = (int(coordinate) for coordinate in position[:3])
    return x, y, z


# ---- Classes of what was seen


def place(*parts: tuple[int | bool | np.bool_, int]) -> int:
    """A place in a table, by what it is made of, each with how many values it has; the first one counts most."""
    number = 0
    for value, values in parts:
        number = number * values + int(value)
    return number


def clamped(a: Single, low: float, high: float) -> int:
    """The whole part of what is nearest within bounds."""
    return int(a if low < a < high else low if a <= low else high)


def size_class(a: Single, count: int, half: float = 1.0) -> int:
    """Classes of magnitudes, ever wider; half of them below `half`."""
    m = abs(a)
    return min(int(m * Single(count) / (m + Single(half))), count - 1)


def step_class(a: Single, reach: int) -> int:
    """2 reach + 1 classes of half a half cell, the middle one around 0."""
    return clamped(a * Single(2) + Single(reach + 0.5), 0, 2 * reach)


def signed_class(a: Single) -> int:
    """Nine classes, ever wider to both sides of 0."""
    distance = size_class(a, 12) * 6 >> 4
    return 4 - distance if a < 0 else 4 + distance


def turned(a: Single, opposed: bool | np.bool_) -> Single:
    """As seen from the other side, if it is opposed."""
    return -a if opposed else a


def sides(below: int, above: int, opposed: bool | np.bool_, limit: int) -> tuple[int, int]:
    """Members beside the two coordinates that a bit can choose: those on the side that is spoken of, and the others."""
    below, above = min(below, limit), min(above, limit)
    return (below, above) if opposed else (above, below)
