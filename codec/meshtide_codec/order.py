"""The input's order: its vertices, its faces and their first corners, which quantization gives up, kept on request.

A stream's vertices are in Morton order, welded ones are one, its faces are sorted and start at their smallest
index. Who needs the input's own order, for attributes that are kept elsewhere, stores it behind the last packet:
the number of input vertices and of input faces, then the stream vertex of each vertex, then the corners of each face
(codec/core, surface/order.hpp). Faces that quantization made degenerate or merged come back too. O(n + m log m).
"""

from __future__ import annotations

from ctypes import byref
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec import core
from meshtide_codec.argument_types import check_type
from meshtide_codec.limits import Limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.packets import Packet, PacketKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Faces = NDArray[np.integer]


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
    handle, payload = core.Handle("mt_order_free"), core.Bytes()
    given = core.InputOrder.lent(_unsigned(order.vertices), _unsigned(order.faces))
    mesh = core.StreamMesh.lent(_corners(stream_faces), vertex_count)
    core.call("mt_order_encode", byref(given), byref(mesh), byref(handle.pointer), byref(payload))
    return Packet(PacketKind.ORDER, 0, 0, payload.copied())


def read_order(
    packet: Packet, stream_faces: Faces, vertex_count: int, limits: Limits | None = None, stream_bytes: int = 0
) -> Order:
    """The order that `order_packet` wrote, given the same faces and number of vertices.

    `stream_bytes` of the stream, besides the packet, stand behind its claims.

    Raises:
        PacketError: the packet is damaged.
        LimitError: it claims more vertices or faces than `limits` allow.
    """
    handle, found = core.Handle("mt_order_free"), core.InputOrder()
    core.call(
        "mt_order_decode",
        byref(core.Bytes.lent(packet.payload)),
        byref(core.StreamMesh.lent(_corners(stream_faces), vertex_count)),
        byref(core.Limited.of(limits or Limits())),
        stream_bytes,
        byref(handle.pointer),
        byref(found),
    )
    vertices = core.copied(found.vertices, (found.vertex_count,), np.uint32)
    faces = core.copied(found.faces, (found.face_count, 3), np.uint32)
    return Order(vertices.astype(np.int64), faces.astype(np.int64))


def in_input_order(mesh: Mesh, order: Order) -> Mesh:
    """The finest level with the vertices and faces of the input, in the input's order.

    >>> mesh = Mesh.checked([[0, 0, 0], [0, 1, 0], [1, 0, 0]], [[0, 2, 1]])
    >>> restored = in_input_order(mesh, Order(np.array([2, 0, 1, 2]), np.array([[1, 3, 2]])))
    >>> restored.vertices[:, 0].tolist(), restored.faces.tolist()
    ([1.0, 0.0, 0.0, 1.0], [[1, 3, 2]])
    """
    check_type("the mesh", mesh, Mesh)
    check_type("the order", order, Order, remedy="Decoder.order gives it for streams that store it")
    return Mesh(mesh.vertices[order.vertices], order.faces)


def _unsigned(array: NDArray[np.int64]) -> NDArray[np.uint32]:
    return np.ascontiguousarray(array, np.uint32)


def _corners(faces: Faces) -> NDArray[np.int32]:
    return np.ascontiguousarray(faces, np.int32).reshape(-1, 3)
