"""The input's order: its vertices, its faces and their first corners, which quantization gives up, kept on request.

A stream's vertices stand in Morton order, welded ones are one, its faces are sorted and start at their smallest
index. Who needs the input's own order, for attributes that are kept elsewhere, stores it behind the last packet:
the number of input vertices and of input faces, then the stream vertex of each vertex, then the corners of each face
(`order_kernels`). Faces that quantization made degenerate or merged come back too. Cost: O(n log n + m log m).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from meshtide_codec import order_kernels as kernels
from meshtide_codec.entropy.codec import PayloadReader, PayloadWriter
from meshtide_codec.entropy.model_kernels import new_contexts
from meshtide_codec.errors import PacketError
from meshtide_codec.limits import Limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.stream.packets import Packet, PacketKind
from meshtide_codec.stream.parts import read_number, write_number
from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder

    Faces = NDArray[np.integer]

Index = TypeVar("Index", bound=np.integer)


@dataclass(frozen=True, slots=True)
class Order:
    """A mesh as its file had it, but for the positions.

    Args:
        vertices: (input vertices,) int64, the vertex of level 0 that each input vertex became.
        faces: (input faces, 3) int64, indices of input vertices.
    """

    vertices: NDArray[np.int64]
    faces: NDArray[np.int64]


def order_packet(order: Order, stream_faces: Faces, vertex_count: int) -> Packet:
    """The packet that holds `order`, given the faces (m, 3) and the number of vertices of level 0.

    >>> order = Order(np.array([1, 0, 2, 1]), np.array([[1, 2, 3], [0, 3, 2]]))
    >>> packet = order_packet(order, np.array([[0, 2, 1]]), 3)
    >>> read_order(packet, np.array([[0, 2, 1]]), 3).faces.tolist()
    [[1, 2, 3], [0, 3, 2]]
    """
    payloads = [_payload(order, stream_faces, vertex_count, by_row=by_row) for by_row in (False, True)]
    counts = write_number(len(order.vertices)) + write_number(len(order.faces))
    return Packet(PacketKind.ORDER, 0, 0, counts + min(payloads, key=len))


def _payload(order: Order, stream_faces: Faces, vertex_count: int, *, by_row: bool) -> bytes:
    """What stands behind the counts when faces are told in one way."""
    stream = _stream(order.vertices, stream_faces, vertex_count, by_row=by_row)
    ranks, keys = _ranks_and_keys(order, stream, stream_faces)
    vertices, faces = np.array(order.vertices), np.array(order.faces)  # kernels write what they read

    def write(coder: Coder, buffer: Buffer) -> None:
        contexts = new_contexts(kernels.CONTEXTS)
        stream.expected[:] = 0
        kernels.code_steps(coder, buffer, contexts, vertices, vertex_count)
        kernels.code_faces(coder, buffer, contexts, stream, faces, ranks, keys)

    writer = PayloadWriter()
    writer.write(write, 2 * (len(vertices) + len(faces)))
    return write_number(int(by_row)) + writer.payload()


def read_order(
    packet: Packet, stream_faces: Faces, vertex_count: int, limits: Limits | None = None, stream_bytes: int = 0
) -> Order:
    """The order that `order_packet` wrote, given the same faces and number of vertices.

    `stream_bytes` of the stream, besides the packet, stand behind its claims.

    Raises:
        PacketError: the packet is damaged.
        LimitError: it claims more vertices or faces than `limits` allow.
    """
    label = packet.kind.label
    try:
        vertices, position = read_number(packet.payload, 0)
        faces, position = read_number(packet.payload, position)
        by_row, position = read_number(packet.payload, position)
    except BadValueError as error:
        raise PacketError(f"{error}; the stream is damaged", packet=label, offset=0) from error
    limits = limits or Limits()
    limits.check_mesh(vertices, faces)
    limits.check_share(vertices, faces, stream_bytes + len(packet.payload))
    reader = PayloadReader(packet.payload[position:])
    contexts = new_contexts(kernels.CONTEXTS)
    order = Order(np.zeros(vertices, np.int64), np.zeros((faces, 3), np.int64))
    status = kernels.code_steps(reader.coder, reader.buffer, contexts, order.vertices, vertex_count)
    if status == kernels.OK:
        stream = _stream(order.vertices, stream_faces, vertex_count, by_row=by_row == 1)
        ranks, keys = np.zeros(faces, np.int64), np.zeros(faces, np.int64)
        status = kernels.code_faces(reader.coder, reader.buffer, contexts, stream, order.faces, ranks, keys)
    if status != kernels.OK or not reader.finished or by_row > 1:
        raise PacketError(
            f"it does not hold {vertices} indices below {vertex_count} and {faces} faces; the stream is damaged",
            packet=label,
            offset=position + reader.offset,
        )
    return order


def in_input_order(mesh: Mesh, order: Order) -> Mesh:
    """The finest level with the vertices and faces of the input, in the input's order.

    >>> mesh = Mesh.checked([[0, 0, 0], [0, 1, 0], [1, 0, 0]], [[0, 2, 1]])
    >>> restored = in_input_order(mesh, Order(np.array([2, 0, 1, 2]), np.array([[1, 3, 2]])))
    >>> restored.vertices[:, 0].tolist(), restored.faces.tolist()
    ([1.0, 0.0, 0.0, 1.0], [[1, 3, 2]])
    """
    return Mesh(mesh.vertices[order.vertices], order.faces)


def _stream(
    vertices: NDArray[np.int64], stream_faces: Faces, vertex_count: int, *, by_row: bool
) -> kernels.StreamFaces:
    """The stream's faces by their keys, and the input vertices that each of its vertices was made of."""
    twin_starts, twins = _grouped(vertices, vertex_count)
    faces = np.ascontiguousarray(stream_faces, np.int32).reshape(-1, 3)
    if not by_row and len(faces):
        labels = np.full(vertex_count, -1)
        named = twin_starts[:-1] < twin_starts[1:]
        labels[named] = twins[twin_starts[:-1][named]]
        faces = _turned(faces, np.argmax(labels[faces], axis=1))
    starts, numbers = _grouped(faces[:, 0], vertex_count)
    expected = np.zeros(vertex_count, np.int64)
    return kernels.StreamFaces(by_row, faces, starts, numbers, vertices, twin_starts, twins, expected)


