"""Profile classic: levels from Base, Map&Conn, Param and Diff (docs/format.md, section 7)."""

from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING

from meshtide_codec.reference.connectivity import decode_faces
from meshtide_codec.reference.container import BASE, DIFF, MAP_CONN, PARAM, split_parts
from meshtide_codec.reference.filters import Graph, coefficient_count, predict
from meshtide_codec.reference.models import SIGNED_CONTEXTS, UNSIGNED_CONTEXTS, Contexts
from meshtide_codec.reference.octree import morton_cell
from meshtide_codec.reference.range_decoder import RangeDecoder

if TYPE_CHECKING:
    from meshtide_codec.reference.container import Stream
    from meshtide_codec.reference.decoder import Drawn

    Points = list[list[float]]

SIZE_CLASSES = 6
HALF_GAP = 1 << 30


def decode_classic(stream: Stream, number: int) -> Drawn:
    """Level `number`, as the packets that it needs show it."""
    packets = stream.packets_for(number)
    shifts, spec = stream.options["shifts"], stream.options["filter"]
    coarsest = len(shifts) - 1
    sizes = {state.level: state for state in stream.states}
    cell_part, face_part = split_parts(packets[BASE, coarsest, 0], 2)
    count = sizes[coarsest].vertices
    cells = _base_cells(cell_part, count, stream.bits - shifts[coarsest])
    points = [_centre(list(cell), shifts[coarsest]) for cell in cells]
    with RangeDecoder(face_part) as decoder:
        faces = decode_faces(decoder, [0] * count, [], 1, sizes[coarsest].faces, None)
    for level in range(coarsest - 1, number - 1, -1):
        count_part, face_part = split_parts(packets[MAP_CONN, level, 0], 2)
        parents = _parents(count_part, len(points))
        with RangeDecoder(face_part) as decoder:
            faces = decode_faces(decoder, parents, faces, len(points), sizes[level].faces, None)
        coefficients: list[list[float]] = [[], [], []]
        if (PARAM, level, 0) in packets:
            rows = struct.iter_unpack(f"<{coefficient_count(spec)}f", packets[PARAM, level, 0])
            coefficients = [list(row) for row in rows]
        graph = Graph(faces, len(parents))
        columns = [
            predict(graph, [points[parent][axis] for parent in parents], spec, coefficients[axis]) for axis in range(3)
        ]
        points = [[min(max(x, -0.5), (1 << stream.bits) - 0.5) for x in row] for row in zip(*columns, strict=True)]
        if (DIFF, level, 0) in packets:
            points = _corrected(points, packets[DIFF, level, 0], shifts[level], stream.bits)
    return points, faces


def _base_cells(payload: bytes, count: int, bits: int) -> list[tuple[int, int, int]]:
    """The coarsest cells, from the gaps between their Morton codes."""
    decoder = RangeDecoder(payload)
    contexts = Contexts.fresh(2 * UNSIGNED_CONTEXTS)
    cells = []
    code = -1
    for _ in range(count):
        high = contexts.unsigned(decoder, 0)
        code += high * HALF_GAP + contexts.unsigned(decoder, UNSIGNED_CONTEXTS) + 1
        cells.append(morton_cell(code, bits))
    decoder.finish()
    return cells


def _parents(payload: bytes, coarse_count: int) -> list[int]:
    """The map, from the numbers of children."""
    decoder = RangeDecoder(payload)
    contexts = Contexts.fresh(4 * UNSIGNED_CONTEXTS)
    parents = []
    before = 0
    for vertex in range(coarse_count):
        before = contexts.unsigned(decoder, min(before, 3) * UNSIGNED_CONTEXTS)
        parents += [vertex] * (before + 1)
    decoder.finish()
    return parents


def _corrected(points: Points, payload: bytes, shift: int, bits: int) -> Points:
    """The true positions: cells of the predictions plus Diffs."""
    decoder = RangeDecoder(payload)
    contexts = Contexts.fresh(3 * SIZE_CLASSES * SIGNED_CONTEXTS)
    corrected = []
    size = 0
    for point in points:
        size_class = 0
        while size_class < SIZE_CLASSES - 1 and size >> (size_class + 1):
            size_class += 1
        cell = []
        total = 0
        for axis in range(3):
            difference = contexts.signed(decoder, (axis * SIZE_CLASSES + size_class) * SIGNED_CONTEXTS)
            predicted = min(math.floor((point[axis] + 0.5) / float(1 << shift)), (1 << (bits - shift)) - 1)
            cell.append(predicted + difference)
            total += abs(difference)
        size = (size + total) >> 1
        corrected.append(_centre(cell, shift))
    decoder.finish()
    return corrected


def _centre(cell: list[int], shift: int) -> list[float]:
    """Position of a cell's vertex in finest steps."""
    return [(coordinate + 0.5) * float(1 << shift) - 0.5 for coordinate in cell]
