"""Profile classic: levels that are predicted by filters, and corrected (docs/format.md, section 11).

An encoder decides the levels and how many bits each drops, the filter, its coefficients for each level (those that
minimise the Diffs in the norm), and which levels send Diffs.
"""

from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING

from meshtide_codec.errors import BaseError, MapConnError, PacketError, ParamError
from meshtide_codec.reference.candidates import PLAIN_SHAPE
from meshtide_codec.reference.coding import SIGNED_CONTEXTS, UNSIGNED_CONTEXTS, Contexts, RangeDecoder, trained
from meshtide_codec.reference.faces import FacesDecoder
from meshtide_codec.reference.header import (
    BASE,
    DIFF,
    GAUSSIAN,
    MAP_CONN,
    PARAM,
    TAUBIN,
    ZEROTH,
    ClassicHeader,
    Header,
    Key,
)
from meshtide_codec.reference.levels import NONE, Level

if TYPE_CHECKING:
    from meshtide_codec.reference.compact import Drawn, Positions
    from meshtide_codec.reference.levels import Point

    Column = list[float]
    """One coordinate of all vertices."""

SIZE_CLASSES = 6
HALF_GAP = 1 << 30
RELATIVE_RESIDUAL = 1e-11
MOST_STEPS = 256
GRID_INTERVALS = 4096
SMALLEST_DENOMINATOR, LARGEST_RATIO = 1 / 256, 256.0


class Connectivity:
    """Faces, level after level: as at effort default, but without a look at positions."""

    def __init__(self) -> None:
        (layer,) = trained("classic", (PLAIN_SHAPE,))
        self._layer = layer.copy()
        self.level = Level(0, [], [], [], [0], heads=[NONE], degrees=[0])

    def decode(self, decoder: RangeDecoder, children: list[int], faces: int) -> None:
        """The next level, given how many children each vertex has."""
        coarse = self.level
        fine = Level(0, [], [], [], [])
        coarse.first_children = []
        for vertex, count in enumerate(children):
            coarse.first_children.append(len(fine))
            fine.parents += [vertex] * count
        coarse.first_children.append(len(fine))
        walk = FacesDecoder(decoder, coarse, fine, self._layer, bits=0, most_faces=faces, positions=False, high=False)
        walk.decode()
        if len(fine.corners) != 4 * faces:
            raise MapConnError("another number of faces than was announced")
        self.level = fine


def decode_classic(header: Header, payloads: dict[Key, bytes]) -> dict[int, Drawn]:
    """All levels that packets give; Diffs may be missing, and everything that follows something else."""
    options = header.classic
    assert options is not None  # noqa: S101 - headers have the options of their profile
    coarsest = len(options.shifts) - 1
    for kind, level, part in payloads:
        place = {BASE: level == coarsest, DIFF: level in options.diffs}
        place |= {MAP_CONN: level < coarsest, PARAM: level < coarsest and options.coefficient_count > 0}
        if part or not place.get(kind):
            raise PacketError("this stream has no such packet", level=level)
    drawn: dict[int, Drawn] = {}
    if (BASE, coarsest, 0) not in payloads:
        return drawn
    connectivity = Connectivity()
    state = header.state_of(coarsest)
    with RangeDecoder(payloads[BASE, coarsest, 0]) as decoder:
        cells = _cells(decoder, state.vertices, header.bits - options.shifts[coarsest])
        connectivity.decode(decoder, [state.vertices], state.faces)
    points = [_middle(cell, options.shifts[coarsest]) for cell in cells]
    drawn[coarsest] = points, connectivity.level.faces()
    for level in range(coarsest - 1, -1, -1):
        coefficients = _coefficients(options, payloads.get((PARAM, level, 0)))
        if (MAP_CONN, level, 0) not in payloads or coefficients is None:
            break
        state = header.state_of(level)
        with RangeDecoder(payloads[MAP_CONN, level, 0]) as decoder:
            children = _children(decoder, len(points), state.vertices)
            connectivity.decode(decoder, children, state.faces)
        faces = connectivity.level.faces()
        points = _predicted(points, connectivity.level.parents, faces, options, coefficients)
        points = [[min(max(x, -0.5), (1 << header.bits) - 0.5) for x in point] for point in points]
        if (DIFF, level, 0) in payloads:
            with RangeDecoder(payloads[DIFF, level, 0]) as decoder:
                points = _corrected(decoder, points, options.shifts[level], header.bits)
        drawn[level] = points, faces
    return drawn


