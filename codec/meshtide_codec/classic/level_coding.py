"""Payloads of the classic profile's packets: Base, Map&Conn, Param and Diff, to bytes and back.

============  ==================================================================================================
packet        payload
============  ==================================================================================================
Base          two parts, cells and faces: Morton codes of the coarsest cells by their gaps; its connectivity
Map&Conn      two parts, counts and faces: children of each vertex of the coarser level; faces given the coarser ones
Param         float32, little-endian: the coefficients of x, then y, then z
Diff          range-coded integers in steps of the level's own grid: true cell minus the cell of the prediction
============  ==================================================================================================
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.classic import coding_kernels
from meshtide_codec.connectivity import read_faces, write_faces
from meshtide_codec.entropy import codec as entropy
from meshtide_codec.entropy.model_kernels import new_contexts
from meshtide_codec.errors import BaseError, DiffError, MapConnError, ParamError
from meshtide_codec.filters import FilterSpec, check_coefficients, coefficient_count
from meshtide_codec.quantize import morton_codes, morton_positions
from meshtide_codec.stream.parts import join_parts, split_parts
from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from numpy.typing import NDArray

EXPECTED_BYTES_PER_VALUE = 1
HALF_GAP_BITS = 30
NO_FACES = np.zeros((0, 3), np.int32)


def encode_base(cells: NDArray[np.int32], faces: NDArray[np.int32], bits: int) -> bytes:
    """The coarsest level: cells (n, 3) below 2^bits in Morton order, faces (m, 3)."""
    codes = morton_codes(cells).astype(np.int64)
    contexts = 2 * coding_kernels.CELL_CONTEXTS
    cell_payload = entropy.encoded(
        lambda coder, buffer: coding_kernels.code_ascending(
            coder, buffer, new_contexts(contexts), codes.copy(), HALF_GAP_BITS, 1 << (3 * bits)
        ),
        8 * len(cells),
    )
    parents = np.zeros(len(cells), np.int32)
    return join_parts([cell_payload, _face_payload(faces, parents, NO_FACES, 1)])


def decode_base(
    payload: bytes, vertex_count: int, face_count: int, bits: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Cells (n, 3) and faces (m, 3) that `encode_base` wrote.

    Raises:
        BaseError, MapConnError: anything else.
    """
    cell_payload, face_payload = _two_parts(payload, BaseError)
    codes = np.zeros(vertex_count, np.int64)
    coder, buffer = entropy.opened(cell_payload)
    contexts = new_contexts(2 * coding_kernels.CELL_CONTEXTS)
    status = coding_kernels.code_ascending(coder, buffer, contexts, codes, HALF_GAP_BITS, 1 << (3 * bits))
    if status != coding_kernels.OK or not entropy.fully_read(coder, cell_payload):
        raise BaseError(f"cells do not fit a grid of {bits} bits; the stream is damaged")
    cells = morton_positions(codes.astype(np.uint64)).astype(np.int32)
    parents = np.zeros(vertex_count, np.int32)
    return cells, _faces(face_payload, parents, NO_FACES, 1, face_count)


def encode_map_conn(
    parents: NDArray[np.int32], faces: NDArray[np.int32], coarse_faces: NDArray[np.int32], coarse_count: int
) -> bytes:
    """How the vertices of the coarser level split, and the faces of this one."""
    counts = np.bincount(parents, minlength=coarse_count)
    count_payload = entropy.encoded(
        lambda coder, buffer: coding_kernels.code_child_counts(
            coder, buffer, new_contexts(coding_kernels.MAP_CONTEXTS), counts.copy(), len(parents)
        ),
        EXPECTED_BYTES_PER_VALUE * coarse_count,
    )
    return join_parts([count_payload, _face_payload(faces, parents, coarse_faces, coarse_count)])


def decode_map_conn(
    payload: bytes, vertex_count: int, face_count: int, coarse_faces: NDArray[np.int32], coarse_count: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Map (n,) and faces (m, 3) that `encode_map_conn` wrote.

    Raises:
        MapConnError: anything else.
    """
    count_payload, face_payload = _two_parts(payload, MapConnError)
    counts = np.zeros(coarse_count, np.int64)
    coder, buffer = entropy.opened(count_payload)
    contexts = new_contexts(coding_kernels.MAP_CONTEXTS)
    status = coding_kernels.code_child_counts(coder, buffer, contexts, counts, vertex_count)
    if status != coding_kernels.OK or not entropy.fully_read(coder, count_payload):
        raise MapConnError(f"child counts do not add up to the header's {vertex_count} vertices; the stream is damaged")
    parents = np.repeat(np.arange(coarse_count, dtype=np.int32), counts)
    return parents, _faces(face_payload, parents, coarse_faces, coarse_count, face_count)


def encode_param(coefficients: NDArray[np.float32]) -> bytes:
    """Filter coefficients (3, count)."""
    return coefficients.astype("<f4").tobytes()


def decode_param(payload: bytes, spec: FilterSpec) -> NDArray[np.float32]:
    """Coefficients (3, count) of a filter of `spec`, as `encode_param` wrote them.

    Raises:
        ParamError: another length, or values that such a filter cannot use.
    """
    count = coefficient_count(spec)
    if len(payload) != 12 * count:
        raise ParamError(f"{len(payload)} bytes where {3 * count} coefficients take {12 * count}")
    coefficients = np.frombuffer(payload, "<f4").reshape(3, count).astype(np.float32)
    check_coefficients(spec, coefficients)
    return coefficients


def encode_diff(differences: NDArray[np.int64]) -> bytes:
    """Diffs (n, 3) in steps of their level."""
    return entropy.encoded(
        lambda coder, buffer: coding_kernels.code_differences(
            coder, buffer, new_contexts(coding_kernels.DIFF_CONTEXTS), differences.copy()
        ),
        3 * EXPECTED_BYTES_PER_VALUE * len(differences),
    )


def decode_diff(payload: bytes, vertex_count: int) -> NDArray[np.int64]:
    """Diffs (n, 3) that `encode_diff` wrote.

    Raises:
        DiffError: anything else.
    """
    differences = np.zeros((vertex_count, 3), np.int64)
    coder, buffer = entropy.opened(payload)
    status = coding_kernels.code_differences(coder, buffer, new_contexts(coding_kernels.DIFF_CONTEXTS), differences)
    if status != coding_kernels.OK or not entropy.fully_read(coder, payload):
        raise DiffError(f"the payload does not hold {vertex_count} Diffs; the stream is damaged")
    return differences


def _face_payload(
    faces: NDArray[np.int32], parents: NDArray[np.int32], coarse_faces: NDArray[np.int32], coarse_count: int
) -> bytes:
    writer = entropy.PayloadWriter()
    write_faces(writer, faces, parents, coarse_faces, coarse_count)
    return writer.payload()


def _faces(
    payload: bytes,
    parents: NDArray[np.int32],
    coarse_faces: NDArray[np.int32],
    coarse_count: int,
    face_count: int,
) -> NDArray[np.int32]:
    reader = entropy.PayloadReader(payload)
    faces = read_faces(reader, parents, coarse_faces, coarse_count, face_count)
    if not reader.finished:
        raise MapConnError("bytes follow the last face; the stream is damaged", offset=reader.offset)
    return faces


def _two_parts(payload: bytes, error_type: type[BaseError | MapConnError]) -> tuple[bytes, bytes]:
    try:
        first, second = split_parts(payload, 2)
    except BadValueError as error:
        raise error_type(f"{error}; the stream is damaged", offset=0) from error
    return first, second