def _turned(faces: NDArray[Index], firsts: NDArray[np.integer]) -> NDArray[Index]:
    """The faces (m, 3), each turned so that its corner number `firsts` stands first."""
    return np.take_along_axis(faces, (firsts[:, None] + np.arange(3)) % 3, axis=1)


def _grouped(values: Faces, count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where the places of each value in [0, count) start in the second array, which holds them all, ascending."""
    starts = np.zeros(count + 1, np.int64)
    np.cumsum(np.bincount(values, minlength=count), out=starts[1:])
    return starts, np.argsort(values, kind="stable")


def _ranks_and_keys(
    order: Order, stream: kernels.StreamFaces, stream_faces: Faces
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Of each input face what `code_faces` calls its rank, and the place of its key."""
    ranks, keys = np.full(len(order.faces), -1, np.int64), np.zeros(len(order.faces), np.int64)
    a, b, c = order.vertices[order.faces].T
    kept = np.flatnonzero((a != b) & (b != c) & (c != a))
    if len(kept) == 0:
        return ranks, keys
    triples = np.stack([a, b, c], axis=1)[kept]
    rows = _places(_turned(triples, np.argmin(triples, axis=1)), stream_faces.astype(np.int64), len(stream.starts))
    key_vertices = stream.faces[rows, 0]
    if stream.by_row:
        ranks[kept] = rows
    else:
        places = np.empty(len(stream.numbers), np.int64)
        places[stream.numbers] = np.arange(len(stream.numbers))
        ranks[kept] = places[rows] - stream.starts[key_vertices]
    keys[kept] = np.argmax(triples == key_vertices[:, None], axis=1)
    return ranks, keys


def _places(rows: NDArray[np.int64], table: NDArray[np.int64], end: int) -> NDArray[np.int64]:
    """Where each row (k, 3) stands in the sorted `table` (m, 3), which holds it; all values are below `end`."""
    pairs = table[:, 0] * end + table[:, 1]
    distinct = np.unique(pairs)
    keys = np.searchsorted(distinct, pairs) * end + table[:, 2]
    wanted = np.searchsorted(distinct, rows[:, 0] * end + rows[:, 1]) * end + rows[:, 2]
    places: NDArray[np.int64] = np.searchsorted(keys, wanted)
    return places