def _cells(decoder: RangeDecoder, count: int, bits: int) -> list[list[int]]:
    """The coarsest cells, from the gaps between their Morton codes."""
    contexts = Contexts(2 * UNSIGNED_CONTEXTS)
    cells = []
    code = -1
    for _ in range(count):
        high, low = contexts.unsigned(decoder, 0), contexts.unsigned(decoder, UNSIGNED_CONTEXTS)
        code += high * HALF_GAP + low + 1
        if high >= HALF_GAP or low >= HALF_GAP or code >> (3 * bits):
            raise BaseError("a cell outside of the grid")
        cells.append([sum((code >> (3 * k + 2 - axis) & 1) << k for k in range(bits)) for axis in range(3)])
    return cells


def _children(decoder: RangeDecoder, coarse: int, total: int) -> list[int]:
    """How many children each coarser vertex has."""
    contexts = Contexts(4 * UNSIGNED_CONTEXTS)
    children: list[int] = []
    before = 0
    for _ in range(coarse):
        before = contexts.unsigned(decoder, min(before, 3) * UNSIGNED_CONTEXTS)
        children.append(before + 1)
    if sum(children) != total:
        raise MapConnError("another number of children than the level has vertices")
    return children


def _corrected(decoder: RangeDecoder, points: Positions, shift: int, bits: int) -> Positions:
    """The true positions: cells of the predictions plus Diffs."""
    contexts = Contexts(3 * SIZE_CLASSES * SIGNED_CONTEXTS)
    corrected = []
    size = 0
    for point in points:
        size_class = min(max(size.bit_length() - 1, 0), SIZE_CLASSES - 1)
        cell = []
        for axis in range(3):
            difference = contexts.signed(decoder, (axis * SIZE_CLASSES + size_class) * SIGNED_CONTEXTS)
            predicted = min(math.floor((point[axis] + 0.5) / float(1 << shift)), (1 << (bits - shift)) - 1)
            cell.append(predicted + difference)
            size += abs(difference)
        size >>= 1
        corrected.append(_middle(cell, shift))
    return corrected


def _middle(cell: list[int], shift: int) -> list[float]:
    """Position of a cell's vertex in finest steps."""
    return [(coordinate + 0.5) * float(1 << shift) - 0.5 for coordinate in cell]


# ---- Prediction


def _coefficients(options: ClassicHeader, payload: bytes | None) -> list[list[float]] | None:
    """Of x, y and z; None if they are missing."""
    count = options.coefficient_count
    if count == 0:
        return [[], [], []]
    if payload is None:
        return None
    if len(payload) != 12 * count:
        raise ParamError("another number of coefficients than the filter has")
    rows = [list(row) for row in struct.iter_unpack(f"<{count}f", payload)]
    for row in rows:
        if not all(map(math.isfinite, row)) or not is_safe(row[options.degree + 1 :]):
            raise ParamError("coefficients that are not finite, or a denominator that is not safely positive")
    return rows


def is_safe(denominator: list[float]) -> bool:
    """Whether 1 + q_1 t + q_2 t^2 + ... is provably positive on [0, 2], and its solution provably quick.

    >>> is_safe([0.25]), is_safe([-0.5])
    (True, False)
    """
    steepest = 0.0
    for power, q in enumerate(denominator, 1):
        steepest += power * abs(q) * 2.0 ** (power - 1)
    values = []
    for place in range(GRID_INTERVALS + 1):
        value = 0.0
        for q in reversed(denominator):
            value = value * (place * (2 / GRID_INTERVALS)) + q
        values.append(value * (place * (2 / GRID_INTERVALS)) + 1.0)
    slack = steepest / GRID_INTERVALS
    lowest, highest = min(values) - slack, max(values) + slack
    return lowest >= SMALLEST_DENOMINATOR and highest <= LARGEST_RATIO * lowest


def _predicted(
    coarse: Positions, parents: list[int], faces: list[Point], options: ClassicHeader, coefficients: list[list[float]]
) -> Positions:
    """Each vertex starts where its parent is; then the filter is applied to each coordinate."""
    graph = Graph(faces, len(parents))
    columns = [
        predict(graph, [coarse[parent][axis] for parent in parents], options, coefficients[axis]) for axis in range(3)
    ]
    return [list(point) for point in zip(*columns, strict=True)]


class Graph:
    """The neighbours of each vertex in ascending order: the other corners of its faces."""

    def __init__(self, faces: list[Point], vertices: int) -> None:
        around: list[set[int]] = [set() for _ in range(vertices)]
        for a, b, c in faces:
            around[a] |= {b, c}
            around[b] |= {c, a}
            around[c] |= {a, b}
        self.neighbours = [sorted(others) for others in around]

    def apply_k(self, values: Column) -> Column:
        """Each value minus the mean over the neighbours; 0 where there are none."""
        result = []
        for value, others in zip(values, self.neighbours, strict=True):
            total = 0.0
            for other in others:
                total += values[other]
            result.append(value - total / len(others) if others else 0.0)
        return result

    def dot(self, one: Column, other: Column) -> float:
        """Inner product weighted by the numbers of neighbours."""
        total = 0.0
        for a, b, others in zip(one, other, self.neighbours, strict=True):
            total += len(others) * (a * b)
        return total


def predict(graph: Graph, x: Column, options: ClassicHeader, coefficients: list[float]) -> Column:
    """One coordinate of the prediction from the same coordinate of the extension."""
    if options.filter == ZEROTH:
        return x
    if options.filter == GAUSSIAN:
        return _combined(x, -1.0, graph.apply_k(x))
    if options.filter == TAUBIN:
        y = _combined(x, options.taubin_mu, graph.apply_k(x))
        return _combined(y, -options.taubin_lambda, graph.apply_k(y))
    numerator, denominator = coefficients[: options.degree + 1], coefficients[options.degree + 1 :]
    result = (_clenshaw if options.chebyshev else _horner)(graph, x, numerator)
    if any(denominator):
        result = _divide(graph, result, [1.0, *denominator])
    return [value if others else start for value, start, others in zip(result, x, graph.neighbours, strict=True)]


def _horner(graph: Graph, x: Column, coefficients: list[float]) -> Column:
    """The sum of c_k K^k x."""
    result = [coefficients[-1] * value for value in x]
    for coefficient in coefficients[-2::-1]:
        result = _combined(graph.apply_k(result), coefficient, x)
    return result


def _clenshaw(graph: Graph, x: Column, coefficients: list[float]) -> Column:
    """The sum of c_k T_k(K - I) x."""
    result = [coefficients[-1] * value for value in x]
    later = [0.0] * len(x)
    for order in range(len(coefficients) - 2, -1, -1):
        factor = 2.0 if order else 1.0
        newer = [
            (factor * (change - now) - after) + coefficients[order] * value
            for change, now, after, value in zip(graph.apply_k(result), result, later, x, strict=True)
        ]
        later, result = result, newer
    return result


def _divide(graph: Graph, right_side: Column, denominator: list[float]) -> Column:
    """Solve Q(K) x = right side by conjugate gradients that start at the right side."""
    solution = right_side
    residual = _combined(right_side, -1.0, _horner(graph, right_side, denominator))
    direction = residual
    goal = RELATIVE_RESIDUAL * RELATIVE_RESIDUAL * graph.dot(right_side, right_side)
    energy = graph.dot(residual, residual)
    for _ in range(MOST_STEPS):
        if not energy > goal:
            break
        image = _horner(graph, direction, denominator)
        curvature = graph.dot(direction, image)
        if not curvature > 0.0:
            break
        step = energy / curvature
        solution = _combined(solution, step, direction)
        residual = _combined(residual, -step, image)
        next_energy = graph.dot(residual, residual)
        direction = _combined(residual, next_energy / energy, direction)
        energy = next_energy
    return solution


def _combined(one: Column, factor: float, other: Column) -> Column:
    return [a + factor * b for a, b in zip(one, other, strict=True)]
